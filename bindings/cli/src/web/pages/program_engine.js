// @ts-check
// ProgramEngine: battles, in the program that serves the page.

import { EngineLost } from "#playground/engine.js";
import { messageOf } from "#view/dom.js";
import { Connection, ConnectionLost } from "./connection.js";

/** @import { Request, Response } from "#playground/protocol.d.ts" */
/**
 * What a page does when the connection is lost or refused, and when a new session knows all that the old one
 * was told.
 * @typedef {{ say: (text: string) => void, resume: () => void }} Listener
 */

const LOST = "The connection to smaclite-pool is lost. Trying again.";

export class ProgramEngine {
  /**
   * @param {(text: string) => void} say
   * @param {number} [largest] Bytes of the longest message that the program reads from this page.
   */
  constructor(say, largest) {
    /** @type {Listener} */
    this.listener = { say, resume: () => location.reload() };
    /** @type {Map<string, Request>} What a new session must be told again: its teams, and the replay. */
    this.told = new Map();
    /** Whether the session knows it. */
    this.isReady = false;
    this.isFirst = true;
    /** @type {() => void} */
    this.ready = () => {};
    /** @type {Promise<void>} */
    this.opened = new Promise((resolve) => (this.ready = resolve));
    this.connection = new Connection(
      {
        open: () => this.open().catch((error) => this.listener.say(messageOf(error))),
        close: () => this.lose(),
        refuse: (error) => this.listener.say(error),
      },
      largest,
    );
  }

  async open() {
    for (const request of this.told.values()) await this.send(request);
    this.isReady = true;
    if (!this.isFirst) this.listener.resume();
    this.isFirst = false;
    this.ready();
  }

  lose() {
    this.isReady = false;
    this.listener.say(LOST);
  }

  /**
   * The response to a request; an error if it is refused.
   * @template {Request["type"]} T
   * @param {Extract<Request, { type: T }>} request
   * @returns {Promise<Extract<Response, { type: T }>>}
   */
  async request(request) {
    if (!this.isReady) throw new EngineLost(LOST);
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
   * @param {Request} request
   * @returns {Promise<any>}
   */
  async send(request) {
    const { outcome } = await this.connection.request({ type: "session", request }).catch((error) => {
      throw error instanceof ConnectionLost ? new EngineLost(LOST) : error;
    });
    if ("error" in outcome) throw new Error(outcome.error);
    return outcome.response;
  }
}
