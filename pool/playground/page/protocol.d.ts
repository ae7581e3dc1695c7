// Written by a test of src/protocol.rs: `just generate`
import type { AgentOrder, EpisodeResult, Features, Order, ScenarioInfo, TypeInfo } from "#view/data.d.ts";

type UnitFile = { name: string; keys: string[]; text: string };
export type ScenarioFiles = { source: string; text: string; unit_files: UnitFile[] };
export type Problem = {
  file: string; line: number | null; column: number | null; path: string; message: string;
};
export type JsonSchema = {
  type?: string;
  minimum?: number;
  exclusiveMinimum?: number;
  maximum?: number;
  enum?: string[];
  items?: JsonSchema;
  properties?: { [key in string]?: JsonSchema };
  default?: unknown;
  description?: string;
  propertyNames?: JsonSchema;
};
export type Request = { "type": "get_choices", } | { "type": "add_team" } & TeamFiles | { "type": "open_scenario", files: Array<TextFile>, } | { "type": "open_replay", name: string, 
/**
 * The file's text; the page decompresses it.
 */
replay: string, } | { "type": "begin_battle" } & BeginBattle | { "type": "play_steps", steps: number, } | { "type": "give_orders", orders: Array<AgentOrder>, } | { "type": "take_agents", agents: Array<number>, } | { "type": "get_observation", step: number, agent: number, } | { "type": "get_replay", } | { "type": "move_unit", unit: number, x: number, y: number, } | { "type": "paint_map", rows: Array<string>, } | { "type": "get_builtins", } | { "type": "check_files", files: ScenarioFiles, groups: Array<Group>, 
/**
 * Of the teams and start positions that are drawn.
 */
seed: string, };
export type Response = { "type": "get_choices" } & Choices | { "type": "add_team", teams: Array<TeamInfo>, } | { "type": "open_scenario", scenario: string, } | { "type": "open_replay" } & OpenedReplay | { "type": "begin_battle" } & BegunBattle | { "type": "play_steps" } & PlayedSteps | { "type": "give_orders", orders: Array<Order>, } | { "type": "take_agents", } | { "type": "get_observation", obs: Array<number>, } | { "type": "get_replay" } & ReplayFile | { "type": "move_unit", scenario: string, } | { "type": "paint_map", scenario: string, } | { "type": "get_builtins" } & Builtins | { "type": "check_files" } & CheckedFiles;
export type Outcome = { "response": Response } | { "error": string };
export type Choices = { 
/**
 * The standard scenarios.
 */
scenarios: Array<string>, 
/**
 * Those whose teams and start positions are drawn.
 */
generated: Array<string>, 
/**
 * Scripts that play the enemies.
 */
opponents: Array<string>, 
/**
 * Scripts that play the agents.
 */
policies: Array<string>, rules: Array<string>, teams: Array<TeamInfo>, };
export type TeamInfo = { name: string, 
/**
 * The name of the scenario that it was trained in.
 */
scenario: string, 
/**
 * That scenario as [`Source::Scenario`] has it.
 */
source: string, 
/**
 * Whether it plays every scenario.
 */
is_universal: boolean, };
export type TeamFiles = { 
/**
 * What the page calls it.
 */
name: string, 
/**
 * The text of `run.json`.
 */
run: string, 
/**
 * The weights, safetensors in base64.
 */
weights: string, };
export type TextFile = { 
/**
 * Its name, without folders.
 */
name: string, text: string, };
export type BeginBattle = { of: Source, 
/**
 * The script or trained team that plays the agents.
 */
team: string, 
/**
 * The joint actions of the steps that are played at once, agent by agent, without those of a team that
 * plays the enemies; if they are left out, all that were recorded of the episode.
 */
actions: Array<number> | null, 
/**
 * The agents that carry out orders.
 */
taken: Array<number>, };
export type Source = { "kind": "scenario", 
/**
 * A name, the text of a scenario file, or what `run.json` has of a battle: an object with the key
 * `files`, which has unit files too.
 */
scenario: string, 
/**
 * A whole number; as a text, because JavaScript has no 64-bit integers.
 */
seed: string, 
/**
 * The script or trained team that plays the enemies; those of the scenario if this is empty. A team
 * sees the map turned by half a turn.
 */
opponent: string, 
/**
 * Those of the scenario if this is empty.
 */
rules: string, } | { "kind": "episode", episode: number, };
export type BegunBattle = { scenario: ScenarioInfo, features: Array<Features>, 
/**
 * The scenario as [`Source::Scenario`] has it, for another battle.
 */
source: string, rules: string, 
/**
 * Who plays the enemies.
 */
opponent: string, seed: string, 
/**
 * The step with which it begins: not 0 if a replay recorded it from a snapshot on.
 */
first_step: number, 
/**
 * Whether it can be played on; a battle in which actions play the enemies too is only shown.
 */
is_playable: boolean, 
/**
 * What is probably a mistake in its scenario, if that is none of the standard ones.
 */
warnings: Array<string>, played: PlayedSteps, };
export type PlayedSteps = { 
/**
 * The first of them, and how many there are.
 */
step: number, steps: number, n_moments: number, 
/**
 * In base64.
 */
moments: string, 
/**
 * In base64.
 */
decisions: string, 
/**
 * Return of the episode after them.
 */
return: number, 
/**
 * How the episode ended, if it did.
 */
result: EpisodeResult | null, 
/**
 * The orders that hold after them, by agent.
 */
orders: Array<Order>, };
export type OpenedReplay = { 
/**
 * The program that recorded it.
 */
program: string, episodes: Array<EpisodeInfo>, };
export type EpisodeInfo = { seed: string, steps: number, return: number, result: EpisodeResult | null, 
/**
 * XXH3 over the bits of all units after every tick and of every reward: 16 hexadecimal digits.
 */
checksum: string, };
export type ReplayFile = { name: string, 
/**
 * The file's text; the page compresses it by gzip.
 */
replay: string, 
/**
 * As in [`EpisodeInfo`].
 */
checksum: string, };
export type Group = { x: number, y: number, faction: string, 
/**
 * Types and their counts.
 */
units: Array<[string, number]>, };
export type Builtins = { 
/**
 * The text of a new scenario.
 */
new: string, scenarios: Array<NamedText>, presets: Array<Preset>, units: Array<StandardUnit>, rules: Array<string>, scenario_format: FileFormat, unit_format: FileFormat, 
/**
 * Keywords of `targeter`, with the parameters of each.
 */
targeters: Array<TargeterFormat>, };
export type NamedText = { name: string, text: string, };
export type Preset = { name: string, 
/**
 * As scenario files have them: the southernmost first.
 */
rows: Array<string>, };
export type StandardUnit = { name: string, text: string, 
/**
 * Whether a unit file of this name has priority over it.
 */
is_replaceable: boolean, };
export type FileFormat = { 
/**
 * In the order in which files have them.
 */
keys: Array<KeyFormat>, };
export type KeyFormat = { name: string, 
/**
 * Of its value: type, range, keywords, default, description.
 */
schema: JsonSchema, };
export type TargeterFormat = { name: string, parameters: Array<KeyFormat>, };
export type CheckedFiles = { 
/**
 * The first 100 per reader.
 */
problems: Problem[], 
/**
 * How many there are, also of those that are not listed.
 */
n_problems: number, 
/**
 * What is probably a mistake in a valid scenario.
 */
warnings: Problem[], 
/**
 * Of a valid scenario.
 */
summary: Summary | null, types: TypeInfo[], 
/**
 * The units of each group: `[index in types, x, y]`; none if a type is unknown.
 */
groups: Array<Array<[number, number, number]> | null>, 
/**
 * The units that a seed draws in a valid generated scenario: `[index in types, faction, x, y]`, where
 * the faction is 0 for allies and 1 for enemies.
 */
drawn: Array<[number, number, number, number]> | null, };
export type Summary = { n_agents: number, n_enemies: number, n_actions: number, obs_size: number, state_size: number, };
