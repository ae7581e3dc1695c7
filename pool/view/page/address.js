// @ts-check
// What the address of a page of a replay says behind `#`: what is shown first.

/** What can stand there; `theme` is read by theme.js. */
const KEYS_OF_REPLAY = ["episode", "tick", "unit", "speed", "play", "fit", "theme"];
/** Keys whose values are words, and those words. */
const WORDS_OF_REPLAY = { play: ["1", "0"], fit: ["map"], theme: ["dark", "light"] };

/**
 * What is shown first, and what the address says that cannot be shown.
 * @param {string} text
 * @param {{ episodes: number, units: number, speeds: number[] }} counts the numbers of both, and all speeds
 */
export function readAddress(text, { episodes, units, speeds }) {
  const said = new URLSearchParams(text);
  /** @type {string[]} */
  const problems = [];
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
    const range = below === Infinity ? "a whole number" : `a whole number from 0 to ${below - 1}`;
    problems.push(`\`${key}\` must be ${range}, got \`${given}\``);
    return otherwise;
  };
  for (const [key, values] of Object.entries(WORDS_OF_REPLAY)) {
    const given = said.get(key) ?? values[0];
    if (!values.includes(given)) problems.push(`\`${key}\` must be ${values.join(" or ")}, got \`${given}\``);
  }
  for (const key of said.keys())
    if (!KEYS_OF_REPLAY.includes(key))
      problems.push(`it has no \`${key}\`, but ${KEYS_OF_REPLAY.join(", ")}`);
  const speed = Number(said.get("speed") ?? 1);
  if (!speeds.includes(speed))
    problems.push(`\`speed\` must be one of ${speeds.join(", ")}, got \`${said.get("speed")}\``);
  return {
    episode: number("episode", episodes, 0),
    tick: number("tick", Infinity, 0),
    unit: number("unit", units, -1),
    speed: speeds.includes(speed) ? speed : 1,
    plays: said.get("play") === "1",
    showsMap: said.get("fit") === "map",
    problem: problems.join("; "),
  };
}
