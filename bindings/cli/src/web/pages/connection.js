// @ts-check
// Connection: requests to the program that serves this page, and the events that it sends. Rust declares the
// messages (`web/protocol`) and writes their types to protocol.d.ts.

import { messageOf } from "#view/dom.js";

/**
 * @import { EventMessage, PageEvent, PageRequest, PageResponse, ResponseMessage, Version }
 *   from "./protocol.d.ts"
 */

/**
 * The version of the messages that this page was written for.
 * @type {Version}
 */
const VERSION = 8;

/** Milliseconds until a lost connection is tried again. */
const RETRY_AFTER = 1000;

/** Bytes of the longest message that the program reads from most pages. */
const LARGEST_MESSAGE = 2 ** 22;

/** Of pages that open files: a scenario with its unit files, replays, teams. */
export const LARGEST_FILES = 2 ** 26;

/** There is no connection to the program, or it ended before the response. */
export class ConnectionLost extends Error {}

/**
 * A function per event, and what to do when there is a connection, when it is lost, and when the program
 * refuses it: it has another version, or as many pages as it can have.
 * @typedef {{ [T in PageEvent["type"]]?: (event: Extract<PageEvent, { type: T }>) => void }
 *   & { open: () => void, close: () => void, refuse: (error: string) => void }} Handlers
 */

export class Connection {
  /** @param {Handlers} handlers */
  constructor(handlers, largest = LARGEST_MESSAGE) {
    this.handlers = handlers;
    this.largest = largest;
    /** @type {Map<number, { resolve: (response: any) => void, reject: (error: Error) => void }>} */
    this.waiting = new Map();
    this.next = 1;
    /** Whether the program refused the page, which then knows more than that the connection ends. */
    this.isRefused = false;
    /** @type {WebSocket} */
    this.socket = this.connect();
  }

  get isOpen() {
    return this.socket.readyState === WebSocket.OPEN;
  }

  /** @returns {WebSocket} */
  connect() {
    const token = new URLSearchParams(location.search).get("token") ?? "";
    const path = location.pathname.replace(/[^/]*$/, "ws");
    this.socket = new WebSocket(`ws://${location.host}${path}?token=${encodeURIComponent(token)}`);
    this.socket.onopen = () => this.greet();
    this.socket.onmessage = (message) => this.receive(JSON.parse(message.data));
    this.socket.onclose = () => {
      for (const { reject } of this.waiting.values()) reject(new ConnectionLost("the connection is lost"));
      this.waiting.clear();
      if (!this.isRefused) this.handlers.close();
      this.isRefused = false;
      setTimeout(() => this.connect(), RETRY_AFTER);
    };
    return this.socket;
  }

  async greet() {
    try {
      await this.request({ type: "hello", version: VERSION });
      this.handlers.open();
    } catch (error) {
      if (error instanceof ConnectionLost) return;
      this.isRefused = true;
      this.handlers.refuse(messageOf(error));
    }
  }

  /** @param {ResponseMessage | EventMessage} message */
  receive(message) {
    if ("event" in message) {
      const handler = /** @type {((event: PageEvent) => void) | undefined} */ (
        this.handlers[message.event.type]
      );
      return handler?.(message.event);
    }
    const { resolve, reject } = this.waiting.get(message.id ?? 0) ?? {};
    this.waiting.delete(message.id ?? 0);
    if ("error" in message) reject?.(new Error(message.error));
    else resolve?.(message.response);
  }

  /**
   * The response to a request; an error if it was refused or the connection is lost.
   * @template {PageRequest["type"]} T
   * @param {Extract<PageRequest, { type: T }>} request
   * @returns {Promise<Extract<PageResponse, { type: T }>>}
   */
  request(request) {
    return new Promise((resolve, reject) => {
      if (!this.isOpen) return reject(new ConnectionLost("not connected"));
      const id = this.next++;
      const message = JSON.stringify({ id, request });
      const { length } = new TextEncoder().encode(message);
      if (length > this.largest)
        return reject(new Error(`the message is larger than ${this.largest / 2 ** 20} MiB`));
      this.waiting.set(id, { resolve, reject });
      this.socket.send(message);
    });
  }
}
