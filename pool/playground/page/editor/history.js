// @ts-check
// History: the states of a document, with undo.

/** @import { JsonText } from "./json.js" */
/** @typedef {{ name: string, keys: string[], file: JsonText }} UnitText */
/**
 * The files at one time; `shown` is the scenario file as map and forms show it.
 * @typedef {{ source: string, scenario: JsonText, shown: JsonText, units: UnitText[] }} State
 */
/**
 * Changes in a row with the same text are undone as one.
 * @typedef {string | null} Merge
 */

/** Limits: states, and characters of text in them. */
const MOST_STATES = 400;
const MOST_CHARACTERS = 60e6;

/** The size of a state in characters. */
const sizeOf = (/** @type {State | undefined} */ state) => state?.scenario.text.length ?? 0;

export class History {
  /** @param {State} state */
  constructor(state) {
    this.state = this.saved = state;
    /** @type {State[]} */
    this.past = [];
    /** @type {State[]} */
    this.future = [];
    /** @type {Merge} */
    this.merge = null;
    /** @type {(() => void)[]} */
    this.listeners = [];
  }

  get isSaved() {
    return this.saved === this.state;
  }

  /**
   * Begins with another state.
   * @param {State} state
   */
  begin(state) {
    this.state = this.saved = state;
    this.past = [];
    this.future = [];
    this.merge = null;
    this.changed();
  }

  changed() {
    this.listeners.forEach((listener) => listener());
  }

  /**
   * Goes on to a new state.
   * @param {State} state
   * @param {Merge} merge
   */
  push(state, merge) {
    if (merge === null || merge !== this.merge) this.past.push(this.state);
    this.merge = merge;
    this.future = [];
    this.state = state;
    let total = this.past.reduce((sum, past) => sum + sizeOf(past), 0);
    while (this.past.length > MOST_STATES || (this.past.length > 1 && total > MOST_CHARACTERS))
      total -= sizeOf(this.past.shift());
    this.changed();
  }

  undo() {
    this.go(this.past, this.future);
  }

  redo() {
    this.go(this.future, this.past);
  }

  /**
   * @param {State[]} from
   * @param {State[]} to
   */
  go(from, to) {
    const state = from.pop();
    if (!state) return;
    to.push(this.state);
    this.state = state;
    this.merge = null;
    this.changed();
  }

  /** Ends a row of changes that are undone as one. */
  settle() {
    this.merge = null;
  }
}
