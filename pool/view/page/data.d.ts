// Written by a test of src/page/data.rs: `just generate`
export type ScenarioInfo = { name: string, width: number, height: number, 
/**
 * Blocked rectangles: west, south, east and north side, in squares.
 */
obstacles: Array<[number, number, number, number]>, attack_point: [number, number], types: Array<TypeInfo>, units: Array<UnitInfo>, n_agents: number, n_actions: number, 
/**
 * The action of an agent that means its first target. Looks stand before it, if there are any.
 */
first_target: number, episode_limit: number | null, units_per: UnitsPer, };
export type TypeInfo = { name: string, label: string, radius: number, hp: number, shield: number, energy: number, initial_energy: number, cooldown: number, attack_range: number, 
/**
 * How far agents of the type see.
 */
sight_range: number, plane: string, attack: "shot" | "beam" | "explosion" | "heal", 
/**
 * Width and height of a beam, or the radius of an explosion.
 */
attack_size: [number, number], };
export type UnitInfo = { 
/**
 * Index in `types`.
 */
type: number, 
/**
 * 0 for agents, 1 for enemies.
 */
faction: number, 
/**
 * The number in its faction.
 */
id: number, };
export type UnitsPer = { position: number, points: number, seconds: number, turn: number, };
export type ReplayData = { program: string, rules: string, scenario: ScenarioInfo, episodes: Array<EpisodeData>, };
export type EpisodeData = { 
/**
 * A text, because JavaScript has no 64-bit integers.
 */
seed: string, steps: number, 
/**
 * The step with which the recording begins.
 */
first_step: number, episode_return: number, result: "won" | "lost" | "truncated" | "unfinished", 
/**
 * Allies and enemies that died.
 */
dead: [number, number], n_moments: number, 
/**
 * Compressed, in base64.
 */
moments: string, 
/**
 * Compressed, in base64.
 */
decisions: string, };
export type EpisodeResult = "won" | "lost" | "truncated";
export type Features = { name: string, start: number, 
/**
 * `None` for a block that is one row and not a list of units.
 */
rows: number | null, features: Array<string>, };
export type Order = { "type": "none" } | { "type": "stop" } | { "type": "move", 
/**
 * From the west side of the map.
 */
x: number, 
/**
 * From its south side.
 */
y: number, } | { "type": "target", 
/**
 * Its battle-wide id.
 */
unit: number, };
export type AgentOrder = { 
/**
 * Its number.
 */
agent: number, 
/**
 * What it is told.
 */
order: Order, };
