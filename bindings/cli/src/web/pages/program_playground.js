// @ts-check
// The entry of the playground of a program.

import { startPlayground } from "#playground/main.js";
import { byId, messageOf } from "#view/dom.js";
import { ProgramEngine } from "./program_engine.js";

/** @import { PageData } from "#playground/main.js" */

/** @param {string} text */
const show = (text) => Object.assign(byId("message"), { hidden: false, textContent: text });

/** @param {PageData} data */
async function playWithProgram(data) {
  const engine = new ProgramEngine(show);
  await engine.opened;
  const page = await startPlayground(engine, data);
  engine.listener = { say: (text) => page.fail(new Error(text)), resume: () => page.resume() };
}

playWithProgram(JSON.parse(byId("data").textContent)).catch((error) =>
  show(`The page cannot start: ${messageOf(error)}`),
);
