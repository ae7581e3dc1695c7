// @ts-check
// Arithmetic that the other scripts share.

/**
 * @param {number} value
 * @param {number} [low]
 * @param {number} [high]
 */
export const clamp = (value, low = 0, high = 1) => Math.min(high, Math.max(low, value));

/**
 * A share of a motion that is fast at first.
 * @param {number} part
 */
export const easeOut = (part) => 1 - (1 - clamp(part)) ** 3;

/**
 * A number of things, as text.
 * @param {number} number
 * @param {string} noun
 */
export const counted = (number, noun) => `${number} ${noun}${number === 1 ? "" : "s"}`;
