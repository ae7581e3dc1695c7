// @ts-check
// Mover: at the start of a battle, a drag that begins on a unit moves it, and the battle begins anew.

/** @import { Handlers } from "#view/controls.js" */
/** @import { Playground } from "./playground.js" */

export class Mover {
  /** @param {Playground} page */
  constructor(page) {
    this.page = page;
  }

  /**
   * Drags move units where there are some, and do what they do otherwise everywhere else.
   * @param {Handlers} otherwise
   * @returns {Pick<Handlers, "draw" | "box">}
   */
  handlers(otherwise) {
    const { page } = this,
      { arena } = page;
    return {
      draw: (box) => {
        const unit = page.isAtStart ? arena.unitAt(box.x0, box.y0) : -1;
        arena.dragged = unit >= 0 ? { unit, at: { x: box.x1, y: box.y1 } } : null;
        if (unit < 0) otherwise.draw(box);
        else page.drawBox(null);
      },
      box: (box, add) => {
        const { dragged } = arena;
        arena.dragged = null;
        if (!box || !dragged) return otherwise.box(box, add);
        const { x, y } = arena.placeAt(box.x1, box.y1);
        const { unit } = dragged;
        page.enqueue(() =>
          page.change(async () => (await page.engine.request({ type: "move_unit", unit, x, y })).scenario),
        );
      },
    };
  }
}
