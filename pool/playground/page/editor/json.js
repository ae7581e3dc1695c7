// @ts-check
// JsonText: the text of a JSON file, and where each value is in it. An edit replaces only the characters of
// the value that it changes, so whatever the editor does not understand stays as it is.

import { JsonError, JsonReader } from "./reader.js";

/** @import { JsonEntry, JsonNode } from "./reader.js" */
/** @typedef {(string | number)[]} Path */

/** Lists and objects are written on one line up to this column. */
const LAST_COLUMN = 110;
export const INDENT = "    ";

/**
 * A number as text. JSON would have null for one that is too large; it stays so, which the program then says.
 * @param {number} value
 */
export const numberText = (value) => JSON.stringify(value).replace("null", value < 0 ? "-1e999" : "1e999");

/**
 * A value as text, in the style of the standard scenarios' files; `column` is where it begins.
 * @param {unknown} value
 * @returns {string}
 */
function jsonOf(value, indent = "", column = indent.length) {
  if (typeof value === "number") return numberText(value);
  if (value === null || typeof value !== "object") return JSON.stringify(value);
  const isList = Array.isArray(value),
    inner = indent + INDENT;
  const parts = isList ? value : Object.entries(value);
  const [open, close] = isList ? "[]" : "{}";
  if (!parts.length) return open + close;
  /** @type {(key: string) => string} */
  const name = (key) => (isList ? "" : `${JSON.stringify(key)}: `);
  const texts = parts.map((part) => (isList ? jsonOf(part, inner) : name(part[0]) + jsonOf(part[1], inner)));
  const line = isList ? `[${texts.join(", ")}]` : `{ ${texts.join(", ")} }`;
  const hasObjects = isList && value.some((item) => item !== null && typeof item === "object");
  if (!hasObjects && !line.includes("\n") && column + line.length <= LAST_COLUMN) return line;
  return `${open}\n${texts.map((text) => inner + text).join(",\n")}\n${indent}${close}`;
}

/**
 * A list with one item per line, as maps are written.
 * @param {unknown[]} items
 * @param {string} indent
 */
export function linesOf(items, indent) {
  const texts = items.map((item) => `${indent}${INDENT}${JSON.stringify(item)}`);
  return `[\n${texts.join(",\n")}\n${indent}]`;
}

/** Text that is written as it is. */
export class Raw {
  /** @param {(indent: string) => string} write */
  constructor(write) {
    this.write = write;
  }
}

/**
 * A key as messages show it.
 * @param {string} key
 */
const shortKey = (key) => {
  const letters = [...key].map((letter) => (/\p{Cc}/u.test(letter) ? "?" : letter));
  return letters.length > 60 ? `${letters.slice(0, 60).join("")}...` : letters.join("");
};

/**
 * The values in a list or object.
 * @param {JsonNode} parent
 */
const partsOf = (parent) => parent.items ?? (parent.entries ?? []).map((entry) => entry.node);

export class JsonText {
  /**
   * @param {string} text
   * @param {string[]} keys those of the file, in the order in which it has them
   */
  constructor(text, keys = []) {
    this.text = text;
    this.keys = keys;
    /** @type {JsonNode | null} */
    this.root = null;
    /** @type {JsonError | null} */
    this.error = null;
    try {
      this.root = new JsonReader(text).read();
    } catch (error) {
      if (!(error instanceof JsonError)) throw error;
      this.error = error;
    }
  }

  /** Whether keys can be read and set. */
  get isObject() {
    return this.root?.kind === "object";
  }

  /**
   * The node at a path of keys and indices.
   * @param {Path} path
   * @returns {JsonNode | null}
   */
  node(path) {
    /** @type {JsonNode | null | undefined} */
    let node = this.root;
    for (const step of path) {
      if (node?.entries) node = node.entries.find((entry) => entry.key === step)?.node;
      else node = node?.items?.[Number(step)];
    }
    return node ?? null;
  }

  /**
   * The value at a path; undefined if there is none. Objects become Maps, which keep the order of all keys.
   * @param {Path} path
   * @returns {any}
   */
  value(path = []) {
    /** @type {(node: JsonNode) => unknown} */
    const plain = (node) => {
      if (node.items) return node.items.map(plain);
      if (node.entries) return new Map(node.entries.map(({ key, node }) => [key, plain(node)]));
      return node.value;
    };
    const node = this.node(path);
    return node ? plain(node) : undefined;
  }

  /**
   * The path that a message writes as in `groups[1].units.MARINE`, as far as it exists.
   * @param {string} written
   */
  locate(written) {
    /** @type {(node: JsonNode, rest: string) => Path} */
    const follow = (node, rest) => {
      if (!rest) return [];
      /** @type {Path} */
      let best = [];
      /** @type {(step: string | number, child: JsonNode, name: string) => void} */
      const attempt = (step, child, name) => {
        if (!rest.startsWith(name)) return;
        const tail = rest.slice(name.length);
        if (tail && !".[".includes(tail[0])) return;
        const path = [step, ...follow(child, tail.replace(/^\./, ""))];
        if (path.length > best.length) best = path;
      };
      for (const { key, node: child } of node.entries ?? []) attempt(key, child, shortKey(key));
      node.items?.forEach((child, i) => attempt(i, child, `[${i}]`));
      return best;
    };
    return this.root && written ? follow(this.root, written) : [];
  }

  /**
   * First and last offset of an entry or item, with its key.
   * @param {Path} path
   */
  span(path) {
    const node = this.node(path);
    if (!node) return [0, 0];
    const parent = this.node(path.slice(0, -1));
    const entry = path.length ? parent?.entries?.find((e) => e.node === node) : null;
    return [entry ? entry.start : node.start, node.end];
  }

  /**
   * Line and column of an offset, from 1.
   * @param {number} offset
   */
  position(offset) {
    const before = this.text.slice(0, offset).split("\n");
    return { line: before.length, column: (before.at(-1) ?? "").length + 1 };
  }

  /**
   * The offset of a line and column.
   * @param {number} line
   * @param {number} column
   */
  offset(line, column) {
    const lines = this.text.split("\n").slice(0, line - 1);
    const start = lines.reduce((sum, text) => sum + text.length + 1, 0);
    return Math.min(this.text.length, start + Math.max(0, column - 1));
  }

  /**
   * The whitespace at the start of the line of an offset.
   * @param {number} offset
   */
  indentAt(offset) {
    const start = this.text.lastIndexOf("\n", offset - 1) + 1;
    return /^[ \t]*/.exec(this.text.slice(start, offset))?.[0] ?? "";
  }

  /**
   * A text with the line ends of this one.
   * @param {string} text
   */
  withLineEnds(text) {
    return this.text.includes("\r\n") ? text.replace(/\r?\n/g, "\r\n") : text;
  }

  /**
   * This text with pieces replaced: [start, end, text].
   * @param {[number, number, string][]} pieces
   */
  replaced(...pieces) {
    pieces.sort((a, b) => b[0] - a[0]);
    /** @type {(text: string, piece: [number, number, string]) => string} */
    const replace = (text, [start, end, piece]) =>
      text.slice(0, start) + this.withLineEnds(piece) + text.slice(end);
    return new JsonText(pieces.reduce(replace, this.text), this.keys);
  }

  /**
   * @param {unknown} value
   * @param {string} indent
   * @param {number} [column]
   * @returns {string}
   */
  write(value, indent, column) {
    return value instanceof Raw ? value.write(indent) : jsonOf(value, indent, column);
  }

  /**
   * Replaces a value, or adds it: at its usual place in a file, or as the last one of an inner object.
   * @param {Path} path
   * @param {unknown} value
   * @returns {JsonText}
   */
  set(path, value) {
    const node = this.node(path);
    if (node) {
      const indent = this.indentAt(node.start);
      const column = node.start - this.text.lastIndexOf("\n", node.start - 1) - 1;
      const text = this.withLineEnds(this.write(value, indent, column));
      return text === this.text.slice(node.start, node.end)
        ? this
        : this.replaced([node.start, node.end, text]);
    }
    const parent = this.node(path.slice(0, -1));
    if (!parent?.entries) return this;
    const name = `${JSON.stringify(path.at(-1))}: `;
    const rank = path.length === 1 ? this.keys.indexOf(String(path[0])) : -1;
    /** @type {(entry: JsonEntry) => boolean} */
    const isBefore = ({ key }) => this.keys.includes(key) && this.keys.indexOf(key) < rank;
    const at = rank < 0 ? parent.entries.length : parent.entries.findLastIndex(isBefore) + 1;
    const starts = parent.entries.map((entry) => entry.start);
    return this.insert(parent, starts, at, (indent) => name + this.write(value, indent));
  }

  /**
   * Inserts an item into a list, before the one at an index.
   * @param {Path} path
   * @param {number} index
   * @param {unknown} value
   */
  insertItem(path, index, value) {
    const list = this.node(path);
    if (!list?.items) return this;
    const starts = list.items.map((item) => item.start);
    return this.insert(list, starts, index, (indent) => this.write(value, indent));
  }

  /**
   * @param {JsonNode} parent
   * @param {number[]} starts of its parts
   * @param {number} at
   * @param {(indent: string) => string} write
   */
  insert(parent, starts, at, write) {
    const ends = partsOf(parent).map((node) => node.end);
    const outer = this.indentAt(parent.start);
    if (!starts.length) {
      const isList = parent.kind === "array";
      if (isList || parent === this.root) {
        const inner = outer + INDENT;
        const text = `${isList ? "[" : "{"}\n${inner}${write(inner)}\n${outer}${isList ? "]" : "}"}`;
        return this.replaced([parent.start, parent.end, text]);
      }
      return this.replaced([parent.start, parent.end, `{ ${write(outer)} }`]);
    }
    const hasLines = this.text.slice(parent.start, starts[0]).includes("\n");
    const indent = hasLines ? this.indentAt(starts[0]) : outer;
    const gap = hasLines ? `\n${indent}` : " ";
    if (at === 0) return this.replaced([starts[0], starts[0], `${write(indent)},${gap}`]);
    return this.replaced([ends[at - 1], ends[at - 1], `,${gap}${write(indent)}`]);
  }

  /**
   * Removes an entry or item, if it is there.
   * @param {Path} path
   * @returns {JsonText}
   */
  remove(path) {
    const node = this.node(path),
      parent = this.node(path.slice(0, -1));
    if (!node || !parent || !path.length) return this;
    const nodes = partsOf(parent);
    const starts = (parent.entries ?? nodes).map((part) => part.start);
    const at = nodes.indexOf(node);
    if (nodes.length === 1) return this.replaced([parent.start + 1, parent.end - 1, ""]);
    if (at > 0) return this.replaced([nodes[at - 1].end, node.end, ""]);
    return this.replaced([starts[0], starts[1], ""]);
  }

  /**
   * Gives an entry another key, and another value if one is given.
   * @param {Path} path
   * @param {string} key
   * @param {unknown} [value]
   * @returns {JsonText}
   */
  rename(path, key, value) {
    const parent = this.node(path.slice(0, -1));
    const entry = parent?.entries?.find((entry) => entry.key === path.at(-1));
    if (!entry || (key !== entry.key && parent?.entries?.some((other) => other.key === key))) return this;
    const text = value === undefined ? null : this.write(value, this.indentAt(entry.start));
    /** @type {[number, number, string][]} */
    const pieces = [[entry.start, entry.keyEnd, JSON.stringify(key)]];
    if (text !== null) pieces.push([entry.node.start, entry.node.end, text]);
    return this.replaced(...pieces);
  }

  /**
   * Exchanges two neighbours of an object or list: the ones at `index` and `index + 1`.
   * @param {Path} path
   * @param {number} index
   */
  exchange(path, index) {
    const parent = this.node(path);
    /** @type {(i: number) => [number, number] | undefined} */
    const part = (i) => {
      const entry = parent?.entries?.[i],
        node = entry?.node ?? parent?.items?.[i];
      return node && [entry?.start ?? node.start, node.end];
    };
    const [first, second] = [part(index), part(index + 1)];
    if (!first || !second) return this;
    const texts = [first, second].map(([start, end]) => this.text.slice(start, end));
    return this.replaced([...first, texts[1]], [...second, texts[0]]);
  }

  /**
   * The same content in the style of the standard scenarios' files.
   * @returns {JsonText}
   */
  formatted() {
    if (!this.root?.entries) return this;
    const text = `${this.tidy(this.root, "", 0, true)}\n`;
    return text === this.text ? this : new JsonText(text, this.keys);
  }

  /**
   * @param {JsonNode} node
   * @param {string} indent
   * @param {number} column where it begins
   * @param {boolean} isBroken whether each part has a line, though all would fit into one
   * @returns {string}
   */
  tidy(node, indent, column, isBroken = false) {
    const { entries, items } = node;
    if (!entries && !items) return this.text.slice(node.start, node.end);
    const inner = indent + INDENT;
    /** @type {(entry: JsonEntry) => string} */
    const tidyEntry = (entry) => {
      const name = `${this.text.slice(entry.start, entry.keyEnd)}: `;
      const isMap = node === this.root && entry.key === "terrain";
      return name + this.tidy(entry.node, inner, inner.length + name.length, isMap);
    };
    const texts =
      entries?.map(tidyEntry) ?? (items ?? []).map((item) => this.tidy(item, inner, inner.length));
    const [open, close] = items ? "[]" : "{}";
    if (!texts.length) return open + close;
    const line = items ? `[${texts.join(", ")}]` : `{ ${texts.join(", ")} }`;
    const isLong = line.includes("\n") || column + line.length > LAST_COLUMN;
    const hasObjects = items?.some((item) => item.entries || item.items);
    if (!isBroken && !hasObjects && !isLong) return line;
    return `${open}\n${texts.map((text) => inner + text).join(",\n")}\n${indent}${close}`;
  }
}
