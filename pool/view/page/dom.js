// @ts-check
// Elements of the document.

/**
 * The element of an id, which the page has. It is of the kind that the HTML of the page says.
 * @param {string} id
 * @returns {any}
 */
export const byId = (id) => document.getElementById(id);

/**
 * All elements of a selector, which the HTML of the page has.
 * @param {string} selector
 * @param {ParentNode} [root]
 * @returns {HTMLElement[]}
 */
export const all = (selector, root = document) => [...root.querySelectorAll(selector)].map(asElement);

/**
 * Lets the link at the start of the page move the focus and nothing else: what the address has behind `#`
 * says what the page shows.
 */
export function listenToSkip() {
  const [skip] = all(".skip");
  skip?.addEventListener("click", (event) => {
    event.preventDefault();
    byId(skip.getAttribute("href")?.slice(1) ?? "").focus();
  });
}

/**
 * Lets a person drop files on the page.
 * @param {(data: DataTransfer) => unknown} take
 */
export function listenToDrops(take) {
  for (const name of /** @type {const} */ (["dragover", "dragleave", "drop"]))
    addEventListener(name, (event) => {
      if (name !== "dragleave") event.preventDefault();
      document.body.classList.toggle("dropping", name === "dragover");
      if (name === "drop" && event.dataTransfer) take(event.dataTransfer);
    });
}

/** Whether the person points with a finger. */
export const isTouch = () => matchMedia("(pointer: coarse)").matches;

/** @param {any} node */
const asElement = (node) => /** @type {HTMLElement} */ (node);

/**
 * Offers content as a file, which the browser saves.
 * @param {string} name
 * @param {BlobPart} content
 * @param {string} type
 */
export function download(name, content, type) {
  const url = URL.createObjectURL(new Blob([content], { type }));
  make("a", { href: url, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(url), 10_000);
}

/** What can show a page. */
export const BROWSERS = "Firefox 113, Chrome 103, Safari 16.4, or newer";

/** @typedef {Node | string} Child */

/**
 * Makes an element; properties that are no properties of elements become attributes.
 * @template {keyof HTMLElementTagNameMap} K
 * @param {K} tag
 * @param {{ [key: string]: unknown }} [properties]
 * @param {Child | Child[]} [children]
 * @returns {HTMLElementTagNameMap[K]}
 */
export function make(tag, properties = {}, children = []) {
  const element = document.createElement(tag);
  for (const [key, value] of Object.entries(properties)) {
    if (key in element) Object.assign(element, { [key]: value });
    else element.setAttribute(key, String(value));
  }
  element.append(...(Array.isArray(children) ? children : [children]));
  return element;
}

/**
 * Names with their values, as a list of descriptions has them.
 * @param {Iterable<[name: string, value: Child | number]>} rows
 */
export const pairsOf = (rows) =>
  [...rows].flatMap(([name, value]) => [
    make("dt", {}, name),
    make("dd", {}, typeof value === "number" ? String(value) : value),
  ]);

/**
 * Shows facts beside the name of the page.
 * @param {{ [name: string]: string | number }} facts
 */
export const showFacts = (facts) =>
  byId("facts").replaceChildren(...Object.entries(facts).map((fact) => make("div", {}, pairsOf([fact]))));

/**
 * A row of a list of episodes: its number, how it ended, and more.
 * @param {string[]} cells
 * @param {string} result
 * @param {() => void} open
 * @param {{ [key: string]: unknown }} [properties]
 */
export function episodeRow(cells, result, open, properties = {}) {
  const spans = cells.map((cell, at) => make("span", { className: at === 1 ? `dot ${result}` : "" }, cell)),
    button = make("button", { type: "button", ...properties }, spans);
  button.addEventListener("click", open);
  return make("li", {}, button);
}

/**
 * Marks the shown one in a list of episodes.
 * @param {number} episode
 */
export const markEpisode = (episode) =>
  all("#episodes button").forEach((button, i) => button.setAttribute("aria-current", String(i === episode)));

/** Milliseconds for which `tell` shows a message. */
const SHOWN_FOR = 6000;

/** @type {ReturnType<typeof setTimeout> | undefined} */
let quiet;

/**
 * Shows a message: what was done, or why it was not. An empty one hides it.
 * @param {string} text
 */
export function say(text, isError = true) {
  clearTimeout(quiet);
  Object.assign(byId("message"), { hidden: !text, textContent: text });
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

/** Letters of a message: names in it can be as long as a link. */
const LONGEST_MESSAGE = 500;

/**
 * Says something until the person goes on.
 * @param {string} text
 */
export function showMessage(text) {
  say(text.length > LONGEST_MESSAGE ? `${text.slice(0, LONGEST_MESSAGE)}…` : text);
  for (const event of ["pointerdown", "keydown"]) addEventListener(event, () => say(""), { once: true });
}

/**
 * What a caught value says.
 * @param {unknown} error
 */
export const messageOf = (error) => (error instanceof Error ? error.message : String(error));
