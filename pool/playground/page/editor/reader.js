// @ts-check
// JsonReader: reads a text into nodes, which say where each value is in it.

/** As deep as the program reads. */
const DEEPEST = 127;

/**
 * A value in the text, from offset `start` to `end`. A scalar has a `value`, a list has `items`, an object
 * has `entries`.
 * @typedef {{ kind: string, start: number, end: number, value?: string | number | boolean | null,
 *   items?: JsonNode[], entries?: JsonEntry[] }} JsonNode
 * @typedef {{ key: string, start: number, keyEnd: number, node: JsonNode }} JsonEntry
 */

export class JsonError extends Error {
  /**
   * @param {string} reason
   * @param {number} offset
   */
  constructor(reason, offset) {
    super(reason);
    this.offset = offset;
  }
}

/** Reads a text into nodes. */
export class JsonReader {
  /** @param {string} text */
  constructor(text) {
    this.text = text;
    this.at = text.charCodeAt(0) === 0xfeff ? 1 : 0;
    this.depth = 0;
  }

  read() {
    const node = this.value();
    this.space();
    if (this.at < this.text.length) this.fail("characters after the end");
    return node;
  }

  /**
   * @param {string} reason
   * @returns {never}
   */
  fail(reason) {
    throw new JsonError(reason, this.at);
  }

  space() {
    while (" \t\n\r".includes(this.text[this.at] ?? "x")) this.at++;
  }

  /**
   * Whether the next character is this one, which is then passed.
   * @param {string} character
   */
  pass(character) {
    this.space();
    if (this.text[this.at] !== character) return false;
    this.at++;
    return true;
  }

  /** @returns {JsonNode} */
  value() {
    this.space();
    const start = this.at,
      first = this.text[start];
    if (first === "{" || first === "[") {
      if (++this.depth > DEEPEST) this.fail("nested too deeply");
      this.at++;
      const node = first === "{" ? this.entries(start) : this.items(start);
      this.depth--;
      return { ...node, end: this.at };
    }
    // eslint-disable-next-line no-control-regex -- strings of JSON have none
    return this.scalar(/"(?:[^"\\\u0000-\u001f]|\\.)*"|-?\d+(?:\.\d+)?(?:[eE][+-]?\d+)?|true|false|null/y);
  }

  /**
   * @param {RegExp} pattern
   * @returns {JsonNode}
   */
  scalar(pattern) {
    const start = this.at;
    pattern.lastIndex = start;
    const text = pattern.exec(this.text)?.[0];
    if (text === undefined) this.fail("a value is expected");
    try {
      const value = JSON.parse(text);
      this.at += text.length;
      return { kind: value === null ? "null" : typeof value, start, end: this.at, value };
    } catch {
      return this.fail("no JSON value");
    }
  }

  /** @param {number} start */
  items(start) {
    /** @type {JsonNode[]} */
    const items = [];
    if (this.pass("]")) return { kind: "array", start, items };
    do items.push(this.value());
    while (this.pass(","));
    if (!this.pass("]")) this.fail("`,` or `]` is expected");
    return { kind: "array", start, items };
  }

  /** @param {number} start */
  entries(start) {
    /** @type {JsonEntry[]} */
    const entries = [],
      keys = new Set();
    if (this.pass("}")) return { kind: "object", start, entries };
    do {
      this.space();
      // eslint-disable-next-line no-control-regex -- as above
      const key = this.scalar(/"(?:[^"\\\u0000-\u001f]|\\.)*"/y);
      if (keys.size === keys.add(key.value).size) this.fail("a duplicate key");
      if (!this.pass(":")) this.fail("`:` is expected");
      entries.push({ key: String(key.value), start: key.start, keyEnd: key.end, node: this.value() });
    } while (this.pass(","));
    if (!this.pass("}")) this.fail("`,` or `}` is expected");
    return { kind: "object", start, entries };
  }
}
