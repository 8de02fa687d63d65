// One person: its planned and sent motion, its goals, and the results of steps. It mirrors the server's world/stepping
// (scheduler, playback), for one person. World: metres, Z up; time: frames, 40 per second.

import { lockFeet } from "./footlock.js";
import { bendable, broken, fallen, gotUp } from "./guards.js";
import { isMirrored, mannerOf, noiseOf, ownNoiseOf, reactionOf } from "./random.js";
import { righted } from "./righting.js";
import { STANDING, WALKING, facingOf, goalAt, goalRows, observe } from "./steering.js";

export const FRAMES = 8, SEED = 2, TURN = 88;
const LEAD = 1; // chunks planned ahead of their time
const REPLAN_FRAMES = 4, REPLAN_MARGIN = 2; // a chunk shown this soon is not planned again
const FLAG_FIRST = 1, FLAG_REPLANNED = 2, FLAG_ARRIVED = 4;

/** @typedef {import("./steering.js").Gait} Gait */
/** @typedef {import("./steering.js").CoreGoal} CoreGoal */
/**
 * The two frames that a step starts from.
 * @typedef {object} Seed
 * @property {Float32Array} markers @property {Float32Array} translation @property {Float32Array} rotations
 */
/**
 * New frames, and the markers that the next step starts from.
 * @typedef {object} Step
 * @property {Float64Array} translation @property {Float64Array} rotations @property {Float32Array} markers
 * @property {Uint8Array} contacts left and right of each frame
 */
/** State between two steps. @typedef {{ seed: Seed, gait: Gait }} Motion */
/**
 * Eight frames; rotations of 22 joints. `frame`: world frame of the first one.
 * @typedef {object} LocalChunk
 * @property {number} seq @property {number} frame @property {Float64Array} translation @property {Float64Array} rotations
 * @property {Uint8Array} contacts left and right of each frame @property {number} flags @property {number} mode
 * @property {number} waypoint @property {number} goalRevision @property {boolean} last the goal is the last one
 * @property {boolean} through @property {Motion} end
 */
/** Where a step of a person starts. @typedef {{ person: Person, seed: Seed, start: import("./steering.js").Start, gait: Gait, goal: import("./steering.js").GoalRow }} Begun */
/**
 * @typedef {object} PersonSpec
 * @property {"female" | "male"} gender @property {ArrayLike<number>} betas @property {number} x @property {number} y
 * @property {number} heading @property {bigint} seed determines their motion @property {boolean} footLock
 */

export class Person {
  /** @type {LocalChunk[]} */
  #queue = []; // planned, not sent
  #replanned = false;
  #revision = 0;
  /** @type {import("./steering.js").GoalRow[]} */
  #path = [];
  /** @type {CoreGoal[]} */
  #goals = [];
  /** @type {[number, number]} */
  #from = [0, 0]; // where the path begins

  /**
   * @param {PersonSpec} spec @param {import("./body.js").LocalBody} body @param {import("./steering.js").Steering} steering
   * @param {number} startFrame @param {number} number of two people that block each other, the lower number goes first
   */
  constructor(spec, body, steering, startFrame, number) {
    this.number = number;
    this.spec = spec;
    this.body = body;
    this.steering = steering;
    this.startFrame = startFrame;
    const { bones, legs } = body.shape(spec.betas);
    this.bones = bones;
    this.legs = legs;
    this.ownNoise = ownNoiseOf(spec.seed);
    this.manner = mannerOf(spec.seed);
    this.mirrored = isMirrored(spec.seed);
    this.reaction = reactionOf(spec.seed, steering.reactions);
    this.planned = this.#stand(spec.x, spec.y, spec.heading);
    this.committed = this.planned;
    this.plannedChunks = 0;
    this.sentChunks = 0;
    this.stepping = 0; // number of the engine call that computes the next chunk; 0: none
    this.resets = 0; // how often it had to stand up again
  }

  /** World frame by which the next chunk must be planned; Infinity while it is computed, or may not yet be. */
  get planFrame() {
    if (this.stepping || this.plannedChunks - this.sentChunks > LEAD) return Infinity;
    return this.#shown(this.plannedChunks) - (this.#replanned ? REPLAN_FRAMES : LEAD * FRAMES);
  }

  /** World frame at which the next planned chunk is due; Infinity when there is none. */
  get sendFrame() {
    return this.#queue.length ? this.#shown(this.sentChunks) : Infinity;
  }

  /** World frame of the first unplanned frame. */
  get nextFrame() {
    return this.#shown(this.plannedChunks);
  }

  /** Counts the changes of the path. */
  get revision() {
    return this.#revision;
  }

  /** The present goal's place in the path. */
  get waypoint() {
    return this.planned.gait.waypoint;
  }

  /** Number of goals given so far on this path. */
  get waypoints() {
    return this.#goals.length;
  }

  /** Hips [x, y, z] at the end of the sent motion. */
  get place() {
    return this.committed.seed.translation.subarray(3, 6);
  }

  /** Replace the goals by a path; without goals: stop. @param {CoreGoal[]} goals @param {number} frame now */
  give(goals, frame) {
    this.#replan(frame + REPLAN_MARGIN);
    this.#revision += 1;
    const { translation } = this.planned.seed;
    this.#from = [translation[3], translation[4]];
    this.#goals = [...goals];
    this.#path = goalRows(this.#goals, this.#from);
    const mode = goals.length ? WALKING : this.planned.gait.mode;
    this.planned = { ...this.planned, gait: { ...this.planned.gait, mode, arrived: false, waypoint: 0 } };
  }

  /** Adds goals to the end of the path. @param {CoreGoal[]} goals @param {number} frame now */
  append(goals, frame) {
    if (!this.#goals.length) {
      this.give(goals, frame);
      return;
    }
    this.#revision += 1;
    this.#goals.push(...goals);
    this.#path = goalRows(this.#goals, this.#from);
  }

  /** Moves a goal of the path. @param {number} waypoint @param {[number, number]} place */
  moveGoal(waypoint, place) {
    if (!this.#goals[waypoint]) return;
    const goal = { ...this.#goals[waypoint], x: place[0], y: place[1] };
    this.#goals[waypoint] = goal;
    this.#path[waypoint] = { ...this.#path[waypoint], place };
  }

  /** Where the next step starts, and its goal. @returns {Begun} */
  begin() {
    const { seed } = this.planned, { translation, rotations } = seed;
    /** @type {import("./steering.js").Start} */
    const start = {
      hips: [translation[3], translation[4]], first: [translation[0], translation[1]], facing: facingOf(rotations, TURN),
    };
    const gait = this.steering.advance(this.planned.gait, goalAt(this.#path, this.planned.gait.waypoint));
    return { person: this, seed, start, gait, goal: goalAt(this.#path, gait.waypoint) };
  }

  /**
   * The inputs of the next step that depend on the goal. `ahead` is the goal that steering sees, and `judged` the
   * goal by which arrival is judged (see guide.js).
   * @param {Begun} begun @param {import("./guide.js").Course} course
   */
  next({ seed, start, gait: before }, { ahead, judged }) {
    const ready = (this.plannedChunks + this.reaction) % this.steering.reactions === 0;
    const gait = this.steering.decide(before, start, ahead, ready);
    const noise = noiseOf(this.spec.seed, this.plannedChunks);
    return { seed, start, gait, goal: judged, noise, targets: this.steering.targets(gait, start, ahead) };
  }

  /** Plan a chunk from the engine's result. @param {ReturnType<Person["next"]>} asked @param {Step} made */
  take({ seed, start, gait, goal }, made) {
    const from = [...seed.translation.subarray(3, 6)];
    const isBroken = broken(from, made.translation, [made.translation, made.rotations, made.markers]);
    let step = made;
    if (isBroken) step = { ...made, ...stillFrames(seed) };
    step = righted(gait.mode, { ...step, rotations: bendable(step.rotations, this.legs) }, this.body.shares);
    if (this.spec.footLock) step = lockFeet(this.legs, this.body.legShares, seed, step);
    const after = observe(gait, start.hips, step.translation, goal);
    let flags = this.#replanned ? FLAG_REPLANNED : 0;
    if (after.arrived && !gait.arrived) flags |= FLAG_ARRIVED;
    /** @type {Motion} */
    let end = { seed: endOf(step), gait: after };
    if (isBroken || fallen(step.translation, step.rotations, this.legs)) {
      if (isBroken) flags |= FLAG_FIRST;
      const heading = Math.atan2(-start.facing[0], start.facing[1]);
      const stand = this.#stand(start.hips[0], start.hips[1], heading);
      step = { ...step, ...gotUp(seed, stand.seed), contacts: new Uint8Array(2 * FRAMES).fill(1) };
      end = { ...stand, gait: { ...stand.gait, waypoint: after.waypoint } };
      this.resets += 1;
    }
    this.#queue.push({
      seq: this.plannedChunks, frame: 0, translation: step.translation, rotations: step.rotations,
      contacts: step.contacts, flags, mode: end.gait.mode, waypoint: end.gait.waypoint, goalRevision: this.#revision,
      last: !goal.more, through: goal.through, end,
    });
    this.planned = end;
    this.plannedChunks += 1;
    this.#replanned = false;
  }

  /** Takes out the next chunk. @returns {LocalChunk} */
  send() {
    const chunk = /** @type {LocalChunk} */ (this.#queue.shift());
    chunk.frame = this.#shown(chunk.seq);
    this.sentChunks += 1;
    this.committed = chunk.end;
    return chunk;
  }

  /** Discard planned chunks that are shown after a world frame, and the one being computed. @param {number} until */
  #replan(until) {
    this.stepping = 0;
    const before = this.#queue.length;
    this.#queue = this.#queue.filter((chunk) => this.#shown(chunk.seq) <= until);
    if (this.#queue.length === before) return;
    this.#replanned = true;
    this.plannedChunks = this.sentChunks + this.#queue.length;
    this.planned = this.#queue.at(-1)?.end ?? this.committed;
  }

  /** @param {number} seq */
  #shown(seq) {
    return this.startFrame + FRAMES * seq;
  }

  /** @param {number} x @param {number} y @param {number} heading @returns {Motion} */
  #stand(x, y, heading) {
    const pose = Number(this.spec.seed % BigInt(this.body.poses));
    const seed = this.body.stand(pose, this.spec.betas, x, y, heading);
    return {
      seed,
      gait: {
        mode: STANDING, speed: 0, slowSeconds: 0, stopPlace: [x, y], stopFacing: [-Math.sin(heading), Math.cos(heading)],
        arrived: false, waypoint: 0, trim: 0, rested: true,
      },
    };
  }
}

/** Where the next step starts. @param {Step} step @returns {Seed} */
const endOf = ({ markers, translation, rotations }) => ({
  markers, translation: Float32Array.from(translation.subarray(-3 * SEED)), rotations: Float32Array.from(rotations.subarray(-TURN * SEED)),
});

/** @param {Seed} seed */
function stillFrames(seed) {
  const last = (/** @type {Float32Array} */ values) => values.subarray(values.length / SEED);
  const repeat = (/** @type {Float32Array} */ frame) =>
    Float64Array.from({ length: FRAMES * frame.length }, (_, k) => frame[k % frame.length]);
  return { translation: repeat(last(seed.translation)), rotations: repeat(last(seed.rotations)) };
}
