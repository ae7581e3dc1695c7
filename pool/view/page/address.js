// @ts-check
// What the address of a page of a replay says behind `#`: what is shown first.

/** What can stand there; `theme` is read by theme.js. */
const KEYS_OF_REPLAY = ["episode", "tick", "unit", "speed", "play", "fit", "theme"];
/** Keys whose values are words, and those words. */
const WORDS = /** @type {{ [key: string]: string[] }} */ ({
  play: ["1", "0"],
  fit: ["map"],
  theme: ["dark", "light"],
});

/**
 * What an address says that its page cannot follow.
 * @param {URLSearchParams} said
 * @param {string[]} keys those of the page
 */
export function misread(said, keys) {
  return [...new Set(said.keys())].flatMap((key) => {
    const [given, ...more] = said.getAll(key),
      words = WORDS[key];
    if (!keys.includes(key)) return [`it has no \`${key}\`, but ${keys.join(", ")}`];
    if (more.length) return [`it must have \`${key}\` once, got it ${more.length + 1} times`];
    if (!words || words.includes(given)) return [];
    return [`\`${key}\` must be ${words.join(" or ")}, got \`${given}\``];
  });
}

/**
 * What is shown first, and what the address says that cannot be shown.
 * @param {string} text
 * @param {{ moments: number[], units: number, speeds: number[] }} counts the moments of each episode, the
 *   number of units, and all speeds
 */
export function readAddress(text, { moments, units, speeds }) {
  const said = new URLSearchParams(text),
    problems = misread(said, KEYS_OF_REPLAY);
  /**
   * A whole number below a limit.
   * @param {string} key
   * @param {number} below
   * @param {number} otherwise
   */
  const number = (key, below, otherwise) => {
    const given = said.get(key);
    if (given === null) return otherwise;
    if (/^\d+$/.test(given) && Number(given) < below) return Number(given);
    problems.push(`\`${key}\` must be a whole number from 0 to ${below - 1}, got \`${given}\``);
    return otherwise;
  };
  const speed = Number(said.get("speed") ?? 1);
  if (!speeds.includes(speed))
    problems.push(`\`speed\` must be one of ${speeds.join(", ")}, got \`${said.get("speed")}\``);
  const episode = number("episode", moments.length, 0);
  return {
    episode,
    tick: number("tick", moments[episode], 0),
    unit: number("unit", units, -1),
    speed: speeds.includes(speed) ? speed : 1,
    plays: said.get("play") === "1",
    showsMap: said.get("fit") === "map",
    problem: problems.join("; "),
  };
}
