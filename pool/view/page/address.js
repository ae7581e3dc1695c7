// @ts-check
// What the address of a page says behind `#`: what is shown first.

/** Keys that several pages have; `theme` is read by theme.js. */
export const PLAY = ["1", "0"];
export const THEMES = ["dark", "light"];

/**
 * What a key accepts: words; a whole number below this one; or, if it is null, every text. It may depend on
 * what the address says of keys before it.
 * @typedef {string[] | number | null} Accepted
 * @typedef {{ [key: string]: Accepted | ((said: URLSearchParams) => Accepted) }} Keys
 */

/**
 * What must stand in place of a value; nothing if it can be followed.
 * @param {string} value
 * @param {Accepted} accepted
 */
function expectedFor(value, accepted) {
  if (accepted === null) return "";
  if (typeof accepted === "number")
    return /^\d+$/.test(value) && Number(value) < accepted ? "" : `a whole number from 0 to ${accepted - 1}`;
  if (accepted.includes(value)) return "";
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
    const [given, ...more] = said.getAll(key),
      accepted = keys[key];
    if (accepted === undefined) return [`it has no \`${key}\`, but ${Object.keys(keys).join(", ")}`];
    if (more.length) return [`it must have \`${key}\` once, got it ${more.length + 1} times`];
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
