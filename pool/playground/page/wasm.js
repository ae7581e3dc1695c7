// @ts-check
// The entry of the page that has its engine inside.

import { BROWSERS, byId, say } from "#view/dom.js";
import { inflate } from "#view/track.js";
import { WasmEngine } from "./engine.js";
import { startPlayground } from "./main.js";

/** @import { PageData } from "./main.js" */

/** @param {PageData & { engine: string }} data `engine`: the code, compressed by deflate, in base64. */
async function startInPage(data) {
  await startPlayground(await WasmEngine.load(await inflate(data.engine)), data);
}

startInPage(JSON.parse(byId("data").textContent)).catch((error) => {
  say(`The page cannot start: ${error.message}. It needs ${BROWSERS}.`);
  console.error(error);
});
