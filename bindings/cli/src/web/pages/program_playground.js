// @ts-check
// The entry of the playground of a program.

import { EngineLost } from "#playground/engine.js";
import { startPlayground } from "#playground/main.js";
import { byId, messageOf } from "#view/dom.js";
import { LARGEST_FILES } from "./connection.js";
import { ProgramEngine } from "./program_engine.js";

/** @import { PageData } from "#playground/main.js" */

/** @param {string} text */
const show = (text) => Object.assign(byId("message"), { hidden: !text, textContent: text });

/** @param {PageData} data */
async function playWithProgram(data) {
  const engine = new ProgramEngine(show, LARGEST_FILES);
  await engine.opened;
  show("");
  const page = await startPlayground(engine, data);
  engine.listener = { say: (text) => page.fail(new Error(text)), resume: () => page.resume() };
}

playWithProgram(JSON.parse(byId("data").textContent)).catch((error) => {
  // Then the page is loaded again when there is a connection.
  show(error instanceof EngineLost ? error.message : `The page cannot start: ${messageOf(error)}`);
});
