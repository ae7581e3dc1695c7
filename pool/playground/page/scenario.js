// @ts-check
// Scenarios as `Source` in src/protocol.rs has them: a name, or a text; and the texts of files.

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

/**
 * The text of a file. No byte is replaced.
 * @param {string} name
 * @param {BufferSource} bytes
 */
export function textOfBytes(name, bytes) {
  try {
    return new TextDecoder("utf-8", { fatal: true }).decode(bytes);
  } catch (cause) {
    throw new Error(`${name}: cannot be read: it is not UTF-8 text`, { cause });
  }
}

/** @param {File} file */
export const textOfFile = async (file) => textOfBytes(file.name, await file.arrayBuffer());
