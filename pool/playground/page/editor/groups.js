// @ts-check
// GroupsPanel: the groups of the scenario and the form of the selected one. ScenarioPanel: everything else in
// the scenario file.

import { titleCase } from "#view/battle.js";
import { make } from "#view/dom.js";
import { isNumber, stemOf } from "./document.js";
import { Panel, button, fieldKey, icon, iconButton } from "./fields.js";
import { SNAP } from "./map.js";

/** @import { Child } from "#view/dom.js" */
/** @import { ReadGroup, ScenarioDocument } from "./document.js" */
/** @import { EditorPage } from "./editor.js" */
/** @import { FieldKind, FieldOptions } from "./fields.js" */
/** @import { Merge } from "./history.js" */
/** @import { Path } from "./json.js" */
/** @import { EditedMap } from "#view/squares.js" */

/** @type {{ [faction: string]: string }} */
const FACTION_NAMES = { ALLY: "Allies", ENEMY: "Enemies" };

/** @param {unknown} value */
const shown = (value) => (isNumber(value) ? String(Math.round(value * 1000) / 1000) : "?");

/**
 * A unit type as the editor calls it: "Stalker", or the name of its file.
 * @param {string} key
 * @param {ScenarioDocument} doc
 */
export const typeTitle = (key, doc) => (doc.standard(key) ? titleCase(key) : stemOf(key));

/**
 * The units of a group as text, such as "2 Stalker, 3 Zealot".
 * @param {ReadGroup} group
 * @param {ScenarioDocument} doc
 */
function armyText({ units }, doc) {
  return units.map(([key, count]) => `${isNumber(count) ? count : "?"} ${typeTitle(key, doc)}`).join(", ");
}

export class GroupsPanel extends Panel {
  /**
   * @param {HTMLElement} element
   * @param {EditorPage} page
   */
  constructor(element, page) {
    super(element);
    this.page = page;
  }

  signature() {
    const { doc, group } = this.page;
    const shape = doc.groups().map(({ faction, units }) => [faction, units.map(([key]) => key)]);
    return JSON.stringify([group, shape, this.typeNames()]);
  }

  /** Every unit type that can be chosen. */
  typeNames() {
    const { doc } = this.page;
    const standard = doc.builtins.units.map((unit) => unit.name);
    return [...new Set([...doc.units.map((unit) => unit.name), ...standard])];
  }

  build() {
    const { doc, group } = this.page;
    /** @param {string} faction */
    const add = (faction) =>
      button(
        [icon("add"), FACTION_NAMES[faction]],
        `Add a group of ${FACTION_NAMES[faction].toLowerCase()}`,
        () => this.page.addGroup(faction),
      );
    const bar = make("div", { className: "row" }, [add("ALLY"), add("ENEMY")]);
    const items = doc.groups().map((_, index) => {
      const head = this.head(index);
      return make("li", {}, index === group ? [head, this.form(index)] : [head]);
    });
    const hint = items.length ? "Drag groups on the map, or choose one here." : "There is no group yet.";
    return [bar, make("ol", { className: "groups" }, items), make("p", { className: "hint" }, hint)];
  }

  /** @param {number} index */
  head(index) {
    const isOpen = index === this.page.group;
    const title = make("b"),
      place = make("span"),
      count = make("i");
    const head = button([count, title, place], "Show this group", () =>
      this.page.selectGroup(isOpen ? -1 : index),
    );
    head.dataset.key = fieldKey(-1, ["groups", index]);
    head.setAttribute("aria-expanded", String(isOpen));
    this.fields.push({
      refresh: () => {
        const group = this.page.doc.groups()[index];
        head.className = `group ${group.faction === "ENEMY" ? "enemy" : "ally"}`;
        const total = group.units.reduce((sum, [, n]) => sum + (isNumber(n) ? n : 0), 0);
        count.textContent = String(total);
        title.textContent = armyText(group, this.page.doc) || "no units";
        place.textContent = `${shown(group.x)}, ${shown(group.y)}`;
      },
    });
    return head;
  }

  /** @param {number} index */
  form(index) {
    const { doc } = this.page;
    /** @type {(label: string, key: string, hint: string) => HTMLElement} */
    const number = (label, key, hint) =>
      this.field("number", {
        label,
        path: ["groups", index, key],
        step: SNAP,
        hint,
        read: () => doc.shown.value(["groups", index, key]),
        write: (value, merge) => doc.setKey(["groups", index, key], value, merge),
      });
    const faction = this.field("select", {
      label: "Faction",
      path: ["groups", index, "faction"],
      options: doc.formats.factions.map((name) => [name, FACTION_NAMES[name]]),
      read: () => doc.groups()[index].faction,
      write: (value) => doc.editGroups((file) => file.set(["groups", index, "faction"], value)),
    });
    const { units } = doc.groups()[index];
    const rows = units.map(([key], at) => this.unitRow(index, key, at, units.length));
    const free = this.typeNames().filter((name) => !units.some(([key]) => key === name));
    const more = make("select", { "aria-label": "Add units", className: "more" }, [
      make("option", { value: "" }, "Add units\u2026"),
      ...free.map((name) => make("option", { value: name }, typeTitle(name, doc))),
    ]);
    more.dataset.key = fieldKey(-1, ["groups", index, "more"]);
    more.addEventListener("change", () => more.value && doc.setCount(index, more.value, 1));
    const actions = make("div", { className: "row" }, [
      button([icon("copy"), "Duplicate"], "Duplicate this group (Ctrl+D)", () => this.page.duplicateGroup()),
      button([icon("remove"), "Delete"], "Delete this group (Del)", () => this.page.deleteGroup()),
    ]);
    const place = make("div", { className: "columns three" }, [
      number("x", "x", "The group's centre, in squares from the west edge"),
      number("y", "y", "The group's centre, in squares from the south edge"),
      faction,
    ]);
    const list = make(
      "div",
      { className: "units", "data-key": fieldKey(-1, ["groups", index, "units"]) },
      rows,
    );
    return make("div", { className: "form" }, [place, list, more, actions]);
  }

  /**
   * @param {number} index
   * @param {string} key
   * @param {number} at
   * @param {number} length
   */
  unitRow(index, key, at, length) {
    const { doc } = this.page;
    /** @type {Path} */
    const path = ["groups", index, "units"];
    /** @type {[string, string][]} */
    const names = this.typeNames().map((name) => [name, typeTitle(name, doc)]);
    const type = this.field("select", {
      label: "Type",
      path: [...path, key, "type"],
      options: names.some(([name]) => name === key) ? names : [[key, typeTitle(key, doc)], ...names],
      read: () => key,
      write: (value) => {
        doc.setType(index, key, value);
        this.page.refresh(); // shows the old type, if the group already has the new one
      },
    });
    const count = this.field("number", {
      label: "Number",
      path: [...path, key],
      step: 1,
      min: 1,
      read: () => doc.shown.value([...path, key]),
      write: (value, merge) => value !== undefined && doc.setCount(index, key, value, merge),
    });
    const name = typeTitle(key, doc);
    /** @type {(by: number) => () => void} */
    const move = (by) => () => doc.editGroups((file) => file.exchange(path, by < 0 ? at - 1 : at));
    const up = iconButton("up", `${name} earlier: the first types start in the first rows`, move(-1));
    const down = iconButton("down", `${name} later`, move(1));
    up.disabled = at === 0;
    down.disabled = at === length - 1;
    const remove = iconButton("remove", `Remove ${name}`, () => doc.setCount(index, key, undefined));
    return make("div", { className: "unit-row" }, [type, count, up, down, remove]);
  }
}

/**
 * @param {string} title
 * @param {Child[]} children
 */
const section = (title, ...children) => make("section", {}, [make("h3", {}, title), ...children]);
/** @param {Child[]} children */
const columns = (...children) => make("div", { className: "columns" }, children);

export class ScenarioPanel extends Panel {
  /**
   * @param {HTMLElement} element
   * @param {EditorPage} page
   */
  constructor(element, page) {
    super(element);
    this.page = page;
    /** @type {EditedMap | null} The map before a side was typed. */
    this.before = null;
  }

  signature() {
    return JSON.stringify(this.typeIds().map(([key]) => key));
  }

  typeIds() {
    const ids = this.page.doc.shown.value(["unit_type_ids"]);
    return ids instanceof Map ? [...ids] : [];
  }

  /**
   * A field of one key of the scenario file.
   * @param {FieldKind} kind
   * @param {string} label
   * @param {Path} path
   * @param {Partial<FieldOptions>} [options]
   */
  key(kind, label, path, options = {}) {
    const { doc } = this.page;
    return this.field(kind, {
      label,
      path,
      read: () => doc.shown.value(path),
      write: (value, merge) => doc.setKey(path, value, kind === "check" ? null : merge),
      ...doc.formats.scenario.field(String(path[0])),
      ...options,
    });
  }

  build() {
    return [
      section(
        "Scenario",
        this.key("text", "Name", ["name"], { wide: true }),
        columns(
          this.key("number", "Episode limit", ["episode_limit"], { step: 10, placeholder: "none" }),
          this.key("text", "Unit folder", ["custom_unit_path"], { placeholder: "beside it" }),
        ),
      ),
      section("Map", this.preset(), columns(this.side("Width", "width"), this.side("Height", "height"))),
      section(
        "Attack point",
        columns(...["x", "y"].map((axis, i) => this.point(axis, i))),
        make("p", { className: "hint" }, "Enemies move there and attack the units they meet."),
      ),
      section(
        "Observations",
        this.key("check", "Shields of allies", ["ally_has_shields"]),
        this.key("check", "Shields of enemies", ["enemy_has_shields"]),
        this.typeSection(),
      ),
      section(
        "Numbers of units",
        columns(
          this.key("number", "Allies", ["num_allied_units"], { step: 1 }),
          this.key("number", "Enemies", ["num_enemy_units"], { step: 1 }),
        ),
        make("p", { className: "hint" }, "They follow the groups when you edit those."),
      ),
    ];
  }

  preset() {
    const { doc } = this.page;
    /** @type {[string, string][]} */
    const presets = doc.builtins.presets.map(({ name }) => [name, titleCase(name)]);
    return this.key("select", "Terrain", ["terrain_preset"], {
      options: [["", "Custom map"], ...presets],
      read: () => doc.map().preset ?? doc.shown.value(["terrain_preset"]) ?? "",
      write: (value) => doc.setPreset(value),
    });
  }

  /**
   * Width or height; squares that stay keep their place from the south-west.
   * @param {string} label
   * @param {"width" | "height"} key
   */
  side(label, key) {
    /** @type {FieldOptions["write"]} */
    const write = (value, merge) => this.resize(key, value, merge);
    return this.key("number", label, [key], { write, step: 1 });
  }

  /**
   * @param {string} axis
   * @param {number} i
   */
  point(axis, i) {
    const { doc } = this.page;
    return this.field("number", {
      label: axis,
      path: ["attack_point", i],
      step: SNAP,
      read: () => doc.shown.value(["attack_point", i]),
      write: (value, merge) => {
        const point = doc.shown.value(["attack_point"]);
        const next = Array.isArray(point) ? [...point] : [0, 0];
        next[i] = value ?? 0;
        doc.setKey(["attack_point"], next, merge);
      },
    });
  }

  typeSection() {
    const { doc } = this.page;
    const count = this.key("number", "Length of the one-hot of unit types", ["num_unit_types"], {
      step: 1,
      wide: true,
    });
    const ids = this.typeIds().map(([key]) =>
      this.key("number", typeTitle(key, doc), ["unit_type_ids", key], {
        step: 1,
        min: 0,
        hint: `Id of ${key}`,
      }),
    );
    const all = button("Ids from the groups", "Number the types of all groups", () =>
      doc.edit((file) => {
        const types = new Set(doc.groups().flatMap((group) => group.units.map(([key]) => key)));
        return doc.withTypeIds(file.remove(["unit_type_ids"]), types);
      }),
    );
    const none = button("None", "Observations do not tell types apart", () =>
      doc.edit((file) => file.remove(["unit_type_ids"]).set(["num_unit_types"], 0)),
    );
    return make("div", { "data-key": fieldKey(-1, ["unit_type_ids"]), tabIndex: -1 }, [
      count,
      make("div", { className: "columns" }, ids),
      make("div", { className: "row" }, [all, none]),
    ]);
  }

  /**
   * @param {"width" | "height"} key
   * @param {any} value
   * @param {Merge} [merge]
   */
  resize(key, value, merge) {
    const { doc } = this.page,
      map = doc.map();
    // Typing "64" passes "6", or an empty field: the squares beyond come back from the map before the typing.
    if (doc.merge !== merge) this.before = map;
    const isSide = Number.isInteger(value) && value >= 1 && value <= doc.formats.side.longest;
    if (!isSide) return doc.setKey([key], value, merge);
    if (map[key] === value) return doc.setKey([key], value, merge);
    const from = this.before ?? map;
    const [width, height] = key === "width" ? [value, map.height] : [map.width, value];
    const blocked = new Uint8Array(width * height);
    for (let y = 0; y < Math.min(height, from.height); y++)
      for (let x = 0; x < Math.min(width, from.width); x++)
        blocked[y * width + x] = from.blocked[y * from.width + x];
    doc.setMap({ width, height, blocked }, merge);
  }
}
