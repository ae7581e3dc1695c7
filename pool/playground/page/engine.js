// @ts-check
// WasmEngine: battles, in WebAssembly. A request and its response are one message of JSON in the engine's
// memory (`src/exports.rs`); `src/protocol.rs` declares them and writes their types to protocol.d.ts.

/** @import { Outcome, Request, Response } from "./protocol.d.ts" */
/**
 * What answers the requests of a page, one after another; an error says why a request is refused. It runs in
 * the page, or in the program that serves it.
 * @typedef {object} Engine
 * @property {<T extends Request["type"]>(request: Extract<Request, { type: T }>) =>
 *   Promise<Extract<Response, { type: T }>>} request
 */
/**
 * What the module exports.
 * @typedef {object} Exports
 * @property {WebAssembly.Memory} memory
 * @property {(length: number) => number} request
 * @property {() => number} respond
 * @property {() => number} response
 */

/** There is no connection to the engine, or it ended before the response; the page says so already. */
export class EngineLost extends Error {}

export class WasmEngine {
  /** @param {BufferSource} code */
  static async load(code) {
    const { instance } = await WebAssembly.instantiate(code, {});
    return new WasmEngine(/** @type {any} */ (instance.exports));
  }

  /** @param {Exports} exports */
  constructor(exports) {
    this.exports = exports;
  }

  /**
   * The response to a request; an error if it is refused.
   * @template {Request["type"]} T
   * @param {Extract<Request, { type: T }>} request
   * @returns {Promise<Extract<Response, { type: T }>>}
   */
  async request(request) {
    /** @type {Outcome} */
    const outcome = JSON.parse(this.respond(JSON.stringify(request)));
    if ("error" in outcome) throw new Error(outcome.error);
    return /** @type {any} */ (outcome.response);
  }

  /**
   * @param {string} request
   * @returns {string} its response
   */
  respond(request) {
    const { exports } = this,
      text = new TextEncoder().encode(request);
    try {
      const at = exports.request(text.length);
      // The memory may have grown, and then its old buffer is gone.
      new Uint8Array(exports.memory.buffer, at, text.length).set(text);
      const length = exports.respond();
      return new TextDecoder().decode(new Uint8Array(exports.memory.buffer, exports.response(), length));
    } catch (cause) {
      // A panic or a lack of memory: what was under way stays so, and every later request fails too.
      throw new Error("the engine has stopped; reload the page", { cause });
    }
  }
}
