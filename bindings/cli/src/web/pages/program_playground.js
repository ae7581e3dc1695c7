// @ts-check
// The entry of the playground of a program.

import { EngineLost } from "#playground/engine.js";
import { startPlayground } from "#playground/main.js";
import { byId, messageOf, say } from "#view/dom.js";
import { LARGEST_FILES } from "./connection.js";
import { ProgramEngine } from "./program_engine.js";

/** @import { PageData } from "#playground/main.js" */

/** @param {PageData} data */
async function playWithProgram(data) {
  const engine = new ProgramEngine(say, LARGEST_FILES);
  await engine.opened;
  say("");
  const page = await startPlayground(engine, data);
  engine.listener = { say: (text) => page.fail(new Error(text)), resume: () => page.resume() };
}

playWithProgram(JSON.parse(byId("data").textContent)).catch((error) => {
  // Then the page is loaded again when there is a connection.
  say(error instanceof EngineLost ? error.message : `The page cannot start: ${messageOf(error)}`);
});
