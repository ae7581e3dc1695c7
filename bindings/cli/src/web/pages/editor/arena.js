// @ts-check
// Arena: plays the scenario, in a frame with the page of a replay.

import { byId, make } from "#view/dom.js";
import { messageOf } from "../connection.js";
import { tell } from "./message.js";

/** @import { EditorPage } from "./editor.js" */
/** @import { PlayedBattle } from "../protocol.d.ts" */

export class Arena {
  /** @param {EditorPage} page */
  constructor(page) {
    this.page = page;
  }

  async play() {
    if (this.page.checker.problems.length || byId("play").disabled) return;
    byId("play").disabled = true;
    const seed = byId("seed").value.trim() || "0";
    const choice = { policy: byId("policy").value, rules: byId("rules").value, seed };
    try {
      const files = this.page.doc.files();
      this.enter(await this.page.connection.request({ type: "play_battle", files, ...choice }));
    } catch (error) {
      tell(`Not played: ${messageOf(error)}`, true);
    } finally {
      byId("play").disabled = this.page.checker.problems.length > 0;
    }
  }

  /** Shows the page of a replay, and starts it. */
  enter(/** @type {PlayedBattle} */ { page, cut_at: cutAt }) {
    const frame = make("iframe", { title: "Battle", srcdoc: page });
    byId("cut").hidden = !cutAt;
    byId("cut").textContent = `The editor shows the first ${cutAt} steps.`;
    frame.addEventListener("load", () => this.begin(frame));
    byId("arena").append(frame);
    byId("arena").hidden = false;
  }

  /**
   * Starts the battle of a loaded page, as soon as it is shown.
   * @param {HTMLIFrameElement} frame
   */
  begin(frame) {
    const inner = frame.contentDocument;
    if (!inner) return;
    inner.addEventListener("keydown", (event) => {
      if (event.key === "Escape" && !inner.querySelector("dialog[open]")) this.leave();
    });
    const play = () => {
      if (inner.documentElement.dataset.ready === undefined) setTimeout(play, 20);
      else inner.getElementById("start")?.click();
    };
    play();
    frame.contentWindow?.focus();
  }

  leave() {
    byId("arena").querySelector("iframe")?.remove();
    byId("arena").hidden = true;
    byId("play").focus();
  }
}
