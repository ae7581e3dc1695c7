// @ts-check
// Formats: the keys of scenario and unit files (order, defaults, ranges, keywords, meanings), as the program
// declares them.

/** @import { Builtins, JsonSchema, KeyFormat } from "../protocol.d.ts" */

export class FileKeys {
  /** @param {KeyFormat[]} keys */
  constructor(keys) {
    /** The names, in the order in which files have them. */
    this.order = keys.map(({ name }) => name);
    this.schemas = new Map(keys.map(({ name, schema }) => [name, schema]));
  }

  /**
   * @param {string} key
   * @returns {JsonSchema}
   */
  schema(key) {
    return this.schemas.get(key) ?? {};
  }

  /**
   * The keywords that a value is one of, or a list of.
   * @param {string} key
   */
  keywords(key) {
    const schema = this.schema(key);
    return schema.enum ?? schema.items?.enum ?? [];
  }

  /**
   * What a field of a key shows: its range, default and meaning.
   * @param {string} key
   */
  field(key) {
    const { minimum, exclusiveMinimum, default: missing, description = "" } = this.schema(key);
    const placeholder = missing === undefined ? "" : String(missing);
    return { min: minimum ?? exclusiveMinimum, placeholder, hint: `${key}: ${description}` };
  }
}

export class Formats {
  /** @param {Builtins} builtins */
  constructor(builtins) {
    this.scenario = new FileKeys(builtins.scenario_format.keys);
    this.unit = new FileKeys(builtins.unit_format.keys);
    /** By keyword: the keys of its parameters. */
    this.targeters = new Map(
      builtins.targeters.map(({ name, parameters }) => [name, new FileKeys(parameters)]),
    );
  }

  /** The factions; the first one is that of the agents. */
  get factions() {
    return this.scenario.schema("groups").items?.properties?.faction?.enum ?? [];
  }

  /** The side of a map that has none in its file, and the longest one. */
  get side() {
    const { default: missing, maximum } = this.scenario.schema("width");
    return { missing: Number(missing), longest: maximum ?? Infinity };
  }
}
