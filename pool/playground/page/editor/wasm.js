// @ts-check
// The entry of the editor that has its engine inside. It begins with the scenario of the address, as
// `#scenario=2s3z` or one that the playground hands over, and saves by download.

import { byId, messageOf, say } from "#view/dom.js";
import { inflate } from "#view/track.js";
import { WasmEngine } from "../engine.js";
import { startEditor } from "./editor.js";

/** @import { Builtins } from "../protocol.d.ts" */

/** @param {{ engine: string, other: string }} data `engine`: the code, compressed by deflate, in base64. */
async function editInPage(data) {
  const engine = await WasmEngine.load(await inflate(data.engine));
  const download = () => Promise.reject(new Error("this page saves by download"));
  const open = async (/** @type {Builtins} */ builtins) => ({
    files: { source: "new_scenario.json", text: builtins.new, unit_files: [] },
    target: null,
    exists: false,
    base: {},
    save: download,
  });
  await startEditor(engine, open, data.other);
}

editInPage(JSON.parse(byId("data").textContent)).catch((error) => {
  say(`The page cannot start: ${messageOf(error)}`);
  console.error(error);
});
