// @ts-check
// The entry of the editor of a program, which opens and saves the files that its command names.

import { startEditor } from "#playground/editor/editor.js";
import { byId, messageOf, say } from "#view/dom.js";
import { LARGEST_FILES } from "./connection.js";
import { ProgramEngine } from "./program_engine.js";

/** @param {{ other: string }} data */
async function editWithProgram(data) {
  const engine = new ProgramEngine(say, LARGEST_FILES),
    { connection } = engine;
  await engine.opened;
  say("");
  const open = async () => ({
    ...(await connection.request({ type: "open_files" })),
    /** @type {import("#playground/editor/files.js").Opened["save"]} */
    save: (files, base, replace) => connection.request({ type: "save_files", files, base, replace }),
  });
  const page = await startEditor(engine, open, data.other);
  const resume = () => {
    say("");
    page.checker.check();
  };
  engine.listener = { say, resume };
}

editWithProgram(JSON.parse(byId("data").textContent)).catch((error) =>
  say(`The files cannot be opened: ${messageOf(error)}`),
);
