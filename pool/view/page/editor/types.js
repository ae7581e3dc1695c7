// TypesPanel: the unit types. Standard ones are shown; those of unit files have a form for every key.

const PLANES = ["GROUND", "AIR", "COLOSSUS"];
const ATTRIBUTES = [
  "LIGHT",
  "ARMORED",
  "MASSIVE",
  "BIOLOGICAL",
  "MECHANICAL",
  "PSIONIC",
  "STRUCTURE",
  "HEROIC",
];
/** The parameters of each targeter, with what a new one begins with. */
const TARGETERS = {
  STANDARD: {},
  KAMIKAZE: { radius: 2.2 },
  LASER_BEAM: { width: 2.8, height: 0.3 },
  HEAL: {},
};

/** Numbers of a unit file: key, label, step, default (undefined: required), explanation. */
const BODY = [
  ["hp", "Health", 5, undefined, "Points, above 0"],
  ["shield", "Shield", 5, 0, "Points"],
  ["hp_regen", "Regeneration", 0.1, 0, "Health points per second"],
  ["armor", "Armor", 1, undefined, "Points that each hit loses"],
  ["energy", "Energy", 10, 0, "The most energy, in points; healers spend it"],
  ["initial_energy", "Energy at start", 10, 0, "Points, at most `energy`"],
  ["size", "Size", 0.125, undefined, "Diameter in squares, above 0"],
  ["speed", "Speed", 0.1, undefined, "Squares per second"],
];
const ATTACK = [
  ["damage", "Damage", 1, undefined, "Points per hit"],
  ["attacks", "Hits per attack", 1, 1, "A whole number from 1"],
  ["cooldown", "Cooldown", 0.1, undefined, "Seconds between attacks"],
  ["minimum_scan_range", "Scan range", 0.5, 5, "Squares within which it looks for targets by itself"],
];

class TypesPanel extends Panel {
  constructor(element, page) {
    super(element);
    this.page = page;
    /** The name of the type that is shown. */
    this.name = null;
  }

  /** The shown type: index of its file, or -1 for a standard one. */
  get index() {
    return this.page.doc.units.findIndex((unit) => unit.name === this.name);
  }

  get file() {
    const { doc } = this.page;
    if (this.index >= 0) return doc.units[this.index].file;
    const text = doc.standard.units.find((unit) => unit.name === this.name)?.text ?? "{}";
    if (this.standardText !== text) [this.standardText, this.standardFile] = [text, new JsonText(text)];
    return this.standardFile;
  }

  signature() {
    const { doc } = this.page;
    const names = [...doc.units, ...doc.standard.units].map((unit) => unit.name);
    if (!names.includes(this.name)) this.name = names[0];
    const { file } = this;
    const bonuses = file.value(["bonuses"]);
    const shape = [file.value(["targeter"]) ?? "STANDARD", bonuses instanceof Map ? [...bonuses.keys()] : []];
    return JSON.stringify([names, this.name, this.index, shape, file.isObject]);
  }

  show(name) {
    this.name = name;
    this.refresh();
  }

  build() {
    const { doc } = this.page;
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
    const standard = doc.standard.units
      .filter(({ name }) => !doc.units.some((unit) => unit.name === name))
      .map(({ name }) => chip(name, false));
    const create = button([icon("add"), "New type"], "Add a unit type", () =>
      this.page.addType(doc.freeName("unit"), doc.standard.units.find(({ name }) => name === "MARINE").text),
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

  /** A field of one key of the unit file. */
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
      ...options,
    });
  }

  with(file, path, value) {
    return value === undefined ? file.remove(path) : file.set(path, value);
  }

  numbers(rows) {
    const fields = rows.map(([key, label, step, placeholder, hint]) => {
      // Files may write `initial_energy` as `starting_energy`.
      const alias = key === "initial_energy" && this.file.node(["starting_energy"]) ? "starting_energy" : key;
      return this.key("number", label, [alias], { step, min: 0, placeholder: placeholder ?? "", hint });
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
    const planes = PLANES.map((plane) => [plane, titleCase(plane)]);
    return [
      make("section", { className: index < 0 ? "readonly" : "" }, [
        head,
        ...own,
        this.numbers(BODY),
        this.key("select", "Plane", ["plane"], {
          options: planes,
          read: () => this.file.value(["plane"]) ?? "GROUND",
          hint: "Units avoid only units of their plane; every unit can attack COLOSSUS",
        }),
        this.key("flags", "Attributes", ["attributes"], { options: ATTRIBUTES }),
      ]),
      make("section", { className: index < 0 ? "readonly" : "" }, [
        make("h3", {}, "Attack"),
        this.numbers(ATTACK),
        this.rangeRow(),
        this.key("flags", "Can attack", ["valid_targets"], { options: PLANES, hint: "valid_targets" }),
        ...this.targeterFields(),
        this.bonusFields(),
      ]),
      ...(index < 0 ? [] : [this.removeRow(doc, index)]),
    ];
  }

  nameRow() {
    const { doc } = this.page,
      { index } = this;
    const input = make("input", { type: "text", value: this.name, spellcheck: false, autocomplete: "off" });
    input.addEventListener("change", () => {
      const name = input.value.trim();
      const isFree = doc.freeName(name) === name;
      if (!/^[\w.-]{1,60}$/.test(name) || !isFree) {
        const why = isFree ? "use letters, digits, _, - and ." : "another type has this name";
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

  removeRow(doc, index) {
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
      hint: "Squares between the edges of two units, or MELEE, which is 0.1",
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
    const kind = this.file.value(["targeter"]) ?? "STANDARD";
    const targeter = this.key("select", "Hits", ["targeter"], {
      options: [
        ["STANDARD", "Its target"],
        ["KAMIKAZE", "All around it, and dies"],
        ["LASER_BEAM", "All in a beam"],
        ["HEAL", "Heals its target"],
      ],
      read: () => this.file.value(["targeter"]) ?? "STANDARD",
      write: (value) => doc.setUnit(index, (file) => this.withTargeter(file, value)),
      hint: "targeter; a healer also has combat_type HEALING",
    });
    const parameters = Object.keys(TARGETERS[kind] ?? {}).map((key) =>
      this.key("number", titleCase(key), ["targeter_kwargs", key], {
        step: 0.1,
        min: 0,
        write: (value, merge) =>
          doc.setUnit(
            index,
            (file) => {
              if (value !== undefined && !file.node(["targeter_kwargs"]))
                return file.set(["targeter_kwargs"], { [key]: value });
              return this.with(file, ["targeter_kwargs", key], value);
            },
            merge,
          ),
      }),
    );
    const combat = this.key("select", "Combat type", ["combat_type"], {
      options: [
        ["DAMAGE", "Damage"],
        ["HEALING", "Healing"],
      ],
      read: () => this.file.value(["combat_type"]) ?? "DAMAGE",
    });
    return [
      make("div", { className: "columns" }, [targeter, combat]),
      ...(parameters.length ? [make("div", { className: "columns" }, parameters)] : []),
    ];
  }

  /** Sets a targeter, and what must agree with it. */
  withTargeter(file, kind) {
    const kwargs = TARGETERS[kind];
    let next = kind === "STANDARD" ? file.remove(["targeter"]) : file.set(["targeter"], kind);
    next = Object.keys(kwargs).length
      ? next.set(["targeter_kwargs"], kwargs)
      : next.remove(["targeter_kwargs"]);
    return kind === "HEAL" ? next.set(["combat_type"], "HEALING") : next.remove(["combat_type"]);
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
      ...ATTRIBUTES.filter((name) => !names.includes(name)).map((name) =>
        make("option", { value: name }, titleCase(name)),
      ),
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
