// @ts-check
// Arena: plays the scenario, in a frame with the playground.

import { byId, make, messageOf, tell } from "#view/dom.js";
import { linkOf } from "../link.js";

/** @import { EditorPage } from "./editor.js" */

/**
 * The seed of the field, where nothing means 0. A text that is none is marked, and gives null; if a seed is
 * needed, the page says so.
 */
export function seedOfField(isNeeded = false) {
  const text = byId("seed").value.trim(),
    number = /^\d*$/.test(text) ? BigInt(text) : -1n,
    isSeed = number === BigInt.asUintN(64, number);
  byId("seed").setAttribute("aria-invalid", String(!isSeed));
  if (!isSeed && isNeeded) tell(`The seed must be a whole number from 0 to ${2n ** 64n - 1n}.`, true);
  return isSeed ? number : null;
}

export class Arena {
  /** @param {EditorPage} page */
  constructor(page) {
    this.page = page;
    // The playground says when a key was to leave it.
    addEventListener("message", ({ data, source }) => {
      const frame = byId("arena").querySelector("iframe");
      if (data === "leave" && frame && source === frame.contentWindow) this.leave();
    });
  }

  async play() {
    if (this.page.checker.problems.length || byId("play").disabled) return;
    const seed = seedOfField(true),
      rules = byId("rules").value;
    if (seed === null) return;
    byId("play").disabled = true;
    try {
      const { source, text, unit_files: units } = this.page.doc.files();
      const files = [
        { name: source, text },
        ...units.map(({ name, text }) => ({ name: `${name}.json`, text })),
      ];
      const { scenario } = await this.page.engine.request({ type: "open_scenario", files });
      const battle = { scenario, seed: String(seed), opponent: "", rules, team: "", actions: [], taken: [] };
      this.enter(`${this.page.playground}${location.search}#${await linkOf(battle)}&play=1`);
    } catch (error) {
      tell(`Not played: ${messageOf(error)}`, true);
    } finally {
      byId("play").disabled = this.page.checker.problems.length > 0;
    }
  }

  /**
   * Shows the playground.
   * @param {string} address
   */
  enter(address) {
    const frame = make("iframe", { title: "Battle", src: address });
    frame.addEventListener("load", () => frame.contentWindow?.focus());
    byId("arena").append(frame);
    byId("arena").hidden = false;
  }

  leave() {
    byId("arena").querySelector("iframe")?.remove();
    byId("arena").hidden = true;
    byId("play").focus();
  }
}
