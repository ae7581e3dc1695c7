// @ts-check
// When pages draw.

/**
 * Calls a function before every picture that the browser shows. The next one is asked for first, so that a
 * picture that fails is an error of its own and the page goes on.
 * @param {(now: number) => void} draw
 */
export function everyFrame(draw) {
  requestAnimationFrame((now) => {
    everyFrame(draw);
    draw(now);
  });
}
