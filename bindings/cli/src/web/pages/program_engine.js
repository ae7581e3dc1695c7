// @ts-check
// ProgramEngine: battles, in the program that serves the playground; and the entry of that page.

import { startPlayground } from "#playground/main.js";
import { byId } from "#view/dom.js";
import { Connection, ConnectionLost, messageOf } from "./connection.js";

/** @import { Request, Response } from "#playground/protocol.d.ts" */
/** @import { PageData } from "#playground/main.js" */

const LOST = "The connection to smaclite-pool is lost. Trying again.";

class ProgramEngine {
  constructor() {
    /** @type {Map<string, Request>} What a session that is new must be told again: its teams, and the replay. */
    this.told = new Map();
    /** What to do when a new session knows all this. */
    this.resume = () => {};
    /** @param {string} _text */
    this.say = (_text) => {};
    this.isLost = false;
    /** @type {Promise<void>} */
    this.opened = new Promise((resolve) => {
      this.connection = new Connection({
        open: () => this.open().then(resolve),
        close: () => this.lose(),
        refuse: (error) => this.say(error),
      });
    });
  }

  async open() {
    for (const request of this.told.values()) await this.send(request);
    if (this.isLost) this.resume();
    this.isLost = false;
  }

  lose() {
    this.isLost = true;
    this.say(LOST);
  }

  /**
   * The response to a request; an error if it is refused.
   * @template {Request["type"]} T
   * @param {Extract<Request, { type: T }>} request
   * @returns {Promise<Extract<Response, { type: T }>>}
   */
  async request(request) {
    const response = await this.send(request);
    this.remember(request);
    return response;
  }

  /** @param {Request} request */
  remember(request) {
    if (request.type === "add_team") this.told.set(`team ${request.name}`, request);
    if (request.type === "open_replay") this.told.set("replay", request);
  }

  /**
   * @param {any} request
   * @returns {Promise<any>}
   */
  async send(request) {
    try {
      const { outcome } = await /** @type {Connection} */ (this.connection).request({
        type: "session",
        request,
      });
      if ("error" in outcome) throw new Error(outcome.error);
      return outcome.response;
    } catch (error) {
      throw error instanceof ConnectionLost ? new Error(LOST, { cause: error }) : error;
    }
  }
}

/** @param {PageData} data */
async function startWithProgram(data) {
  const engine = new ProgramEngine();
  engine.say = (text) => Object.assign(byId("message"), { hidden: false, textContent: text });
  await engine.opened;
  const page = await startPlayground(engine, data);
  engine.say = (text) => page.fail(text);
  engine.resume = () => page.resume();
}

startWithProgram(JSON.parse(byId("data").textContent)).catch((error) => {
  byId("message").hidden = false;
  byId("message").textContent = `The page cannot start: ${messageOf(error)}`;
});
