// The people of a local session, in the page's thread or in a worker: commands come in, chunks go out, time passes.

import { Unreachable } from "./scene.js";
import { LocalWorld } from "./world.js";

const FPS = 40;
const LATE = 0.25; // seconds behind after which time waits: the machine is too slow
const STATES = ["standing", "walking", "stopping", "turning", "walking"];
const STANDING = 0, FLAG_ARRIVED = 4;
const DRAWS = 16; // most draws of a place to wander to, until one is free

/** @typedef {import("./person.js").Person} Person */
/**
 * A chunk for the page. `frames` has hips x, y, z and 22 rotations of each frame, glTF basis. `contacts`: 1 left, 2 right.
 * @typedef {{ kind: "chunk", alias: number, seq: number, at: number, goalRevision: number, state: string, flags: number, waypoint: number, frames: Float32Array, contacts: Uint8Array }} ChunkMessage
 */
/** @typedef {{ kind: "event", event: { kind: string, agentId: string, alias: number, at: number, goalRevision: number, waypoint: number, detail: string } }} EventMessage */
/** People can no longer be moved. @typedef {{ kind: "failed", reason: string }} FailedMessage */
/** @typedef {ChunkMessage | EventMessage | FailedMessage} HostMessage */
/** Where a person wanders, in the core's frame. @typedef {{ x: number, y: number, radius: number, speed?: number }} Area */

/** Seconds of a clock that pages and their workers share. */
export const sharedClock = () => (performance.timeOrigin + performance.now()) / 1000;

export class LocalHost {
  /** @type {Map<number, Person>} */
  #people = new Map();
  /** @type {Map<number, { area: Area, random: () => number }>} */
  #wanderers = new Map();
  /** @type {Set<number>} */
  #done = new Set(); // aliases whose path is done, and reported as done
  #lastAlias = 0;
  #epoch;
  #running = false;
  #closed = false;
  /** @type {ReturnType<typeof setTimeout> | undefined} */
  #timer;

  /**
   * @param {Awaited<ReturnType<typeof import("./graphs.js").openExport>> & { scene?: import("./scene.js").LocalScene | null, avoid?: boolean }} opened
   * @param {(message: HostMessage) => void} tell @param {() => number} [now]
   */
  constructor({ about, bodies, run, scene, avoid }, tell, now = sharedClock) {
    this.tell = tell;
    this.now = now;
    this.#epoch = now();
    const timed = async (/** @type {string} */ gender, /** @type {Record<string, import("./world.js").Tensor>} */ feeds) => {
      const began = performance.now();
      const outputs = await run(gender, feeds);
      this.stats.graphMs += performance.now() - began;
      return outputs;
    };
    this.world = new LocalWorld(about, bodies, timed, scene ?? null, (person, kind, waypoint, what) => this.#met(person, kind, waypoint, what), avoid);
    /** Milliseconds in the graph and around it, steps of people, and seconds that time has waited for the machine. */
    this.stats = { graphMs: 0, otherMs: 0, rows: 0, waited: 0 };
  }

  /** @param {import("./person.js").PersonSpec} spec */
  add(spec) {
    const person = this.world.add(spec, this.#frame());
    const alias = (this.#lastAlias += 1);
    this.#people.set(alias, person);
    this.#wake();
    return { alias, bones: person.bones };
  }

  /** @param {number} alias */
  remove(alias) {
    this.world.remove(this.#person(alias));
    this.#people.delete(alias);
    this.#wanderers.delete(alias);
  }

  /** Replace the path; without goals: stop. @param {number} alias @param {import("./steering.js").CoreGoal[]} goals */
  give(alias, goals) {
    const person = this.#person(alias), found = this.#fitted(person, goals);
    this.#wanderers.delete(alias);
    this.#done.delete(alias);
    person.give(found.goals, this.#frame());
    for (const { index, place } of found.moves) this.#met(person, "goal_moved", index, place);
    this.#wake();
  }

  /** @param {number} alias @param {import("./steering.js").CoreGoal[]} goals */
  append(alias, goals) {
    const person = this.#person(alias), found = this.#fitted(person, goals), before = person.waypoints;
    this.#wanderers.delete(alias);
    this.#done.delete(alias);
    person.append(found.goals, this.#frame());
    for (const { index, place } of found.moves) this.#met(person, "goal_moved", before + index, place);
    this.#wake();
  }

  /** Wander within an area, from point to point. @param {number} alias @param {Area} area */
  wander(alias, area) {
    const person = this.#person(alias), random = sequence(Number(person.spec.seed & 0xffffffffn) + 1);
    this.give(alias, [this.#place(person, area, random)]);
    this.#wanderers.set(alias, { area, random });
  }

  figures() {
    return { ...this.stats, rows: this.world.stats.rows, calls: this.world.stats.calls, people: this.#people.size };
  }

  close() {
    this.#closed = true;
    clearTimeout(this.#timer);
  }

  /** @param {number} alias */
  #person(alias) {
    const person = this.#people.get(alias);
    if (!person) throw new Error(`there is no agent ${alias} in this session`);
    return person;
  }

  #frame() {
    return (this.now() - this.#epoch) * FPS;
  }

  #wake() {
    if (this.#closed || this.#running) return;
    clearTimeout(this.#timer);
    const wait = (this.world.nextEvent - this.#frame()) / FPS;
    if (wait < Infinity) this.#timer = setTimeout(() => this.#go(), Math.max(0, 1000 * wait));
  }

  async #go() {
    try {
      await this.#tick();
    } catch (error) {
      this.close();
      this.tell({ kind: "failed", reason: String(/** @type {Error} */ (error).message) });
    }
  }

  async #tick() {
    this.#running = true;
    try {
      const late = (this.#frame() - this.world.nextEvent) / FPS;
      if (late > LATE) {
        this.#epoch += late; // chunks that are not yet sent are shown later
        this.stats.waited += late;
      }
      const before = performance.now(), graph = this.stats.graphMs;
      for (const alias of this.#wanderers.keys()) this.#walkOn(alias);
      await this.world.tick(this.#frame() + 1e-3, (person, chunk) => this.#sent(person, chunk));
      this.stats.otherMs += performance.now() - before - (this.stats.graphMs - graph);
    } finally {
      this.#running = false;
    }
    this.#wake();
  }

  /** Gives an agent that is on the way to its last point another point. @param {number} alias */
  #walkOn(alias) {
    const person = this.#person(alias), { area, random } = /** @type {{ area: Area, random: () => number }} */ (this.#wanderers.get(alias));
    if (person.waypoint >= person.waypoints - 1) person.append([this.#place(person, area, random)], this.#frame());
  }

  /** A goal within an area that the person can reach. @param {Person} person @param {Area} area @param {() => number} random */
  #place(person, area, random) {
    const { scene } = this.world, [x, y] = person.place;
    for (let draw = 0; draw < DRAWS; draw += 1) {
      const drawn = place(area, random);
      if (!scene) return drawn;
      const { triangle, moved } = scene.place([drawn.x, drawn.y]);
      if (!moved && scene.island[triangle] === scene.island[scene.place([x, y]).triangle]) return drawn;
    }
    return { ...place({ ...area, x, y, radius: 0 }, random) }; // no place of the area is free: stay
  }

  /** @param {Person} person @param {import("./steering.js").CoreGoal[]} goals */
  #fitted(person, goals) {
    try {
      return this.world.fitted(person, goals);
    } catch (error) {
      if (error instanceof Unreachable) throw new Error(`no way leads to the goal; the nearest place that can be reached is ${shown(error.nearest)}`);
      throw error;
    }
  }

  /** Reports what a person met on its way; `what`: see `Tell` of guide.js. @param {Person} person @param {string} kind @param {number} waypoint @param {[number, number] | Person[]} what */
  #met(person, kind, waypoint, what) {
    const aliases = [...this.#people], found = aliases.find(([, other]) => other === person);
    if (!found || this.#wanderers.has(found[0])) return;
    const place = () => shown(/** @type {[number, number]} */ (what));
    const names = () => aliases.flatMap(([alias, other]) => (/** @type {any[]} */ (what).includes(other) ? [alias] : [])).join(", ");
    /** @type {Record<string, () => string>} */
    const details = {
      goal_moved: () => `the goal is not on free ground; the nearest that can be reached is ${place()}`,
      unreachable: () => `no way leads to the goal; the nearest place that can be reached is ${place()}`,
      blocked: () => `${names() || "others"} stand in the way; the agent waits`,
    };
    const detail = details[kind]();
    this.#event(found[0], kind, this.#epoch + person.nextFrame / FPS, person.revision, waypoint, detail);
  }

  /** @param {number} alias @param {string} kind @param {number} at @param {number} goalRevision @param {number} waypoint @param {string} detail */
  #event(alias, kind, at, goalRevision, waypoint, detail) {
    this.tell({ kind: "event", event: { kind, agentId: String(alias), alias, at, goalRevision, waypoint, detail } });
  }

  /** @param {Person} person @param {import("./person.js").LocalChunk} chunk */
  #sent(person, chunk) {
    const found = [...this.#people].find(([, other]) => other === person);
    if (!found || this.#closed) return;
    const [alias] = found, at = this.#epoch + chunk.frame / FPS;
    const contacts = Uint8Array.from({ length: chunk.contacts.length / 2 }, (_, t) => chunk.contacts[2 * t] + 2 * chunk.contacts[2 * t + 1]);
    const { seq, goalRevision, flags, waypoint } = chunk;
    const frames = toGltf(chunk.translation, chunk.rotations);
    this.tell({ kind: "chunk", alias, seq, at, goalRevision, state: STATES[chunk.mode], flags, waypoint, frames, contacts });
    const event = (/** @type {string} */ kind, /** @type {string} */ detail) => this.#event(alias, kind, at, goalRevision, waypoint, detail);
    if (flags & FLAG_ARRIVED) event("goal_reached", `goal ${waypoint} was reached`);
    const stands = chunk.mode === STANDING && chunk.end.gait.arrived;
    if (chunk.last && (stands || (chunk.through && flags & FLAG_ARRIVED)) && !this.#done.has(alias)) {
      this.#done.add(alias);
      event("path_done", "the agent is at the last goal");
    }
  }
}

/**
 * Frames in the form of the stream: glTF basis, hips and 22 rotations.
 * @param {Float64Array} translation @param {Float64Array} rotations
 */
function toGltf(translation, rotations) {
  const count = translation.length / 3, joints = rotations.length / count / 4, width = 3 + 4 * joints;
  const frames = new Float32Array(count * width);
  for (let t = 0; t < count; t += 1) {
    frames[width * t] = -translation[3 * t];
    frames[width * t + 1] = translation[3 * t + 2];
    frames[width * t + 2] = translation[3 * t + 1];
    for (let j = 0; j < joints; j += 1) {
      const from = 4 * (joints * t + j), to = width * t + 3 + 4 * j;
      frames[to] = -rotations[from];
      frames[to + 1] = rotations[from + 2];
      frames[to + 2] = rotations[from + 1];
      frames[to + 3] = rotations[from + 3];
    }
  }
  return frames;
}

/** A place in the page's basis. @param {[number, number]} place */
const shown = ([x, y]) => `x ${(-x).toFixed(2)}, z ${y.toFixed(2)}`;

/** @param {Area} area @param {() => number} random */
function place({ x, y, radius, speed }, random) {
  const angle = 2 * Math.PI * random(), away = radius * Math.sqrt(random());
  const goal = { x: x + away * Math.cos(angle), y: y + away * Math.sin(angle), stop: false, radius: 0.5 };
  return speed === undefined ? goal : { ...goal, speed };
}

/** Numbers 0 … 1 (mulberry32). @param {number} seed */
function sequence(seed) {
  let state = seed >>> 0;
  return () => {
    state = (state + 0x6d2b79f5) >>> 0;
    let bits = Math.imul(state ^ (state >>> 15), state | 1);
    bits ^= bits + Math.imul(bits ^ (bits >>> 7), bits | 61);
    return ((bits ^ (bits >>> 14)) >>> 0) / 2 ** 32;
  };
}
