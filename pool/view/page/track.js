// @ts-check
// Track: the moments and decisions of an episode, decoded. It grows by `append`, so it serves recordings and
// live data.

/** @import { ScenarioInfo } from "./data.d.ts" */
/**
 * `flight` is the ticks until a shot arrives; 0 if it hits at once.
 * @typedef {{ by: number, on: number, kind: string, flight: number }} Attack
 */
/** @typedef {{ action: number, available: number[] }} Decision */

// The orders of `encode_moments` in pool/view/src/page/data.rs.
const ATTACK_KINDS = ["shot", "beam", "explosion", "heal"];
const COLUMNS = /** @type {const} */ ([
  "x",
  "y",
  "facing",
  "hp",
  "shield",
  "energy",
  "cooldown",
  "target",
  "alive",
]);

/**
 * The bytes of base64 text.
 * @param {string} text
 */
export const bytesOf = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));

/**
 * The bytes of base64 text that was compressed by deflate.
 * @param {string} text
 */
export async function inflate(text) {
  const stream = new Blob([bytesOf(text)]).stream().pipeThrough(new DecompressionStream("deflate-raw"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** Reads LEB128 numbers. */
class Numbers {
  /** @param {Uint8Array} bytes */
  constructor(bytes) {
    this.bytes = bytes;
    this.at = 0;
  }

  get done() {
    return this.at >= this.bytes.length;
  }

  unsigned() {
    let value = 0;
    for (let scale = 1; ; scale *= 128) {
      const byte = this.bytes[this.at++];
      value += (byte & 127) * scale;
      if (!(byte & 128)) return value;
    }
  }

  signed() {
    const value = this.unsigned();
    return value % 2 ? -(value + 1) / 2 : value / 2;
  }
}

/**
 * By faction: all health and shields at the start.
 * @param {ScenarioInfo} info
 */
function mostHealth(info) {
  const most = [0, 0];
  for (const unit of info.units)
    most[unit.faction] += info.types[unit.type].hp + info.types[unit.type].shield;
  return most;
}

export class Track {
  /** @param {ScenarioInfo} info */
  constructor(info) {
    this.info = info;
    /** The step of its battle with which it begins: not 0 where that was followed or branched midway. */
    this.firstStep = 0;
    /** Tells it from other tracks of the page. */
    this.serial = 0;
    this.units = info.units.length;
    /** Number of moments; moment t is t ticks after the start. */
    this.length = 0;
    this.capacity = 0;
    this.x = this.y = this.facing = new Float32Array(0);
    this.hp = this.shield = this.energy = this.cooldown = new Float32Array(0);
    this.target = this.alive = new Float32Array(0);
    /** By moment: the attacks of the tick that ends there.
     * @type {Attack[][]} */
    this.attacks = [];
    /** In ticks. */
    this.longestFlight = 0;
    /** Every death, in order.
     * @type {{ tick: number, unit: number }[]} */
    this.deaths = [];
    this.deathTick = new Float64Array(this.units).fill(Infinity);
    /** By faction and moment: the share of health and shields that is left.
     * @type {number[][]} */
    this.health = [[], []];
    /** By faction and moment: the number of living units.
     * @type {number[][]} */
    this.living = [[], []];
    /** By step and agent.
     * @type {Decision[][]} */
    this.decisions = [];
    this.mostHealth = mostHealth(info);
  }

  /**
   * Takes in the types of the units, which differ between the episodes of a generated scenario.
   * @param {number[]} types
   */
  takeTypes(types) {
    const { info } = this;
    if (types.every((type, unit) => info.units[unit].type === type)) return;
    this.info = { ...info, units: info.units.map((unit, i) => ({ ...unit, type: types[i] })) };
    this.mostHealth = mostHealth(this.info);
  }

  get last() {
    return Math.max(0, this.length - 1);
  }

  /**
   * Appends the moments of decompressed bytes.
   * @param {Uint8Array} bytes
   * @param {number} count
   */
  append(bytes, count) {
    if (!count) return;
    this.reserve(this.length + count);
    const per = this.info.units_per;
    const scale = {
      x: per.position,
      y: per.position,
      facing: per.turn / (2 * Math.PI),
      hp: per.points,
      shield: per.points,
      energy: per.points,
      cooldown: per.seconds,
      target: 1,
      alive: 1,
    };
    const numbers = new Numbers(bytes);
    this.takeTypes(Array.from({ length: this.units }, () => numbers.unsigned()));
    for (const name of COLUMNS) {
      const column = this[name],
        factor = 1 / scale[name],
        offset = name === "target" ? -1 : 0;
      for (let unit = 0; unit < this.units; unit++) {
        let value = 0;
        for (let i = 0; i < count; i++) {
          value += numbers.signed();
          column[(this.length + i) * this.units + unit] = value * factor + offset;
        }
      }
    }
    for (let i = 0; i < count; i++) {
      const attacks = [];
      for (let n = numbers.unsigned(); n > 0; n--) {
        const [by, on, kind] = [numbers.unsigned(), numbers.unsigned(), ATTACK_KINDS[numbers.unsigned()]];
        const flight = kind === "shot" ? numbers.unsigned() : 0;
        attacks.push({ by, on, kind, flight });
        this.longestFlight = Math.max(this.longestFlight, flight);
      }
      this.attacks.push(attacks);
      this.summarise(this.length + i);
    }
    this.length += count;
  }

  /**
   * Appends the decisions of decompressed bytes; the last one may be without actions.
   * @param {Uint8Array} bytes
   */
  appendDecisions(bytes) {
    const numbers = new Numbers(bytes);
    const words = Math.ceil(this.info.n_actions / 32);
    while (!numbers.done) {
      const step = [];
      for (let agent = 0; agent < this.info.n_agents; agent++) {
        const action = numbers.unsigned() - 1,
          available = [];
        for (let word = 0; word < words; word++) {
          const bits = numbers.unsigned();
          for (let bit = 0; bit < 32; bit++)
            if (Math.floor(bits / 2 ** bit) % 2) available.push(word * 32 + bit);
        }
        step.push({ action, available });
      }
      this.decisions.push(step);
    }
  }

  /**
   * Forgets the moments before the last ones, but not what was summed up of them.
   * @param {number} count
   */
  keepLast(count) {
    const kept = Math.min(count, this.length),
      end = this.length * this.units;
    for (const name of COLUMNS) this[name].copyWithin(0, end - kept * this.units, end);
    this.length = kept;
  }

  /** @param {number} length */
  reserve(length) {
    if (length <= this.capacity) return;
    this.capacity = Math.max(length, this.capacity * 2);
    for (const name of COLUMNS) {
      const grown = new Float32Array(this.capacity * this.units);
      grown.set(this[name]);
      this[name] = grown;
    }
  }

  /** @param {number} tick */
  summarise(tick) {
    const left = [0, 0],
      living = [0, 0];
    for (let unit = 0; unit < this.units; unit++) {
      const at = tick * this.units + unit,
        faction = this.info.units[unit].faction;
      if (this.alive[at]) {
        left[faction] += this.hp[at] + this.shield[at];
        living[faction]++;
      } else if (this.deathTick[unit] === Infinity) {
        this.deathTick[unit] = tick;
        this.deaths.push({ tick, unit });
      }
    }
    for (const faction of [0, 1]) {
      this.health[faction].push(left[faction] / this.mostHealth[faction]);
      this.living[faction].push(living[faction]);
    }
  }

  /**
   * A unit at a time between two moments: positions move evenly, the rest is that of the moment before.
   * @param {number} unit
   * @param {number} time
   */
  unitAt(unit, time) {
    const before = Math.min(Math.floor(time), this.last),
      after = Math.min(before + 1, this.last);
    const part = time - before,
      a = before * this.units + unit,
      b = after * this.units + unit;
    /** @param {Float32Array} column */
    const mix = (column) => column[a] + (column[b] - column[a]) * part;
    const turn = ((this.facing[b] - this.facing[a] + 3 * Math.PI) % (2 * Math.PI)) - Math.PI;
    return {
      unit,
      x: mix(this.x),
      y: mix(this.y),
      facing: this.facing[a] + turn * part,
      hp: mix(this.hp),
      shield: mix(this.shield),
      energy: mix(this.energy),
      // A cooldown that begins jumps up; one that runs falls evenly.
      cooldown: this.cooldown[b] > this.cooldown[a] ? this.cooldown[a] : mix(this.cooldown),
      target: this.target[a],
      alive: this.alive[a] > 0,
    };
  }
}
