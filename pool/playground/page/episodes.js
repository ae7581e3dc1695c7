// @ts-check
// EpisodeList: the episodes of an opened replay.

import { byId, episodeRow } from "#view/dom.js";
import { counted } from "#view/numbers.js";
import { RESULTS } from "#view/player.js";
import { textOf } from "./files.js";

/** @import { Engine } from "./engine.js" */
/** @import { EpisodeInfo } from "./protocol.d.ts" */

export class EpisodeList {
  /** @param {(episode: number) => void} open */
  constructor(open) {
    this.open = open;
  }

  clear() {
    this.show([]);
  }

  /**
   * Shows the episodes of a replay, and says that they were verified; it is an error if they are not.
   * @param {Engine} engine
   * @param {string} name
   * @param {Uint8Array<ArrayBuffer>} bytes
   */
  async read(engine, name, bytes) {
    const replay = await textOf(name, bytes);
    const { episodes, program } = await engine.request({ type: "open_replay", name, replay });
    this.show(episodes);
    const which = episodes.length === 1 ? "The episode" : `All ${episodes.length} episodes`;
    return `${which} of ${name} (${program}) verified: every tick has the recorded bits.`;
  }

  /** @param {EpisodeInfo[]} episodes */
  show(episodes) {
    byId("episodes").hidden = !episodes.length;
    byId("episodes")
      .querySelector("ol")
      .replaceChildren(...episodes.map((episode, i) => this.row(episode, i)));
  }

  /**
   * @param {EpisodeInfo} episode
   * @param {number} index
   */
  row(episode, index) {
    const result = episode.result ?? "unfinished";
    const cells = [
      String(index + 1),
      RESULTS[result],
      counted(episode.steps, "step"),
      episode.return.toFixed(2),
    ];
    const title = `Checksum ${episode.checksum}`;
    return episodeRow(cells, result, () => this.open(index), { title });
  }
}
