// Written by a test of protocol/mod.rs, from the types there: `just generate`
import type { Outcome as SessionOutcome, Request as SessionRequest, ScenarioFiles } from "#playground/protocol.d.ts";
import type { EpisodeResult, Features, ScenarioInfo } from "#view/data.d.ts";

export type Version = 8;
export type LaneStats = Record<
  "steps" | "episodes" | "wins" | "returns" | "lengths" | "frames"
  | "rejected" | "accepted" | "waited_ns",
  number
>;
export type Base = { [file: string]: string };
export type RequestMessage = { id: number, request: PageRequest, };
export type ResponseMessage = { 
/**
 * None if the message was not understood.
 */
id?: number, } & ({ "response": PageResponse } | { "error": string });
export type Outcome = { "response": PageResponse } | { "error": string };
export type EventMessage = { event: PageEvent, };
export type PageRequest = { "type": "hello", version: number, } | { "type": "select_lane", name: string, } | { "type": "set_view", 
/**
 * The first environment whose cell is visible.
 */
first: number, 
/**
 * How many cells are.
 */
count: number, 
/**
 * Whether the page is.
 */
visible: boolean, } | { "type": "follow", env: number, } | { "type": "unfollow", } | { "type": "get_steps", number: number, step: number, } | { "type": "get_observation", number: number, step: number, agent: number, } | { "type": "get_snapshot", number: number, step: number, } | { "type": "open_files", } | { "type": "save_files" } & SaveFiles | { "type": "session", request: SessionRequest, };
export type PageResponse = { "type": "hello", } | { "type": "select_lane", } | { "type": "set_view", } | { "type": "follow", } | { "type": "unfollow", } | { "type": "get_steps" } & Steps | { "type": "get_observation", obs: Array<number>, } | { "type": "get_snapshot" } & SnapshotFile | { "type": "open_files" } & OpenedFiles | { "type": "save_files" } & SavedFiles | { "type": "session", outcome: SessionOutcome, };
export type PageEvent = { "type": "lane" } & LaneInfo | { "type": "lost", error: string, } | { "type": "grid", cells: Array<GridCell>, } | { "type": "status" } & PoolState | { "type": "episodes", episodes: Array<EpisodeInfo>, };
export type SaveFiles = { files: ScenarioFiles, 
/**
 * What the page last opened or saved.
 */
base: Base, 
/**
 * Whether files are written that were changed since then.
 */
replace: boolean, };
export type Steps = { number: number, 
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
 * Return and length of the episode after them.
 */
return: number, length: number, 
/**
 * How the last of them ended the episode, if it did.
 */
result: EpisodeResult | null, 
/**
 * Whether the episode has no more steps.
 */
is_over: boolean, };
export type SnapshotFile = { name: string, 
/**
 * In base64.
 */
record: string, };
export type OpenedFiles = { files: ScenarioFiles, 
/**
 * The file that is saved, if the command names one.
 */
target: string | null, 
/**
 * Whether it exists.
 */
exists: boolean, base: Base, };
export type SavedFiles = { "saved": { files: Array<string>, base: Base, } } | { "conflicts": Array<string> };
export type LaneInfo = { scenario: ScenarioInfo, lane: string, num_envs: number, rules: string, 
/**
 * Why there is no grid, if there is none.
 */
no_grid: string | null, has_state: boolean, features: Array<Features>, };
export type GridCell = { env: number, length: number | null, return: number | null, 
/**
 * How the episode ended that the row shows the end of.
 */
outcome: EpisodeResult | null, 
/**
 * How the last episode ended whose end was seen.
 */
last: EpisodeResult | null, 
/**
 * One moment in base64.
 */
moment: string | null, };
export type PoolState = { points: Array<Point>, } & ({ "pool": PoolInfo } | { "error": string });
export type PoolResponse = { "pool": PoolInfo } | { "error": string };
export type PoolInfo = { pid: number, threads: number, uptime_s: number, 
/**
 * The names of all lanes.
 */
lanes: Array<string>, 
/**
 * The one that the page shows.
 */
lane: LaneState | null, };
export type LaneState = { learner_pid: number | null, spectators: number, steps_per_s: number, queue_wait_us: number, stats: LaneStats, failure: string | null, };
export type Point = { 
/**
 * Seconds since this program started.
 */
time: number, 
/**
 * Which of the pools of this name it is of, one after the other: counts of another one begin at 0.
 */
pool: number, steps_per_s: number, steps: number, episodes: number, wins: number, returns: number, lengths: number, };
export type EpisodeInfo = { number: number, steps: number, 
/**
 * The step of the battle with which the log of it begins.
 */
first_step: number, is_over: boolean, 
/**
 * How it ended, if that is known yet.
 */
result: EpisodeResult | null, 
/**
 * Seconds since its first and its newest step.
 */
began_s: number, newest_s: number, };
