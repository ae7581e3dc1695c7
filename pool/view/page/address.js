// @ts-check
// What the address of a page says behind `#`: what is shown first.

/** What keys of several pages accept; theme.js follows `theme`. */
export const PLAY = ["1", "0"];
export const THEMES = ["dark", "light"];

/**
 * What a key accepts: words; numbers; a whole number below this one, or in this range; or, if it is null,
 * every text. It may depend on what the address says of keys before it.
 * @typedef {string[] | number[] | number | { from: number, below: number } | null} Accepted
 * @typedef {{ [key: string]: Accepted | ((said: URLSearchParams) => Accepted) }} Keys
 */

/**
 * What must stand in place of a value; nothing if it can be followed.
 * @param {string} value
 * @param {Accepted} accepted
 * @returns {string}
 */
function expectedFor(value, accepted) {
  if (accepted === null) return "";
  if (accepted === 0) return "left out, as there is none";
  if (typeof accepted === "number") return expectedFor(value, { from: 0, below: accepted });
  if ("below" in accepted) {
    const { from, below } = accepted,
      isInside = /^\d+$/.test(value) && from <= Number(value) && Number(value) < below;
    return isInside ? "" : `a whole number from ${from} to ${below - 1}`;
  }
  if (accepted.some((one) => one === (typeof one === "number" ? Number(value) : value))) return "";
  return accepted.length > 2 ? `one of ${accepted.join(", ")}` : accepted.join(" or ");
}

/**
 * What an address says that its page can follow, and what it cannot.
 * @param {string} text
 * @param {Keys} keys those of the page
 */
export function readAddress(text, keys) {
  const said = new URLSearchParams(text);
  /** @param {string} key */
  const problemOf = (key) => {
    const [given, ...more] = said.getAll(key);
    if (!Object.hasOwn(keys, key)) return [`it has no \`${key}\`, but ${Object.keys(keys).join(", ")}`];
    if (more.length) return [`it must have \`${key}\` once, got it ${more.length + 1} times`];
    const accepted = keys[key];
    const expected = expectedFor(given, typeof accepted === "function" ? accepted(said) : accepted);
    return expected ? [`\`${key}\` must be ${expected}, got \`${given}\``] : [];
  };
  const inOrder = [...Object.keys(keys).filter((key) => said.has(key)), ...said.keys()];
  const problems = [...new Set(inOrder)].flatMap((key) => {
    const problem = problemOf(key);
    if (problem.length) said.delete(key);
    return problem;
  });
  return { said, problem: problems.join("; ") };
}
