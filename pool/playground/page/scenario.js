// @ts-check
// Scenarios as `Source` in src/protocol.rs has them: a name, or a text.

/**
 * Whether a scenario is a text, not the name of one.
 * @param {string} scenario
 */
export const isText = (scenario) => scenario.trimStart().startsWith("{");

/**
 * The name in the text of a scenario, which may have its files inside (`Source` in src/protocol.rs).
 * @param {string} text
 * @returns {string | null}
 */
export function nameOf(text) {
  try {
    const { name, files } = JSON.parse(text);
    return (files ? nameOf(files.text) : name) ?? null;
  } catch {
    return null;
  }
}
