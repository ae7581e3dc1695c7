// @ts-check
// TypesPanel: the unit types. Standard ones are shown; those of unit files have a form for every key.

import { titleCase } from "#view/battle.js";
import { make } from "#view/dom.js";
import { NAME_RULE, UNIT_NAME } from "./document.js";
import { Panel, button, fieldKey, icon } from "./fields.js";
import { typeTitle } from "./groups.js";

/** @import { EditorPage } from "./editor.js" */
/** @import { FieldKind, FieldOptions } from "./fields.js" */
/** @import { FileKeys } from "./formats.js" */
/** @import { JsonText, Path } from "./json.js" */
/** @typedef {[key: string, label: string, step: number][]} NumberRows */

/**
 * What the targeters hit, in the words of the form.
 * @type {{ [targeter: string]: string | undefined }}
 */
const TARGETS = {
  STANDARD: "Its target",
  KAMIKAZE: "All around it, and dies",
  LASER_BEAM: "All in a beam",
  HEAL: "Heals its target",
};

/**
 * Numbers of a unit file.
 * @type {NumberRows}
 */
const BODY = [
  ["hp", "Health", 5],
  ["shield", "Shield", 5],
  ["hp_regen", "Regeneration", 0.1],
  ["armor", "Armor", 1],
  ["energy", "Energy", 10],
  ["initial_energy", "Energy at start", 10],
  ["size", "Size", 0.125],
  ["speed", "Speed", 0.1],
];
/** @type {NumberRows} */
const ATTACK = [
  ["damage", "Damage", 1],
  ["attacks", "Hits per attack", 1],
  ["cooldown", "Cooldown", 0.1],
  ["minimum_scan_range", "Scan range", 0.5],
];

/**
 * @param {string[]} names
 * @returns {[string, string][]}
 */
const titled = (names) => names.map((name) => [name, titleCase(name)]);

export class TypesPanel extends Panel {
  /**
   * @param {HTMLElement} element
   * @param {EditorPage} page
   */
  constructor(element, page) {
    super(element);
    this.page = page;
    /** The standard type that was shown last, as a file. */
    this.standardFile = page.doc.unitText("{}");
    /** The name of the type that is shown; empty before the first. */
    this.name = "";
  }

  /** The shown type: index of its file, or -1 for a standard one. */
  get index() {
    return this.page.doc.units.findIndex((unit) => unit.name === this.name);
  }

  get file() {
    const { doc } = this.page;
    if (this.index >= 0) return doc.units[this.index].file;
    const text = doc.builtins.units.find((unit) => unit.name === this.name)?.text ?? "{}";
    if (this.standardFile.text !== text) this.standardFile = doc.unitText(text);
    return this.standardFile;
  }

  signature() {
    const { doc } = this.page;
    const names = [...doc.units, ...doc.builtins.units].map((unit) => unit.name);
    if (!names.includes(this.name)) this.name = names[0];
    const { file } = this;
    const bonuses = file.value(["bonuses"]);
    const shape = [this.keyword("targeter"), bonuses instanceof Map ? [...bonuses.keys()] : []];
    return JSON.stringify([names, this.name, this.index, shape, file.isObject]);
  }

  /** @param {string} name */
  show(name) {
    this.name = name;
    this.refresh();
  }

  build() {
    const { doc } = this.page;
    /** @type {(name: string, isOwn: boolean) => HTMLElement} */
    const chip = (name, isOwn) =>
      button(
        typeTitle(name, doc),
        isOwn ? `${name}.json` : "Standard type, read-only",
        () => this.show(name),
        {
          className: isOwn ? "type own" : "type",
          "aria-pressed": String(name === this.name),
          "data-key": fieldKey(name, []),
        },
      );
    const own = doc.units.map((unit) => chip(unit.name, true));
    const standard = doc.builtins.units
      .filter(({ name }) => !doc.units.some((unit) => unit.name === name))
      .map(({ name }) => chip(name, false));
    const create = button([icon("add"), "New type"], "Add a unit type", () =>
      this.page.addType(doc.freeName("unit"), doc.standard("MARINE")?.text ?? "{}"),
    );
    const copy = button([icon("copy"), "Copy as new"], "Add a unit type that begins as this one", () =>
      this.page.addType(
        doc.freeName(`my_${this.name.toLowerCase()}`.replace(/^(my_)+/, "my_")),
        this.file.text,
      ),
    );
    return [
      make("div", { className: "row" }, [create, copy]),
      make("h3", {}, "Unit files"),
      own.length
        ? make("div", { className: "types" }, own)
        : make("p", { className: "hint" }, "None yet: add one, or copy a standard type."),
      make("h3", {}, "Standard types"),
      make("div", { className: "types" }, standard),
      ...(this.file.isObject
        ? this.form()
        : [make("p", { className: "hint" }, "The JSON text has an error.")]),
    ];
  }

  get keys() {
    return this.page.doc.formats.unit;
  }

  /**
   * A keyword of the file, or what it is if the file has none.
   * @param {string} key
   */
  keyword(key) {
    return this.file.value([key]) ?? this.keys.schema(key).default;
  }

  /**
   * A field of one key of the unit file.
   * @param {FieldKind} kind
   * @param {string} label
   * @param {Path} path
   * @param {Partial<FieldOptions>} [options]
   */
  key(kind, label, path, options = {}) {
    const { index } = this,
      { doc } = this.page;
    return this.field(kind, {
      label,
      unit: this.name,
      path,
      readonly: index < 0,
      read: () => this.file.value(path),
      write: (value, merge) => doc.setUnit(index, (file) => this.with(file, path, value), merge),
      ...this.keys.field(String(path[0])),
      ...options,
    });
  }

  /**
   * @param {JsonText} file
   * @param {Path} path
   * @param {unknown} value
   */
  with(file, path, value) {
    return value === undefined ? file.remove(path) : file.set(path, value);
  }

  /** @param {NumberRows} rows */
  numbers(rows) {
    const fields = rows.map(([key, label, step]) => {
      // Files may write `initial_energy` as `starting_energy`.
      const alias = key === "initial_energy" && this.file.node(["starting_energy"]) ? "starting_energy" : key;
      return this.key("number", label, [alias], { step, ...this.keys.field(key) });
    });
    return make("div", { className: "columns" }, fields);
  }

  form() {
    const { doc } = this.page,
      { index, name } = this;
    const title = typeTitle(name, doc);
    const head = make("h3", { className: "title" }, [
      title,
      make("small", {}, index < 0 ? "standard, read-only" : `${name}.json`),
    ]);
    const own = index < 0 ? [] : [this.nameRow()];
    return [
      make("section", { className: index < 0 ? "readonly" : "" }, [
        head,
        ...own,
        this.numbers(BODY),
        this.key("select", "Plane", ["plane"], {
          options: titled(this.keys.keywords("plane")),
          read: () => this.keyword("plane"),
        }),
        this.key("flags", "Attributes", ["attributes"], { keywords: this.keys.keywords("attributes") }),
      ]),
      make("section", { className: index < 0 ? "readonly" : "" }, [
        make("h3", {}, "Attack"),
        this.numbers(ATTACK),
        this.rangeRow(),
        this.key("flags", "Can attack", ["valid_targets"], { keywords: this.keys.keywords("valid_targets") }),
        ...this.targeterFields(),
        this.bonusFields(),
      ]),
      ...(index < 0 ? [] : [this.removeRow()]),
    ];
  }

  nameRow() {
    const { doc } = this.page,
      { index } = this;
    const input = make("input", {
      type: "text",
      value: this.name,
      spellcheck: false,
      autocomplete: "off",
      "data-key": "name", // the focus stays on it when it has another name
    });
    input.disabled = doc.isStale; // the scenario, which names the type too, cannot be edited
    input.addEventListener("change", () => {
      const name = input.value.trim();
      const isFree = doc.freeName(name) === name;
      if (!UNIT_NAME.test(name) || !isFree) {
        const why = isFree ? NAME_RULE : "another type has this name";
        input.setCustomValidity(`The name is part of a file name: ${why}`);
        input.reportValidity();
        return;
      }
      this.name = name;
      doc.renameUnit(index, name);
    });
    input.addEventListener("input", () => input.setCustomValidity(""));
    return make("label", { className: "field wide" }, [make("span", {}, "Name"), input]);
  }

  removeRow() {
    const { doc } = this.page,
      { index } = this;
    return make("div", { className: "row" }, [
      button([icon("remove"), "Remove this type"], "Remove the unit file from the scenario", () =>
        doc.removeUnit(index),
      ),
    ]);
  }

  rangeRow() {
    const isMelee = () => this.file.value(["attack_range"]) === "MELEE";
    const range = this.key("number", "Range", ["attack_range"], {
      step: 0.5,
      min: 0,
    });
    const melee = this.key("check", "Melee", ["attack_range", "melee"], {
      read: isMelee,
      write: (value) =>
        this.page.doc.setUnit(this.index, (file) => file.set(["attack_range"], value ? "MELEE" : 5)),
    });
    return make("div", { className: "columns" }, [range, melee]);
  }

  targeterFields() {
    const { doc } = this.page,
      { index } = this;
    const targeter = this.key("select", "Hits", ["targeter"], {
      options: this.keys.keywords("targeter").map((name) => [name, TARGETS[name] ?? titleCase(name)]),
      read: () => this.keyword("targeter"),
      write: (value) => doc.setUnit(index, (file) => this.withTargeter(file, value)),
    });
    const combat = this.key("select", "Combat type", ["combat_type"], {
      options: titled(this.keys.keywords("combat_type")),
      read: () => this.keyword("combat_type"),
    });
    const parameters = this.parameters(this.keyword("targeter"));
    return [
      make("div", { className: "columns" }, [targeter, combat]),
      ...(parameters.length ? [make("div", { className: "columns" }, parameters)] : []),
    ];
  }

  /**
   * Fields of the parameters of a targeter.
   * @param {string} targeter
   */
  parameters(targeter) {
    const { doc } = this.page,
      keys = doc.formats.targeters.get(targeter);
    if (!keys) return [];
    /** @type {(key: string) => FieldOptions["write"]} */
    const write = (key) => (value, merge) =>
      doc.setUnit(this.index, (file) => this.withParameter(file, key, value), merge);
    return keys.order.map((key) =>
      this.key("number", titleCase(key), ["targeter_kwargs", key], {
        ...keys.field(key),
        step: 0.1,
        write: write(key),
      }),
    );
  }

  /**
   * @param {JsonText} file
   * @param {string} key
   * @param {unknown} value
   */
  withParameter(file, key, value) {
    if (value !== undefined && !file.node(["targeter_kwargs"]))
      return file.set(["targeter_kwargs"], { [key]: value });
    return this.with(file, ["targeter_kwargs", key], value);
  }

  /**
   * Sets a targeter, and what must agree with it.
   * @param {JsonText} file
   * @param {string} kind
   */
  withTargeter(file, kind) {
    const isDefault = kind === this.keys.schema("targeter").default;
    let next = isDefault ? file.remove(["targeter"]) : file.set(["targeter"], kind);
    const kwargs = this.usualParameters(kind);
    next = kwargs ? next.set(["targeter_kwargs"], kwargs) : next.remove(["targeter_kwargs"]);
    return kind === "HEAL" ? next.set(["combat_type"], "HEALING") : next.remove(["combat_type"]);
  }

  /**
   * The parameters of a targeter as the first standard type has them that has it.
   * @param {string} kind
   */
  usualParameters(kind) {
    const { doc } = this.page;
    if (!doc.formats.targeters.get(kind)?.order.length) return null;
    const files = doc.builtins.units.map(({ text }) => doc.unitText(text));
    const kwargs = files.find((file) => file.value(["targeter"]) === kind)?.value(["targeter_kwargs"]);
    return Object.fromEntries(kwargs ?? []);
  }

  bonusFields() {
    const { doc } = this.page,
      { index, file } = this;
    const bonuses = file.value(["bonuses"]);
    const names = bonuses instanceof Map ? [...bonuses.keys()] : [];
    const fields = names.map((name) =>
      this.key("number", `Bonus: ${titleCase(name)}`, ["bonuses", name], { step: 1, min: 0 }),
    );
    const more = make("select", { "aria-label": "Add a bonus", className: "more", disabled: index < 0 }, [
      make("option", { value: "" }, "Add a bonus against\u2026"),
      ...(this.keys.schema("bonuses").propertyNames?.enum ?? [])
        .filter((name) => !names.includes(name))
        .map((name) => make("option", { value: name }, titleCase(name))),
    ]);
    more.addEventListener("change", () =>
      doc.setUnit(index, (old) =>
        old.node(["bonuses"])
          ? old.set(["bonuses", more.value], 1)
          : old.set(["bonuses"], { [more.value]: 1 }),
      ),
    );
    return make("div", { className: "columns", "data-key": fieldKey(this.name, ["bonuses"]), tabIndex: -1 }, [
      ...fields,
      ...(index < 0 ? [] : [more]),
    ]);
  }
}
