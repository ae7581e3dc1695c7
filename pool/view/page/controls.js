// @ts-check
// Controls: what mouse and fingers do on the map. One finger drags like the left button, and what that does
// is the page's choice; two fingers move the map.

/** @typedef {[number, number]} At */
/** @import { Rectangle } from "./selection.js" */
/**
 * What the page does. A tap that is a second one at the same place within a moment is double.
 * @typedef {object} Handlers
 * @property {(at: At, how: { add: boolean, isDouble: boolean, isTouch: boolean }) => void} tap
 * @property {(box: Rectangle) => void} draw A drag goes on: its corners are where it began and is.
 * @property {(box: Rectangle | null, add: boolean) => void} box The drag is over; null if it was given up.
 * @property {(at: At) => void} [command] What the right button does in place of a menu.
 * @property {(dx: number, dy: number) => void} move
 * @property {(factor: number, at: At) => void} zoom
 * @property {(at: At) => void} hover
 * @property {() => void} leave
 */

/** Pixels that a pointer moves at least when it drags. */
const LEAST_DRAG = { mouse: 4, touch: 12 };
/** Milliseconds and pixels between two taps that are a double one. */
const DOUBLE_WITHIN = 350;
const DOUBLE_NEAR = 24;

/**
 * @param {At} a
 * @param {At} b
 */
const distance = (a, b) => Math.hypot(a[0] - b[0], a[1] - b[1]);

/**
 * Where a pointer is on a canvas.
 * @param {HTMLCanvasElement} canvas
 * @param {MouseEvent} event
 * @returns {At}
 */
export function placeOn(canvas, { clientX, clientY }) {
  const { left, top } = canvas.getBoundingClientRect();
  return [clientX - left, clientY - top];
}

/** @param {WheelEvent} event */
export const wheelFactor = ({ deltaY }) => Math.exp(-deltaY * 0.0015);

export class Controls {
  /**
   * @param {HTMLCanvasElement} canvas
   * @param {() => Handlers} now what the page does now, which may be in another mode later
   */
  constructor(canvas, now) {
    this.canvas = canvas;
    this.now = now;
    /** @type {Map<number, At>} Where each pressed pointer is. */
    this.pressed = new Map();
    /** @type {{ from: At, isBox: boolean, isTouch: boolean } | null} What may become a tap or a drag. */
    this.drag = null;
    /** Whether the map is moved, until all pointers are released. */
    this.moves = false;
    this.last = { time: -Infinity, at: /** @type {At} */ ([0, 0]) };
    canvas.addEventListener("pointerdown", (event) => this.down(event));
    canvas.addEventListener("pointermove", (event) => this.moved(event));
    canvas.addEventListener("pointerup", (event) => this.up(event));
    canvas.addEventListener("pointercancel", (event) => this.cancel(event));
    canvas.addEventListener("pointerleave", () => this.handlers.leave());
    canvas.addEventListener("contextmenu", (event) => this.handlers.command && event.preventDefault());
    canvas.addEventListener(
      "wheel",
      (event) => {
        event.preventDefault();
        this.handlers.zoom(wheelFactor(event), this.local(event));
      },
      { passive: false },
    );
  }

  get handlers() {
    return this.now();
  }

  /** @param {MouseEvent} event */
  local(event) {
    return placeOn(this.canvas, event);
  }

  /** @param {PointerEvent} event */
  down(event) {
    const at = this.local(event),
      isTouch = event.pointerType !== "mouse";
    if (event.button === 2) return this.handlers.command?.(at);
    this.canvas.setPointerCapture(event.pointerId);
    this.pressed.set(event.pointerId, at);
    this.moves ||= this.pressed.size > 1 || event.button === 1;
    if (this.moves) this.giveUp();
    else this.drag = { from: at, isBox: false, isTouch };
  }

  /** @param {PointerEvent} event */
  moved(event) {
    const at = this.local(event),
      before = this.pressed.get(event.pointerId);
    if (!before) return this.handlers.hover(at);
    if (this.moves) moveMap(this.pressed, event.pointerId, at, this.handlers);
    this.pressed.set(event.pointerId, at);
    const { drag } = this;
    if (!drag) return;
    drag.isBox ||= distance(drag.from, at) >= LEAST_DRAG[drag.isTouch ? "touch" : "mouse"];
    if (drag.isBox) this.handlers.draw(boxOf(drag.from, at));
  }

  /** @param {PointerEvent} event */
  up(event) {
    const { drag } = this,
      at = this.local(event);
    this.release(event.pointerId);
    if (!drag) return;
    this.drag = null;
    if (drag.isBox) return this.handlers.box(boxOf(drag.from, at), event.shiftKey);
    const isDouble =
      event.timeStamp - this.last.time < DOUBLE_WITHIN && distance(at, this.last.at) < DOUBLE_NEAR;
    // A third tap is not double again.
    this.last = { time: isDouble ? -Infinity : event.timeStamp, at };
    this.handlers.tap(at, { add: event.shiftKey, isDouble, isTouch: drag.isTouch });
  }

  /** @param {PointerEvent} event */
  cancel(event) {
    this.release(event.pointerId);
    this.giveUp();
  }

  /** @param {number} pointer */
  release(pointer) {
    this.pressed.delete(pointer);
    if (!this.pressed.size) this.moves = false;
  }

  /** Ends a drag that the page is to forget. */
  giveUp() {
    if (this.drag?.isBox) this.handlers.box(null, false);
    this.drag = null;
  }
}

/**
 * Moves the map with a pointer that goes on to `at`; with two it is zoomed too.
 * @param {Map<number, At>} pressed where each pressed pointer is, this one before it moved
 * @param {number} pointer
 * @param {At} at
 * @param {Pick<Handlers, "move" | "zoom">} map
 */
export function moveMap(pressed, pointer, at, { move, zoom }) {
  const before = pressed.get(pointer) ?? at,
    other = [...pressed].find(([id]) => id !== pointer)?.[1],
    share = other ? 0.5 : 1;
  move((at[0] - before[0]) * share, (at[1] - before[1]) * share);
  if (!other) return;
  const middle = /** @type {At} */ ([(at[0] + other[0]) / 2, (at[1] + other[1]) / 2]);
  zoom(distance(at, other) / Math.max(1, distance(before, other)), middle);
}

/**
 * @param {At} from
 * @param {At} to
 * @returns {Rectangle}
 */
const boxOf = ([x0, y0], [x1, y1]) => ({ x0, y0, x1, y1 });
