// @ts-check
// The entry of the page that has its engine inside.

import { byId } from "#view/dom.js";
import { inflate } from "#view/track.js";
import { WasmEngine } from "./engine.js";
import { startPlayground } from "./main.js";

/** @import { PageData } from "./main.js" */

/** @param {PageData & { engine: string }} data `engine`: the code, compressed by deflate, in base64. */
async function startInPage(data) {
  await startPlayground(await WasmEngine.load(await inflate(data.engine)), data);
}

startInPage(JSON.parse(byId("data").textContent)).catch((error) => {
  byId("message").hidden = false;
  const browsers = "Firefox 113, Chrome 103, Safari 16.4, or newer";
  byId("message").textContent = `The page cannot start: ${error.message}. It needs ${browsers}.`;
  console.error(error);
});
