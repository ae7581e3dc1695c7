// Connection: requests to the program that serves this page, and the events that it sends.

/** Milliseconds until a lost connection is tried again. */
const RETRY_AFTER = 1000;

/** Bytes of the longest message that the program reads. */
const LARGEST_MESSAGE = 2 ** 22;

/** There is no connection to the program, or it ended before the answer. */
class ConnectionLost extends Error {}

class Connection {
  /** `handlers` has a function per event, and `open` and `lost`. */
  constructor(handlers) {
    this.handlers = handlers;
    this.waiting = new Map();
    this.next = 1;
    this.connect();
  }

  connect() {
    const token = new URLSearchParams(location.search).get("token") ?? "";
    const path = location.pathname.replace(/[^/]*$/, "ws");
    this.socket = new WebSocket(`ws://${location.host}${path}?token=${encodeURIComponent(token)}`);
    this.socket.onopen = () => this.handlers.open();
    this.socket.onmessage = (message) => this.hear(JSON.parse(message.data));
    this.socket.onclose = () => {
      for (const { reject } of this.waiting.values()) reject(new ConnectionLost("the connection is lost"));
      this.waiting.clear();
      this.handlers.lost();
      setTimeout(() => this.connect(), RETRY_AFTER);
    };
  }

  hear(message) {
    if (message.event) return this.handlers[message.event]?.(message);
    const { resolve, reject } = this.waiting.get(message.id) ?? {};
    this.waiting.delete(message.id);
    if (message.error) reject?.(new Error(message.error));
    else resolve?.(message);
  }

  /** The answer to a request; an error if it was refused or the connection is lost. */
  ask(what, more = {}) {
    return new Promise((resolve, reject) => {
      if (this.socket.readyState !== WebSocket.OPEN) return reject(new ConnectionLost("not connected"));
      const id = this.next++;
      const message = JSON.stringify({ ...more, id, do: what });
      const { length } = new TextEncoder().encode(message);
      if (length > LARGEST_MESSAGE) return reject(new Error("the message is larger than 4 MiB"));
      this.waiting.set(id, { resolve, reject });
      this.socket.send(message);
    });
  }
}
