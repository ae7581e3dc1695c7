// @ts-check
// The message over the map: what was done, or why it was not.

import { byId } from "#view/dom.js";

/** Milliseconds for which `tell` shows a message. */
const SHOWN_FOR = 6000;

/** @type {ReturnType<typeof setTimeout> | undefined} */
let quiet;

/**
 * Shows a message; an empty one hides it.
 * @param {string} text
 */
export function say(text, isError = true) {
  clearTimeout(quiet);
  byId("message").hidden = !text;
  byId("message").textContent = text;
  byId("message").classList.toggle("info", !isError);
}

/**
 * Shows a message that goes away.
 * @param {string} text
 */
export function tell(text, isError = false) {
  say(text, isError);
  quiet = setTimeout(() => say(""), SHOWN_FOR);
}
