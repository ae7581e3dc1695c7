// @ts-check
// The tools of the editor: those of the brush, and what else a click or drag on the map does.

/** The keys that choose tools, and what the page says about them. */
/** @type {{ [key: string]: string | undefined }} */
export const TOOL_KEYS = {
  v: "select",
  b: "brush",
  e: "erase",
  r: "rectangle",
  l: "line",
  f: "fill",
  a: "goal",
  g: "ally",
  h: "enemy",
};
/** @type {{ [tool: string]: string }} */
export const TOOL_HINTS = {
  select: "Click a group to edit it, drag it to move it; drag the map to move the view",
  brush: "Drag to draw; the right button draws the opposite",
  erase: "Drag to make squares walkable",
  rectangle: "Drag from corner to corner",
  line: "Drag from end to end",
  fill: "Click an area to fill it",
  goal: "Click or drag to where the enemies march",
  ally: "Click where the new group starts",
  enemy: "Click where the new group starts",
};
