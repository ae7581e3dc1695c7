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

/** Letters of a message: names in it can be as long as a link. */
const LONGEST_MESSAGE = 500;

/**
 * Says something until the person goes on.
 * @param {string} text
 */
export function showMessage(text) {
  byId("message").textContent = text.length > LONGEST_MESSAGE ? `${text.slice(0, LONGEST_MESSAGE)}…` : text;
  byId("message").hidden = false;
  const hide = () => (byId("message").hidden = true);
  for (const event of ["pointerdown", "keydown"]) addEventListener(event, hide, { once: true });
}

/**
 * What a caught value says.
 * @param {unknown} error
 */
export const messageOf = (error) => (error instanceof Error ? error.message : String(error));
