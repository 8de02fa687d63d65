// A character and an agent at rest: the character's T-pose, from the places of its joints, and how their legs and feet
// compare. What retarget.js works out once.

import { cross, dot } from "./bases.js";
import { arc, between, multiply, relative, rotate, rotateBack } from "./quaternions.js";
import { BONES, PARENTS } from "./rig.js";

const SNAP = Math.cos((25 * Math.PI) / 180); // a rig's up or left so near to one of its axes is meant to be that axis
const SIDES = ["left", "right"];
/** Hip, knee, ankle, foot of the left and of the right leg. */
export const LEGS = SIDES.map((side) => ["hip", "knee", "ankle", "foot"].map((bone) => BONES.indexOf(`${side}_${bone}`)));
const ARMS = SIDES.map((side) => ["shoulder", "elbow", "wrist"].map((bone) => BONES.indexOf(`${side}_${bone}`)));
export const COUNT = BONES.length;
const HEEL = 0.34; // in lengths from ankle to ball: how far the heel is behind the ankle
const TIP = 0.38; // in lengths from ankle to ball: how far the tip of the toes is before the ball

/**
 * A foot in the T-pose, relative to the ankle's joint. `ball` and `heel` are on the ground. `fixed` turn with the
 * ankle; `toes` turn about `joint`, and are relative to it. x, y, z each.
 * @typedef {{ ball: Float64Array, heel: Float64Array, joint: Float64Array, fixed: Float64Array, toes: Float64Array }} Sole
 */

/** What `Retarget` knows of both before any frame. */
export class Rest {
  /**
   * As for `Retarget`.
   * @param {import("./bone_map.js").BoneMap} boneMap @param {ArrayLike<number>} restOffsets
   * @param {import("./bases.js").Basis} basis @param {number} floor @param {import("./soles.js").Soles | null} soles
   */
  constructor(boneMap, restOffsets, basis, floor, soles) {
    const { rig, bones } = boneMap;
    this.basis = basis;
    this.nodes = Int32Array.from(BONES, (bone) => bones.get(bone) ?? -1);
    this.mapped = Int32Array.from([...bones.keys()], (bone) => BONES.indexOf(bone));
    /** The bone that each follows, and that its node hangs from in the file; -1: none. */
    this.above = new Int32Array(COUNT).fill(-1);
    this.hangs = new Int32Array(COUNT).fill(-1);
    const boneOf = new Map([...this.mapped].map((b) => [this.nodes[b], b]));
    for (const b of this.mapped) {
      let above = PARENTS[b];
      while (above >= 0 && this.nodes[above] < 0) above = PARENTS[above];
      this.above[b] = above;
      const node = rig.ancestors(this.nodes[b]).find((n) => boneOf.has(n));
      if (node !== undefined) this.hangs[b] = /** @type {number} */ (boneOf.get(node));
    }
    /** Bones whose places must be set, too: the hips, and bones that hang from another bone than they follow. */
    this.loose = this.mapped.filter((b) => b === 0 || this.hangs[b] !== this.above[b]);
    this.offsets = Float64Array.from({ length: 3 * COUNT }, (_, k) => restOffsets[k]);
    if (this.offsets.some(Number.isNaN)) throw new Error(`rest offsets of ${COUNT} bones are needed`);
    /** The rotation from the character's axes to the basis. */
    this.turn = alignment(rig, bones, basis);
    const { turn } = this;
    const rest = perBone((b) => product(turn, rig.rotation(this.nodes[b])), this.mapped);
    const place = perBone((b) => turned(turn, rig.place(this.nodes[b])), this.mapped);
    const correct = this.#corrections(place);
    this.turns = new Float64Array(4 * COUNT); // of each node in the T-pose
    this.offset = new Float64Array(3 * COUNT); // of each bone, in the axes of the one above
    // rotation, place and scale of the node's parent, in the axes of the bone that it hangs from
    this.parentTurn = new Float64Array(4 * COUNT);
    this.parentPlace = new Float64Array(3 * COUNT);
    this.parentScale = new Float64Array(3 * COUNT).fill(1);
    for (const b of this.mapped) {
      multiply(correct[b], 0, rest[b], 0, this.turns, 4 * b);
      const a = this.above[b], hangs = this.hangs[b], { parent } = rig.nodes[this.nodes[b]];
      if (a >= 0) rotateBack(rest[a], 0, minus(place[b], place[a]), 0, this.offset, 3 * b);
      this.parentTurn.set(rig.rotation(parent), 4 * b);
      if (parent < 0) continue;
      this.parentPlace.set(rig.place(parent), 3 * b);
      this.parentScale.set(rig.scales.subarray(3 * parent, 3 * parent + 3), 3 * b);
      if (hangs < 0) continue;
      const node = this.nodes[hangs];
      relative(rig.rotation(node), 0, rig.rotation(parent), 0, this.parentTurn, 4 * b);
      rotateBack(rig.rotation(node), 0, minus(rig.place(parent), rig.place(node)), 0, this.parentPlace, 3 * b);
    }
    this.thighs = new Float64Array(3); // the middle of the thigh joints from the hips' node, in its axes
    rotateBack(rest[0], 0, minus(thighsOf(place), place[0]), 0, this.thighs, 0);
    this.ratio = 1;
    /** @type {Sole[]} */
    this.soles = [];
    /** @type {Sole[]} */
    this.sourceSoles = []; // of the agent
    this.stance = [new Float64Array(3), new Float64Array(3)]; // how far the balls stand beside the agent's
    this.tips = [new Float64Array(3), new Float64Array(3)]; // from the toes' joints: as far before them and as low as toes reach
    this.lengths = new Float64Array(2); // of the legs, from thigh joint to ankle along the bones
    this.sourceLengths = new Float64Array(2);
    /** Height of the character's soles at rest, and the point of the ground below it, upright in the basis. */
    this.floor = 0;
    this.origin = new Float64Array(3);
    this.#legs(place, correct, floor, soles);
  }

  /** What turns each bone from the character's rest pose into a T-pose. @param {Float64Array[]} place */
  #corrections(place) {
    const { left, up, forward } = this.basis;
    const down = up.map((value) => -value);
    const right = left.map((value) => -value);
    /** @type {Map<number, [number, Float64Array]>} */
    const aims = new Map();
    for (const [s, [hip, knee, ankle]] of LEGS.entries()) {
      const [shoulder, elbow, wrist] = ARMS[s];
      aims.set(hip, [knee, down]).set(knee, [ankle, down]);
      aims.set(shoulder, [elbow, s ? right : left]).set(elbow, [wrist, s ? right : left]);
    }
    /** @type {Float64Array[]} */
    const correct = [];
    for (const b of this.mapped) {
      let turn = correct[this.above[b]] ?? Float64Array.of(0, 0, 0, 1);
      const [end, aim] = aims.get(b) ?? [-1, down];
      if (end >= 0 && place[end]) turn = product(least(turned(turn, minus(place[end], place[b])), aim), turn);
      correct[b] = turn;
    }
    for (const [, , ankle, toe] of LEGS) { // soles stay level: feet only turn to the front
      const ahead = place[toe] ? this.#level(minus(place[toe], place[ankle])) : forward;
      correct[ankle] = least(ahead, forward);
      if (place[toe]) correct[toe] = correct[ankle];
    }
    return correct;
  }

  /** @param {Float64Array} v */
  #level(v) {
    const { up } = this.basis;
    const high = dot(v, up);
    return v.map((value, n) => value - high * up[n]);
  }

  /**
   * Soles, stance, and the ratio of heights.
   * @param {Float64Array[]} place @param {Float64Array[]} correct @param {number} floor
   * @param {import("./soles.js").Soles | null} soles
   */
  #legs(place, correct, floor, soles) {
    const { up, left, forward } = this.basis;
    /** @type {Float64Array[]} */
    const stand = [place[0]]; // joint places in the T-pose
    for (const b of this.mapped) {
      const a = this.above[b];
      if (a >= 0) stand[b] = plus(stand[a], turned(correct[a], minus(place[b], place[a])));
    }
    /** @type {Float64Array[]} */
    const source = [];
    PARENTS.forEach((parent, b) => {
      const offset = this.offsets.slice(3 * b, 3 * b + 3);
      source[b] = parent < 0 ? offset : plus(source[parent], offset);
    });
    const below = (/** @type {Float64Array[]} */ at) => LEGS.reduce((sum, leg) => sum + dot(minus(at[leg[0]], at[leg[2]]), up), 0);
    const legs = below(stand);
    const scale = legs / below(source);
    const feet = LEGS.flatMap((leg) => leg.slice(2));
    if (Number.isNaN(floor) && soles) floor = soles.floor;
    if (Number.isNaN(floor)) {
      const lowest = Math.min(...feet.filter((b) => place[b]).map((b) => dot(place[b], up)));
      floor = 0;
      if (!(lowest >= 0 && lowest <= 0.25 * (dot(thighsOf(place), up) - lowest))) {
        floor = lowest - scale * Math.min(...feet.map((b) => dot(source[b], up)));
      }
    }
    this.floor = floor;
    this.origin = plus(this.#level(thighsOf(place)), up.map((value) => floor * value));
    const thighs = thighsOf(stand), sourceThighs = thighsOf(source);
    let high = 0;
    LEGS.forEach(([, knee, ankle, toe], leg) => {
      const ball = minus(source[toe], source[ankle]);
      this.sourceSoles.push(this.#sole(ball, dot(source[ankle], up)));
      // without toes, where a foot of this size would have them
      const own = place[toe] ? turned(correct[ankle], minus(place[toe], place[ankle])) : ball.map((value) => scale * value);
      const height = dot(place[ankle], up) - floor;
      high += height / LEGS.length;
      const foot = this.#sole(own, height);
      this.soles.push(soles ? {
        ...foot,
        joint: own,
        fixed: allTurned(correct[ankle], soles.feet[leg].fixed),
        toes: place[toe] ? allTurned(correct[ankle], soles.feet[leg].toes) : new Float64Array(),
      } : foot);
      const { toes } = this.soles[leg];
      const points = Array.from({ length: toes.length / 3 }, (_, k) => toes.subarray(3 * k, 3 * k + 3));
      const before = Math.max(...points.map((point) => dot(point, forward)));
      const low = Math.min(...points.map((point) => dot(point, up)));
      if (points.length) this.tips[leg].set(forward.map((value, n) => before * value + low * up[n]));
      for (const b of [knee, ankle]) {
        this.lengths[leg] += Math.hypot(...this.offset.subarray(3 * b, 3 * b + 3));
        this.sourceLengths[leg] += Math.hypot(...this.offsets.subarray(3 * b, 3 * b + 3));
      }
      const beside = dot(minus(minus(plus(stand[ankle], own), thighs), minus(source[toe], sourceThighs)), left);
      this.stance[leg].set(left.map((value) => beside * value));
    });
    this.ratio = (legs / LEGS.length + high) / dot(sourceThighs, up);
  }

  /**
   * A foot of which only the joints are known: the toes' from the ankle, which is at this height.
   * @param {Float64Array} toe @param {number} height @returns {Sole}
   */
  #sole(toe, height) {
    const ahead = this.#level(toe);
    const { up } = this.basis;
    const ball = ahead.map((value, n) => value - height * up[n]);
    const heel = ahead.map((value, n) => -HEEL * value - height * up[n]);
    const under = minus(ball, toe);
    const tip = under.map((value, n) => value + TIP * ahead[n]);
    return { ball, heel, joint: toe, fixed: Float64Array.of(...heel, ...ball), toes: Float64Array.of(...under, ...tip) };
  }
}

/** @param {(b: number) => Float64Array} value @param {Int32Array} bones @returns {Float64Array[]} */
function perBone(value, bones) {
  /** @type {Float64Array[]} */
  const found = [];
  for (const b of bones) found[b] = value(b);
  return found;
}

/** @param {Float64Array} p @param {Float64Array} q */
function product(p, q) {
  const out = new Float64Array(4);
  multiply(p, 0, q, 0, out, 0);
  return out;
}

/** @param {Float64Array} q @param {Float64Array} v */
function turned(q, v) {
  const out = new Float64Array(3);
  rotate(q, 0, v, 0, out, 0);
  return out;
}

/** @param {Float64Array} a @param {Float64Array} b */
function least(a, b) {
  const out = new Float64Array(4);
  arc(a, 0, b, 0, out, 0);
  return out;
}

/** @param {Float64Array} a @param {Float64Array} b */
function minus(a, b) {
  return a.map((value, n) => value - b[n]);
}

/** @param {Float64Array} a @param {Float64Array} b */
function plus(a, b) {
  return a.map((value, n) => value + b[n]);
}

/** @param {Float64Array} direction */
function snapped(direction) {
  const length = Math.hypot(...direction);
  const sizes = [...direction].map(Math.abs);
  const k = sizes.indexOf(Math.max(...sizes));
  if (sizes[k] / length < SNAP) return direction.map((value) => value / length);
  return direction.map((value, n) => (n === k ? Math.sign(value) : 0));
}

/** @param {Float64Array} a @param {Float64Array} b */
function middle(a, b) {
  return a.map((value, n) => (value + b[n]) / 2);
}

/** The middle of the thigh joints: where the pelvis is. A rig's hips joint lies anywhere around it. @param {Float64Array[]} place */
function thighsOf(place) {
  return middle(place[LEGS[0][0]], place[LEGS[1][0]]);
}

/** Points, x, y, z each, that are turned. @param {Float64Array} turn @param {Float64Array} points */
function allTurned(turn, points) {
  const out = new Float64Array(points.length);
  for (let k = 0; k < points.length; k += 3) rotate(turn, 0, points, k, out, k);
  return out;
}

/**
 * The rotation from a character's axes to the basis, by where its legs are.
 * @param {import("./rig.js").Rig} rig @param {Map<string, number>} bones @param {import("./bases.js").Basis} basis
 */
export function alignment(rig, bones, basis) {
  const at = (/** @type {number} */ b) => rig.place(/** @type {number} */ (bones.get(BONES[b])));
  const [onLeft, onRight] = LEGS.map(([hip, , ankle]) => [at(hip), at(ankle)]);
  const up = snapped(minus(middle(onLeft[0], onRight[0]), middle(onLeft[1], onRight[1])));
  const across = minus(onLeft[0], onRight[0]);
  const level = (/** @type {Float64Array} */ v) => v.map((value, n) => value - dot(v, up) * up[n]);
  const aside = level(snapped(level(across)));
  const left = aside.map((value) => value / Math.hypot(...aside));
  const forward = cross(left, up).map((value) => basis.handed * value);
  return between([left, up, forward], [basis.left, basis.up, basis.forward]);
}
