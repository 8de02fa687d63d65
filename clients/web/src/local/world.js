// People simulated on this machine: when each is stepped, and the graph's inputs. Time is an argument, in frames at 40
// per second; no clock is read and no page is needed. World: metres, Z up.

import { LocalBody } from "./body.js";
import { Guide, MOVED } from "./guide.js";
import { FRAMES, Person, SEED, TURN } from "./person.js";
import { MODES, Steering } from "./steering.js";

const JOINTS = 22, LATENT = 128, SCHEMA = 1;

/** Runs the graph of a gender: inputs by name to outputs by name. @typedef {(gender: string, feeds: Record<string, Tensor>) => Promise<Record<string, Float32Array>>} Run */
/** @typedef {{ data: Float32Array, dims: number[] }} Tensor */

export class LocalWorld {
  #lastCall = 0;
  #lastNumber = 0;
  /** @type {Set<Person>} */
  #people = new Set();
  /** @type {Guide | null} */
  #guide;

  /**
   * @param {any} about wayfarer.json @param {Record<string, ArrayBuffer>} bodies body_<gender>.bin, by gender @param {Run} run
   * @param {import("./scene.js").LocalScene | null} [scene] null: the floor is endless
   * @param {import("./guide.js").Tell} [tell] @param {boolean} [avoid] people avoid each other
   */
  constructor(about, bodies, run, scene = null, tell = () => {}, avoid = true) {
    if (about.schema !== SCHEMA) throw new Error(`wayfarer.json: schema ${about.schema}; this version reads ${SCHEMA}`);
    this.about = about;
    this.run = run;
    this.scene = scene;
    this.#guide = scene || avoid ? new Guide(scene, tell, avoid) : null;
    this.steering = new Steering(about.steering);
    this.bodies = new Map(Object.entries(bodies).map(([gender, bytes]) => [gender, new LocalBody(about, gender, bytes)]));
    this.modes = MODES.map((name) => about.modes[name]);
    /** Steps so far: rows and calls of the graph. */
    this.stats = { rows: 0, calls: 0 };
  }

  get people() {
    return this.#people;
  }

  /** @param {Partial<import("./person.js").PersonSpec>} spec @param {number} frame now */
  add(spec, frame) {
    const whole = {
      gender: /** @type {"female" | "male"} */ ("female"), betas: new Array(10).fill(0), x: 0, y: 0, heading: 0, seed: 0n,
      footLock: true, ...spec,
    };
    const body = this.bodies.get(whole.gender);
    if (!body) throw new Error(`gender "${whole.gender}"; allowed: ${[...this.bodies.keys()].join(", ")}`);
    const earliest = Math.floor(frame) + 1 + FRAMES; // plan one chunk ahead
    const start = earliest + ((FRAMES - (earliest % FRAMES)) % FRAMES); // people are stepped at common moments
    if (this.scene) [whole.x, whole.y] = this.scene.place([whole.x, whole.y]).spot;
    const person = new Person(whole, body, this.steering, start, this.#lastNumber += 1);
    this.#people.add(person);
    return person;
  }

  /**
   * Goals as a person can reach them: those off free ground are moved to the nearest free place, listed in `moves`.
   * Throws Unreachable. @param {Person} person @param {import("./steering.js").CoreGoal[]} goals
   */
  fitted(person, goals) {
    const { scene } = this, { translation } = person.planned.seed;
    /** @type {{ index: number, place: [number, number] }[]} */
    const moves = [];
    if (!scene) return { goals, moves };
    const fitted = goals.map((goal, index) => {
      const { spot, moved } = scene.reach([translation[3], translation[4]], [goal.x, goal.y]).last;
      if (moved > MOVED) moves.push({ index, place: spot });
      return { ...goal, x: spot[0], y: spot[1] };
    });
    return { goals: fitted, moves };
  }

  /** @param {Person} person */
  remove(person) {
    person.stepping = 0;
    this.#people.delete(person);
  }

  /** World frame of the next thing to do; Infinity without people. */
  get nextEvent() {
    let next = Infinity;
    for (const person of this.#people) next = Math.min(next, person.planFrame, person.sendFrame);
    return next;
  }

  /**
   * Do what is due by a world frame: send chunks whose time has come, and step people that need their next
   * one. @param {number} frame @param {(person: Person, chunk: import("./person.js").LocalChunk) => void} sent
   */
  async tick(frame, sent) {
    this.#send(frame, sent);
    for (;;) {
      const due = [...this.#people].filter((person) => person.planFrame <= frame);
      if (!due.length) return;
      due.sort((a, b) => a.planFrame - b.planFrame); // the most urgent first, otherwise in order
      await this.#step(due.filter(({ spec }) => spec.gender === due[0].spec.gender));
      this.#send(frame, sent);
    }
  }

  /** Runs from event to event up to a world frame, without waiting. @param {number} until @param {(person: Person, chunk: import("./person.js").LocalChunk) => void} sent */
  async advance(until, sent) {
    for (let next = this.nextEvent; next <= until; next = this.nextEvent) await this.tick(next, sent);
  }

  /** @param {number} frame @param {(person: Person, chunk: import("./person.js").LocalChunk) => void} sent */
  #send(frame, sent) {
    for (const person of this.#people) while (person.sendFrame <= frame) sent(person, person.send());
  }

  /** @param {Person[]} people of one gender */
  async #step(people) {
    const call = (this.#lastCall += 1), begun = people.map((person) => person.begin());
    const courses = this.#guide?.courses(begun, this.#people) ?? begun.map(({ goal }) => ({ ahead: goal, judged: goal }));
    const asked = people.map((person, k) => person.next(begun[k], courses[k]));
    for (const person of people) person.stepping = call;
    const outputs = await this.run(people[0].spec.gender, this.#feeds(people, asked));
    this.stats.calls += 1;
    this.stats.rows += people.length;
    people.forEach((person, row) => {
      if (person.stepping !== call) return; // replanned or removed meanwhile
      person.stepping = 0;
      person.take(asked[row], this.#made(outputs, row, person.mirrored));
    });
  }

  /** @param {Person[]} people @param {ReturnType<Person["next"]>[]} asked */
  #feeds(people, asked) {
    const count = people.length, markers = this.about.markers.length;
    /** @type {Record<string, Tensor>} */
    const feeds = {};
    for (const { name, shape } of this.about.inputs) {
      const dims = shape.map((/** @type {number | string} */ size) => (typeof size === "string" ? count : size));
      feeds[name] = { data: new Float32Array(dims.reduce((/** @type {number} */ a, /** @type {number} */ b) => a * b, 1)), dims };
    }
    people.forEach((person, row) => {
      const { seed, gait, targets } = asked[row], mode = this.modes[gait.mode], side = person.mirrored ? -1 : 1;
      const put = (/** @type {string} */ name, /** @type {ArrayLike<number>} */ values) => feeds[name]?.data.set(values, values.length * row); // a policy may lack an input
      put("seed_markers", person.mirrored ? this.#flippedMarkers(seed.markers) : seed.markers);
      put("seed_translation", person.mirrored ? flipped(seed.translation) : seed.translation);
      put("seed_rotations", person.mirrored ? this.#flippedTurns(seed.rotations) : seed.rotations);
      put("betas", person.spec.betas);
      put("goal", [side * targets.place[0], targets.place[1], 0]);
      put("target_speed", [targets.speed]);
      put("facing", [side * targets.facing[0], targets.facing[1]]);
      put("term_weights", mode.term_weights);
      put("policy", [mode.policy]);
      const { temperature, own } = mode, drawn = asked[row].noise;
      put("noise", Float32Array.from(person.ownNoise, (n, k) => temperature * (Math.sqrt(1 - own) * drawn[k] + Math.sqrt(own) * n)));
      put("manner", person.manner);
    });
    if (feeds.noise.dims[1] !== 1) throw new Error(`the graph takes ${feeds.noise.dims[1]} candidates; export it with 1`);
    if (feeds.seed_markers.dims[2] !== markers || feeds.noise.dims[2] !== LATENT) throw new Error("wayfarer.json: other sizes than this version's");
    return feeds;
  }

  /** A row of the outputs. @param {Record<string, Float32Array>} outputs @param {number} row @param {boolean} mirrored @returns {import("./person.js").Step} */
  #made(outputs, row, mirrored) {
    const pick = (/** @type {string} */ name, /** @type {number} */ size) => outputs[name].subarray(size * row, size * (row + 1));
    const translation = pick("translation", 3 * FRAMES), rotations = pick("rotations", TURN * FRAMES);
    const markers = pick("next_seed_markers", 3 * SEED * this.about.markers.length);
    const contacts = Uint8Array.from(pick("contacts", 2 * FRAMES), (n) => Number(n > 0.5));
    if (!mirrored) return { translation: Float64Array.from(translation), rotations: Float64Array.from(rotations), markers: markers.slice(), contacts };
    return {
      translation: Float64Array.from(flipped(translation)),
      rotations: Float64Array.from(this.#flippedTurns(rotations)),
      markers: this.#flippedMarkers(markers),
      contacts: contacts.map((_, k) => contacts[k ^ 1]),
    };
  }

  /** The mirror image in the plane x = 0. @param {Float32Array} markers */
  #flippedMarkers(markers) {
    const other = this.about.mirrored_markers, count = 3 * other.length;
    return flipped(Float32Array.from(markers, (_, k) => {
      const at = k % count;
      return markers[k - at + 3 * other[Math.floor(at / 3)] + (at % 3)];
    }));
  }

  /** @param {Float32Array} turns */
  #flippedTurns(turns) {
    const other = this.about.mirrored_joints, count = 4 * JOINTS;
    return Float32Array.from(turns, (_, k) => {
      const at = k % count, n = at % 4;
      return turns[k - at + 4 * other[Math.floor(at / 4)] + n] * (n === 1 || n === 2 ? -1 : 1);
    });
  }
}

/** @param {Float32Array} points */
const flipped = (points) => points.map((n, k) => (k % 3 ? n : -n));
