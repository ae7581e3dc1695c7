// @ts-check
// What the actions of agents are called.

/** @import { ScenarioInfo } from "./data.d.ts" */

/** Those of all agents, before looks and targets. */
const ACTIONS = ["no-op", "stop", "north", "south", "east", "west"];

/**
 * The name of an action of an agent.
 * @param {ScenarioInfo} info
 * @param {number} agent
 * @param {number} action
 */
export function actionName(info, agent, action) {
  if (action < 0) return "none";
  if (action < ACTIONS.length) return ACTIONS[action];
  const looks = info.first_target - ACTIONS.length,
    look = action - ACTIONS.length;
  // Looks go counterclockwise, from east.
  if (look < looks) return `look ${Math.round((360 * look) / looks)}\u00b0`;
  const unit = info.units.find(({ faction, id }) => !faction && id === agent);
  const heals = unit !== undefined && info.types[unit.type].attack === "heal";
  return `${heals ? "heal agent" : "attack enemy"} ${action - info.first_target}`;
}
