// A stream's poses on a character of any skeleton: clients/README.md, "Retargeting". Nothing here knows the axes of
// the character's bones: its T-pose follows from the places of its joints. `pose` allocates nothing.

import { BASES, cross, dot } from "./bases.js";
import { arc, between, multiply, relative, rotate, rotateBack } from "./quaternions.js";
import { BONES, PARENTS } from "./rig.js";

const SNAP = Math.cos((25 * Math.PI) / 180); // a rig's up or left so near to one of its axes is meant to be that axis
const REACH = 0.999; // of a leg's length: how far it is stretched at most
const BEND = 0.1; // of the thigh's length: a knee that bends less than this bends forwards
/** In lengths from ankle to ball: how far the heel is behind the ankle, and the tip of the toes before the ball. */
const FOOT = { heel: 0.35, tip: 0.45 };
const SIDES = ["left", "right"];
const LEGS = SIDES.map((side) => ["hip", "knee", "ankle", "foot"].map((bone) => BONES.indexOf(`${side}_${bone}`)));
const ARMS = SIDES.map((side) => ["shoulder", "elbow", "wrist"].map((bone) => BONES.indexOf(`${side}_${bone}`)));
const COUNT = BONES.length;

// places in the scratch array of vectors
const AHEAD = 0, BESIDE = 3, GOAL = 6, ALONG = 9, SIDE = 12, FRONT = 15, FROM = 18, TO = 21, BALL = 24, TURN = 27, MORE = 31;
const GROUND = 34, LOW = 35, SOLE = 36, MOST = 37, LEAST = 38, LENGTH = 39, CLEAR = 40; // and of numbers
// (those that a function returned would be boxed; CLEAR: one a leg)

/** Turns frames of an agent into poses of a character. */
export class Retarget {
  /**
   * `restOffsets` of the agent, three numbers a bone; `floor`: height of the character's soles at rest. Both in the
   * stream's basis and unit, as is the character's own space. `foot`: how far its heel is behind the ankle and the tip
   * of its toes before the ball, in lengths from ankle to ball.
   * @param {import("./bone_map.js").BoneMap} boneMap @param {ArrayLike<number>} restOffsets
   * @param {import("./bases.js").Basis} [basis] @param {number} [floor] @param {{ heel: number, tip: number }} [foot]
   */
  constructor(boneMap, restOffsets, basis = BASES.gltf, floor = NaN, foot = FOOT) {
    const { rig, bones } = boneMap;
    this.basis = basis;
    /** Node of each bone, -1 for those that the character lacks. */
    this.nodes = Int32Array.from(BONES, (bone) => bones.get(bone) ?? -1);
    /** Numbers of the bones that it has, parents first. */
    this.mapped = Int32Array.from([...bones.keys()], (bone) => BONES.indexOf(bone));
    /** In the world, x, y, z, w and x, y, z a bone. */
    this.rotations = new Float64Array(4 * COUNT);
    this.places = new Float64Array(3 * COUNT);
    /** Relative to the nodes' parents. */
    this.local = new Float64Array(4 * COUNT);
    /** Place of the hips' node relative to its parent. */
    this.hips = new Float64Array(3);

    this.above = new Int32Array(COUNT).fill(-1);
    const boneOf = new Map([...this.mapped].map((b) => [this.nodes[b], b]));
    for (const b of this.mapped) {
      const node = rig.ancestors(this.nodes[b]).find((n) => boneOf.has(n));
      if (node !== undefined) this.above[b] = /** @type {number} */ (boneOf.get(node));
    }
    this.offsets = Float64Array.from({ length: 3 * COUNT }, (_, k) => restOffsets[k]);
    if (this.offsets.some(Number.isNaN)) throw new Error(`rest offsets of ${COUNT} bones are needed`);
    const turn = this.#alignment(rig);
    const rest = perBone((b) => product(turn, rig.rotation(this.nodes[b])), this.mapped);
    const place = perBone((b) => turned(turn, rig.place(this.nodes[b])), this.mapped);
    const correct = this.#corrections(place);
    this.rest = new Float64Array(4 * COUNT); // of each bone in the T-pose
    this.offset = new Float64Array(3 * COUNT); // of each bone, in the axes of the one above
    this.gap = new Float64Array(4 * COUNT); // rest rotation of the node's parent, in the axes of the bone above
    for (const b of this.mapped) {
      multiply(correct[b], 0, rest[b], 0, this.rest, 4 * b);
      const a = this.above[b];
      if (a < 0) continue;
      rotateBack(rest[a], 0, minus(place[b], place[a]), 0, this.offset, 3 * b);
      relative(rig.rotation(this.nodes[a]), 0, rig.rotation(rig.nodes[this.nodes[b]].parent), 0, this.gap, 4 * b);
    }
    const parent = rig.nodes[this.nodes[0]].parent;
    this.base = {
      turn: rig.rotation(parent),
      place: parent < 0 ? new Float64Array(3) : rig.place(parent),
      scale: parent < 0 ? Float64Array.of(1, 1, 1) : rig.scales.slice(3 * parent, 3 * parent + 3),
    };
    /** Hips' height of the character by that of the agent. */
    this.ratio = 1;
    this.soles = [new Float64Array(9), new Float64Array(9)]; // of a foot that stands: heel, ball, tip
    this.sourceSoles = [new Float64Array(9), new Float64Array(9)];
    this.stance = [new Float64Array(3), new Float64Array(3)];
    this.#legs(place, correct, floor, foot);
    this.turns = new Float64Array(4 * COUNT); // of the agent, in the world
    this.source = new Float64Array(3 * COUNT);
    this.scratch = new Float64Array(CLEAR + 2);
  }

  /** The rotation from the character's axes to the basis, by where hips and legs are. @param {import("./rig.js").Rig} rig */
  #alignment(rig) {
    const at = (/** @type {number} */ b) => rig.place(this.nodes[b]);
    const ankles = LEGS.map((leg) => at(leg[2]));
    const up = snapped(at(0).map((value, n) => value - (ankles[0][n] + ankles[1][n]) / 2));
    const across = minus(at(LEGS[0][0]), at(LEGS[1][0]));
    const level = (/** @type {Float64Array} */ v) => v.map((value, n) => value - dot(v, up) * up[n]);
    const aside = level(snapped(level(across)));
    const left = aside.map((value) => value / Math.hypot(...aside));
    const { basis } = this;
    const forward = cross(left, up).map((value) => basis.handed * value);
    return between([left, up, forward], [basis.left, basis.up, basis.forward]);
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

  /** @param {Float64Array[]} place @param {Float64Array[]} correct @param {number} floor @param {typeof FOOT} foot */
  #legs(place, correct, floor, foot) {
    const { up } = this.basis;
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
    const below = (/** @type {Float64Array[]} */ at) => LEGS.reduce((sum, leg) => sum + dot(minus(at[0], at[leg[2]]), up), 0);
    const legs = below(stand);
    const scale = legs / below(source);
    const feet = LEGS.flatMap((leg) => leg.slice(2));
    if (Number.isNaN(floor)) {
      const lowest = Math.min(...feet.filter((b) => place[b]).map((b) => dot(place[b], up)));
      floor = 0;
      if (!(lowest >= 0 && lowest <= 0.25 * (dot(place[0], up) - lowest))) {
        floor = lowest - scale * Math.min(...feet.map((b) => dot(source[b], up)));
      }
    }
    let high = 0;
    LEGS.forEach(([, , ankle, toe], leg) => {
      const ball = minus(source[toe], source[ankle]);
      this.#sole(ball, dot(source[ankle], up), FOOT, this.sourceSoles[leg]);
      // without toes, where a foot of this size would have them
      const own = place[toe] ? turned(correct[ankle], minus(place[toe], place[ankle])) : ball.map((value) => scale * value);
      const height = dot(place[ankle], up) - floor;
      high += height / LEGS.length;
      this.#sole(own, height, foot, this.soles[leg]);
      const beside = minus(minus(plus(stand[ankle], own), stand[0]), minus(source[toe], source[0]));
      this.stance[leg].set(this.#level(beside));
    });
    this.ratio = (legs / LEGS.length + high) / dot(source[0], up);
  }

  /** Of a foot that stands: heel and ball from the ankle, tip of the toes from the ball. @param {Float64Array} ball @param {number} height @param {typeof FOOT} foot @param {Float64Array} out */
  #sole(ball, height, foot, out) {
    const ahead = this.#level(ball);
    const { up } = this.basis;
    for (let n = 0; n < 3; n += 1) {
      out[n] = -height * up[n] - foot.heel * ahead[n];
      out[3 + n] = -height * up[n] + ahead[n];
      out[6 + n] = foot.tip * ahead[n];
    }
  }

  /**
   * A frame of the stream (hips x, y, z, then x, y, z, w of the 22 bones and any more) on the character: fills
   * `rotations`, `places`, `local` and `hips`. `ground`: height of the ground there; NaN: that of the lower sole.
   * @param {ArrayLike<number>} frame @param {number} [ground]
   */
  pose(frame, ground = NaN) {
    this.scratch[GROUND] = ground; // boxed, were it passed on
    this.#pose(frame);
  }

  /** @param {ArrayLike<number>} frame */
  #pose(frame) {
    const { mapped, rotations, places, turns, source, scratch: s } = this;
    const { up } = this.basis;
    this.#agent(frame);
    for (let leg = 0; leg < 2; leg += 1) {
      const ankle = 3 * LEGS[leg][2];
      this.#lowest(this.sourceSoles[leg], leg);
      s[CLEAR + leg] = s[LOW] + source[ankle] * up[0] + source[ankle + 1] * up[1] + source[ankle + 2] * up[2];
    }
    if (s[GROUND] !== s[GROUND]) s[GROUND] = Math.min(s[CLEAR], s[CLEAR + 1]);
    for (let n = 0; n < mapped.length; n += 1) {
      const b = 4 * mapped[n];
      multiply(turns, b, this.rest, b, rotations, b);
    }
    const high = source[0] * up[0] + source[1] * up[1] + source[2] * up[2];
    const lift = s[GROUND] + (high - s[GROUND]) * this.ratio - high;
    for (let n = 0; n < 3; n += 1) places[n] = source[n] + lift * up[n];
    this.#put();
    for (let leg = 0; leg < 2; leg += 1) {
      s[SOLE] = s[GROUND] + (s[CLEAR + leg] - s[GROUND]) * this.ratio;
      this.#step(leg);
    }
    this.#put();
    this.#relate();
  }

  /** Rotations and places of the agent's bones in the world. @param {ArrayLike<number>} frame */
  #agent(frame) {
    const { turns, source, offsets } = this;
    for (let n = 0; n < 3; n += 1) source[n] = frame[n];
    for (let b = 0; b < COUNT; b += 1) {
      const from = 3 + 4 * b, to = 4 * b, parent = PARENTS[b];
      const length = Math.sqrt(frame[from] ** 2 + frame[from + 1] ** 2 + frame[from + 2] ** 2 + frame[from + 3] ** 2);
      for (let n = 0; n < 4; n += 1) turns[to + n] = frame[from + n] / length;
      if (parent < 0) continue;
      multiply(turns, 4 * parent, turns, to, turns, to);
      rotate(turns, 4 * parent, offsets, 3 * b, source, 3 * b);
      for (let n = 0; n < 3; n += 1) source[3 * b + n] += source[3 * parent + n];
    }
  }

  /** LOW: height of the lowest point of a foot over its ankle; BALL: the ball from the ankle. @param {Float64Array} sole @param {number} leg */
  #lowest(sole, leg) {
    const { turns, scratch: s } = this;
    const { up } = this.basis;
    const ankle = 4 * LEGS[leg][2], toe = 4 * LEGS[leg][3];
    rotate(turns, ankle, sole, 0, s, FROM);
    rotate(turns, ankle, sole, 3, s, BALL);
    rotate(turns, toe, sole, 6, s, TO);
    const heel = s[FROM] * up[0] + s[FROM + 1] * up[1] + s[FROM + 2] * up[2];
    const ball = s[BALL] * up[0] + s[BALL + 1] * up[1] + s[BALL + 2] * up[2];
    const tip = ball + s[TO] * up[0] + s[TO + 1] * up[1] + s[TO + 2] * up[2];
    s[LOW] = Math.min(heel, ball, tip);
  }

  /** Places of the bones below the hips. */
  #put() {
    const { mapped, above, rotations, places, offset } = this;
    for (let n = 1; n < mapped.length; n += 1) {
      const b = mapped[n], a = above[b];
      rotate(rotations, 4 * a, offset, 3 * b, places, 3 * b);
      for (let k = 0; k < 3; k += 1) places[3 * b + k] += places[3 * a + k];
    }
  }

  /** Put a foot where the agent's is: ball over the same point, the sole at SOLE. @param {number} leg */
  #step(leg) {
    const { turns, source, rotations, places, scratch: s } = this;
    const { up, forward } = this.basis;
    const hip = LEGS[leg][0], knee = LEGS[leg][1], ankle = LEGS[leg][2];
    rotate(turns, 4 * ankle, forward, 0, s, AHEAD);
    flatten(s, AHEAD, up);
    size(s, AHEAD, LENGTH);
    if (s[LENGTH] < 0.1) { // it points straight down
      rotate(turns, 0, forward, 0, s, AHEAD);
      flatten(s, AHEAD, up);
    }
    arc(forward, 0, s, AHEAD, s, TURN);
    rotate(s, TURN, this.stance[leg], 0, s, BESIDE);
    rotate(turns, 4 * ankle, this.sourceSoles[leg], 3, s, GOAL);
    this.#lowest(this.soles[leg], leg);
    for (let n = 0; n < 3; n += 1) s[GOAL + n] += source[3 * ankle + n] + s[BESIDE + n] - s[BALL + n];
    flatten(s, GOAL, up);
    for (let n = 0; n < 3; n += 1) s[GOAL + n] += (s[SOLE] - s[LOW]) * up[n];

    const start = 3 * hip, bend = 3 * knee, end = 3 * ankle;
    gap(places, bend, places, start, s, LENGTH);
    const thigh = s[LENGTH];
    gap(places, end, places, bend, s, LENGTH);
    const shin = s[LENGTH];
    s[MOST] = REACH * (thigh + shin);
    s[LEAST] = 1.001 * Math.abs(thigh - shin);
    this.#within(start);
    gap(s, GOAL, places, start, s, LENGTH);
    const far = s[LENGTH];
    for (let n = 0; n < 3; n += 1) {
      s[ALONG + n] = (s[GOAL + n] - places[start + n]) / far;
      s[SIDE + n] = places[bend + n] - places[start + n];
    }
    without(s, SIDE, s, ALONG);
    rotate(turns, 4 * hip, forward, 0, s, FRONT);
    without(s, FRONT, s, ALONG);
    size(s, SIDE, LENGTH);
    size(s, FRONT, MOST);
    const lacking = Math.max(0, BEND * thigh - s[LENGTH]) / Math.max(s[MOST], 1e-6);
    for (let n = 0; n < 3; n += 1) s[SIDE + n] += lacking * s[FRONT + n];
    size(s, SIDE, LENGTH);
    const wide = Math.max(s[LENGTH], 1e-9);
    const reach = (thigh * thigh + far * far - shin * shin) / (2 * far);
    const out = Math.sqrt(Math.max(0, thigh * thigh - reach * reach)) / wide;
    for (let n = 0; n < 3; n += 1) {
      s[FROM + n] = places[bend + n] - places[start + n];
      s[TO + n] = reach * s[ALONG + n] + out * s[SIDE + n]; // the knee from the hip
      s[MORE + n] = places[end + n] - places[bend + n];
      s[GOAL + n] -= places[start + n] + s[TO + n]; // the foot from the knee
    }
    arc(s, FROM, s, TO, s, TURN);
    multiply(s, TURN, rotations, 4 * hip, rotations, 4 * hip);
    arc(s, MORE, s, GOAL, s, TURN);
    multiply(s, TURN, rotations, 4 * knee, rotations, 4 * knee);
  }

  /** Bring the goal to where the leg reaches: at its height, if it can, nearer to the hip: MOST or LEAST. @param {number} start */
  #within(start) {
    const { places, scratch: s } = this;
    const { up } = this.basis;
    for (let n = 0; n < 3; n += 1) s[SIDE + n] = s[GOAL + n] - places[start + n];
    const most = s[MOST];
    let down = s[SIDE] * up[0] + s[SIDE + 1] * up[1] + s[SIDE + 2] * up[2];
    flatten(s, SIDE, up);
    size(s, SIDE, LENGTH);
    const wide = s[LENGTH];
    const far = Math.sqrt(down * down + wide * wide);
    let share = 1;
    if (far > most) {
      down = Math.max(-most, Math.min(most, down));
      share = Math.sqrt(most * most - down * down) / Math.max(wide, 1e-9);
    } else if (far < s[LEAST]) {
      down = -s[LEAST];
      share = 0;
    } else {
      return;
    }
    for (let n = 0; n < 3; n += 1) s[GOAL + n] = places[start + n] + share * s[SIDE + n] + down * up[n];
  }

  /** Rotations relative to the nodes' parents. */
  #relate() {
    const { mapped, above, rotations, places, local, hips, base, scratch: s } = this;
    relative(base.turn, 0, rotations, 0, local, 0);
    for (let n = 1; n < mapped.length; n += 1) {
      const b = 4 * mapped[n];
      multiply(rotations, 4 * above[mapped[n]], this.gap, b, s, TURN);
      relative(s, TURN, rotations, b, local, b);
    }
    for (let n = 0; n < 3; n += 1) s[FROM + n] = places[n] - base.place[n];
    rotateBack(base.turn, 0, s, FROM, hips, 0);
    for (let n = 0; n < 3; n += 1) hips[n] /= base.scale[n];
  }
}

/** Take out of a vector what lies along `up`. @param {Float64Array} s @param {number} at @param {Float64Array} up */
function flatten(s, at, up) {
  const high = s[at] * up[0] + s[at + 1] * up[1] + s[at + 2] * up[2];
  for (let n = 0; n < 3; n += 1) s[at + n] -= high * up[n];
}

/** Take out of a vector what lies along a unit vector. @param {Float64Array} s @param {number} at @param {Float64Array} t @param {number} j */
function without(s, at, t, j) {
  const along = s[at] * t[j] + s[at + 1] * t[j + 1] + s[at + 2] * t[j + 2];
  for (let n = 0; n < 3; n += 1) s[at + n] -= along * t[j + n];
}

/** s[out] = length of a vector. @param {Float64Array} s @param {number} at @param {number} out */
function size(s, at, out) {
  s[out] = Math.sqrt(s[at] * s[at] + s[at + 1] * s[at + 1] + s[at + 2] * s[at + 2]);
}

/**
 * out = distance of two places.
 * @param {Float64Array} a @param {number} i @param {Float64Array} b @param {number} j
 * @param {Float64Array} out @param {number} k
 */
function gap(a, i, b, j, out, k) {
  const x = a[i] - b[j], y = a[i + 1] - b[j + 1], z = a[i + 2] - b[j + 2];
  out[k] = Math.sqrt(x * x + y * y + z * z);
}

// ---- what only the constructor needs

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
