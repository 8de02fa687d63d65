// A stream's poses on a character of any skeleton: clients/README.md, "Retargeting". Nothing here knows the axes of
// the character's bones: its T-pose follows from the places of its joints. `pose` allocates nothing.

import { BASES } from "./bases.js";
import { arc, multiply, relative, rotate, rotateBack } from "./quaternions.js";
import { COUNT, LEGS, Rest } from "./retarget_rest.js";
import { PARENTS } from "./rig.js";

const REACH = 0.999; // of a leg's length: how far it is stretched at most
const SINKS = 0.018; // of a leg's length: how far hips sink at most for a standing foot to reach its print
// heights of a sole over the ground by the leg's length: hips sink and a heel rises by all that a foot lacks while it is
// below the first, by nothing when it is above the second
const STANDS = 0.02, LEAVES = 0.06;
const TIPTOE = 0.25; // radians: how far a heel rises at most for a foot to reach its print
const FLEX = 0.5; // radians: how far toes turn up at most where a shoe is longer than the agent's foot
const BEND = 0.1; // of the thigh's length: a knee that bends less than this bends forwards

// places in the scratch array of vectors
const AHEAD = 0, BESIDE = 3, GOALS = 6, ALONG = 12, SIDE = 15, FRONT = 18, FROM = 21, TO = 24, BALL = 27, TURN = 30, MORE = 34;
const GROUND = 37, LOW = 38, SOLE = 39, MOST = 40, LEAST = 41, LENGTH = 42, SUNK = 43, REACHES = 44, STAYS = 46; // and of numbers
// (returned numbers would be boxed; GOALS, REACHES and STAYS have one per leg)

/** Turns frames of an agent into poses of a character. */
export class Retarget {
  #rest;

  /**
   * `restOffsets` of the agent, three numbers a bone; `floor`: height of the character's soles at rest; `soles`:
   * found in its mesh (`measureSoles`). All in the stream's basis and unit, as is the character's own space.
   * @param {import("./bone_map.js").BoneMap} boneMap @param {ArrayLike<number>} restOffsets
   * @param {import("./bases.js").Basis} [basis] @param {number} [floor] @param {import("./soles.js").Soles | null} [soles]
   */
  constructor(boneMap, restOffsets, basis = BASES.gltf, floor = NaN, soles = null) {
    const rest = new Rest(boneMap, restOffsets, basis, floor, soles);
    this.#rest = rest;
    this.basis = basis;
    /** Node of each bone, -1 if the character lacks it. */
    this.nodes = rest.nodes;
    /** Numbers of the bones that it has, parents first. */
    this.mapped = rest.mapped;
    /** Height of the character's thigh joints by that of the agent's. */
    this.ratio = rest.ratio;
    /** In the world, x, y, z, w and x, y, z a bone. */
    this.rotations = new Float64Array(4 * COUNT);
    this.places = new Float64Array(3 * COUNT);
    /** Relative to the nodes' parents. */
    this.local = new Float64Array(4 * COUNT);
    /** Bones whose nodes must be moved, too: the hips, and bones that hang from another bone than they follow. */
    this.loose = rest.loose;
    /** The bone that each one's node hangs from in the file; -1: none. */
    this.hangs = rest.hangs;
    /** Places of the loose bones' nodes relative to their parents, x, y, z a bone. */
    this.moved = new Float64Array(3 * COUNT);
    /** Place of the hips' node relative to its parent. */
    this.hips = this.moved.subarray(0, 3);
    /** The rotation from the character's axes to the basis, and the point of the ground below it at rest. */
    this.turn = rest.turn;
    this.origin = rest.origin;
    /** The agent in the world: rotations, places, heights of the two soles. */
    this.turns = new Float64Array(4 * COUNT);
    this.source = new Float64Array(3 * COUNT);
    this.clear = new Float64Array(2);
    this.scratch = new Float64Array(STAYS + 2);
    /** Height of the ground below the last pose, in an array of one. */
    this.ground = this.scratch.subarray(GROUND, GROUND + 1);
  }

  /**
   * A frame of the stream (hips x, y, z, then x, y, z, w of the 22 bones and any more) on the character: fills
   * `rotations`, `places`, `local`, `moved` and `hips`. `ground`: height of the ground there; NaN: that of the lower sole.
   * @param {ArrayLike<number>} frame @param {number} [ground]
   */
  pose(frame, ground = NaN) {
    this.scratch[GROUND] = ground; // boxed, were it passed on
    this.#pose(frame);
  }

  /** @param {ArrayLike<number>} frame */
  #pose(frame) {
    const { mapped, rotations, places, turns, source, clear, ratio, scratch: s } = this;
    const { turns: rest, thighs, sourceSoles } = this.#rest;
    const { up } = this.basis;
    this.#agent(frame);
    for (let leg = 0; leg < 2; leg += 1) {
      const ankle = 3 * LEGS[leg][2];
      this.#lowest(sourceSoles[leg], leg);
      clear[leg] = s[LOW] + source[ankle] * up[0] + source[ankle + 1] * up[1] + source[ankle + 2] * up[2];
      this.#flex(leg);
    }
    if (s[GROUND] !== s[GROUND]) s[GROUND] = Math.min(clear[0], clear[1]);
    for (let n = 0; n < mapped.length; n += 1) {
      const b = 4 * mapped[n];
      multiply(turns, b, rest, b, rotations, b);
    }
    const left = 3 * LEGS[0][0], right = 3 * LEGS[1][0];
    for (let n = 0; n < 3; n += 1) s[FROM + n] = (source[left + n] + source[right + n]) / 2;
    const high = s[FROM] * up[0] + s[FROM + 1] * up[1] + s[FROM + 2] * up[2];
    const lift = s[GROUND] + (high - s[GROUND]) * ratio - high;
    rotate(rotations, 0, thighs, 0, s, TO);
    for (let n = 0; n < 3; n += 1) places[n] = s[FROM + n] + lift * up[n] - s[TO + n];
    this.#put();
    s[SUNK] = 0;
    for (let leg = 0; leg < 2; leg += 1) {
      s[SOLE] = Math.max(0, clear[leg] - s[GROUND]) * ratio;
      const lifted = s[SOLE] / this.#rest.lengths[leg];
      s[STAYS + leg] = Math.min(1, Math.max(0, (LEAVES - lifted) / (LEAVES - STANDS))); // 1 on the ground, 0 off it
      this.#goal(leg);
      this.#reach(leg);
      this.#sink(leg);
    }
    for (let n = 0; n < mapped.length; n += 1) {
      const b = 3 * mapped[n];
      for (let k = 0; k < 3; k += 1) places[b + k] -= s[SUNK] * up[k];
    }
    for (let leg = 0; leg < 2; leg += 1) {
      this.#raise(leg);
      this.#bend(leg);
    }
    this.#put();
    this.#relate();
  }

  /** Rotations and places of the agent's bones in the world. @param {ArrayLike<number>} frame */
  #agent(frame) {
    const { turns, source } = this;
    const { offsets } = this.#rest;
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

  /**
   * LOW: height of the lowest point of a foot over its ankle; BALL: the ball from the ankle.
   * @param {import("./retarget_rest.js").Sole} sole @param {number} leg
   */
  #lowest(sole, leg) {
    const { turns, scratch: s } = this;
    const { up } = this.basis;
    const { fixed, toes } = sole;
    const ankle = 4 * LEGS[leg][2], toe = 4 * LEGS[leg][3];
    rotate(turns, ankle, sole.ball, 0, s, BALL);
    rotate(turns, ankle, sole.joint, 0, s, FROM);
    const joint = s[FROM] * up[0] + s[FROM + 1] * up[1] + s[FROM + 2] * up[2];
    rotateBack(turns, ankle, up, 0, s, FROM);
    let low = Infinity;
    for (let k = 0; k < fixed.length; k += 3) low = Math.min(low, s[FROM] * fixed[k] + s[FROM + 1] * fixed[k + 1] + s[FROM + 2] * fixed[k + 2]);
    rotateBack(turns, toe, up, 0, s, FROM);
    for (let k = 0; k < toes.length; k += 3) low = Math.min(low, joint + s[FROM] * toes[k] + s[FROM + 1] * toes[k + 1] + s[FROM + 2] * toes[k + 2]);
    s[LOW] = low;
  }

  /** Places of the bones below the hips. */
  #put() {
    const { mapped, rotations, places } = this;
    const { above, offset } = this.#rest;
    for (let n = 1; n < mapped.length; n += 1) {
      const b = mapped[n], a = above[b];
      rotate(rotations, 4 * a, offset, 3 * b, places, 3 * b);
      for (let k = 0; k < 3; k += 1) places[3 * b + k] += places[3 * a + k];
    }
  }

  /**
   * GOALS: where the ankle goes: the ball over the same point as the agent's, the sole at SOLE over the ground.
   * @param {number} leg
   */
  #goal(leg) {
    const { turns, source, scratch: s } = this;
    const { soles, sourceSoles, stance } = this.#rest;
    const { up, forward } = this.basis;
    const ankle = LEGS[leg][2], goal = GOALS + 3 * leg;
    rotate(turns, 4 * ankle, forward, 0, s, AHEAD);
    flatten(s, AHEAD, up);
    size(s, AHEAD, LENGTH);
    if (s[LENGTH] < 0.1) { // it points straight down
      rotate(turns, 0, forward, 0, s, AHEAD);
      flatten(s, AHEAD, up);
    }
    arc(forward, 0, s, AHEAD, s, TURN);
    rotate(s, TURN, stance[leg], 0, s, BESIDE);
    rotate(turns, 4 * ankle, sourceSoles[leg].ball, 0, s, goal);
    this.#lowest(soles[leg], leg);
    for (let n = 0; n < 3; n += 1) s[goal + n] += source[3 * ankle + n] + s[BESIDE + n] - s[BALL + n];
    flatten(s, goal, up);
    for (let n = 0; n < 3; n += 1) s[goal + n] += (s[GROUND] + s[SOLE] - s[LOW]) * up[n];
  }

  /**
   * Turns up the toes of a long shoe, so that the ankle is as high over where it stands as the agent's, scaled.
   * LOW: the agent's lowest point from its ankle.
   * @param {number} leg
   */
  #flex(leg) {
    const { nodes, turns, ratio, scratch: s } = this;
    const { soles, sourceSoles, tips } = this.#rest;
    const { up, left, handed } = this.basis;
    const ankle = 4 * LEGS[leg][2], toe = 4 * LEGS[leg][3];
    rotate(turns, ankle, left, 0, s, AHEAD); // the axis
    flatten(s, AHEAD, up);
    size(s, AHEAD, LENGTH);
    if (nodes[LEGS[leg][3]] < 0 || !soles[leg].toes.length || s[LENGTH] < 0.1) return;
    const { ball } = soles[leg], source = sourceSoles[leg].ball;
    rotate(turns, ankle, soles[leg].joint, 0, s, FROM);
    rotate(turns, toe, tips[leg], 0, s, TO);
    let deep = ratio * s[LOW], high = 0;
    for (let n = 0; n < 3; n += 1) {
      deep -= (ratio * source[n] - ball[n] + s[FROM + n]) * up[n];
      high += s[TO + n] * up[n];
      s[AHEAD + n] /= -handed * s[LENGTH];
    }
    const rises = (s[AHEAD + 1] * s[TO + 2] - s[AHEAD + 2] * s[TO + 1]) * up[0]
      + (s[AHEAD + 2] * s[TO] - s[AHEAD] * s[TO + 2]) * up[1]
      + (s[AHEAD] * s[TO + 1] - s[AHEAD + 1] * s[TO]) * up[2];
    const share = Math.min(0, deep) / Math.max(Math.sqrt(high * high + rises * rises), 1e-9);
    const angle = Math.asin(Math.max(-1, share)) - Math.atan2(high, rises);
    const half = Math.min(FLEX, Math.max(0, angle)) / 2, sine = Math.sin(half);
    for (let n = 0; n < 3; n += 1) s[TURN + n] = sine * s[AHEAD + n];
    s[TURN + 3] = Math.cos(half);
    multiply(s, TURN, turns, toe, turns, toe);
  }

  /**
   * REACHES: how far an ankle may be from its thigh joint: as straight as the agent's leg is, and from there smoothly
   * less of what the goal asks for.
   * @param {number} leg
   */
  #reach(leg) {
    const { source, places, scratch: s } = this;
    const { lengths, sourceLengths } = this.#rest;
    const start = 3 * LEGS[leg][0], length = lengths[leg];
    gap(source, 3 * LEGS[leg][2], source, start, s, LENGTH);
    gap(s, GOALS + 3 * leg, places, start, s, MOST);
    const agents = s[LENGTH] / sourceLengths[leg], over = s[MOST] / length - agents;
    const room = Math.max(REACH - agents, 1e-6);
    s[REACHES + leg] = length * Math.min(REACH, agents + room * (1 - Math.exp(-Math.max(0, over) / room)));
  }

  /** SUNK: how far the hips must sink for a foot to reach its print, at least. @param {number} leg */
  #sink(leg) {
    const { places, scratch: s } = this;
    const { up } = this.basis;
    const start = 3 * LEGS[leg][0], length = this.#rest.lengths[leg], most = s[REACHES + leg];
    for (let n = 0; n < 3; n += 1) s[SIDE + n] = places[start + n] - s[GOALS + 3 * leg + n];
    const down = s[SIDE] * up[0] + s[SIDE + 1] * up[1] + s[SIDE + 2] * up[2];
    flatten(s, SIDE, up);
    const away = s[SIDE] * s[SIDE] + s[SIDE + 1] * s[SIDE + 1] + s[SIDE + 2] * s[SIDE + 2];
    const lacks = Math.max(0, down - Math.sqrt(Math.max(0, most * most - away)));
    s[SUNK] = Math.max(s[SUNK], Math.min(SINKS * length, lacks * s[STAYS + leg]));
  }

  /**
   * Lift the heel so far that the leg reaches its goal: the foot turns about its ball, as far as the ball bears it.
   * @param {number} leg
   */
  #raise(leg) {
    const { turns, rotations, places, scratch: s } = this;
    const { up, left } = this.basis;
    const sole = this.#rest.soles[leg];
    const ankle = LEGS[leg][2], goal = GOALS + 3 * leg, start = 3 * LEGS[leg][0], most = s[REACHES + leg];
    rotate(turns, 4 * ankle, sole.heel, 0, s, FROM);
    rotate(turns, 4 * ankle, sole.ball, 0, s, BALL);
    rotate(turns, 4 * ankle, left, 0, s, AHEAD); // the axis
    flatten(s, AHEAD, up);
    size(s, AHEAD, LENGTH);
    for (let n = 0; n < 3; n += 1) s[AHEAD + n] /= s[LENGTH];
    s[SIDE] = s[BALL + 1] * s[AHEAD + 2] - s[BALL + 2] * s[AHEAD + 1]; // which way the ankle goes
    s[SIDE + 1] = s[BALL + 2] * s[AHEAD] - s[BALL] * s[AHEAD + 2];
    s[SIDE + 2] = s[BALL] * s[AHEAD + 1] - s[BALL + 1] * s[AHEAD];
    const sign = s[SIDE] * up[0] + s[SIDE + 1] * up[1] + s[SIDE + 2] * up[2] < 0 ? -1 : 1;
    const along = s[AHEAD] * s[BALL] + s[AHEAD + 1] * s[BALL + 1] + s[AHEAD + 2] * s[BALL + 2];
    let near = 0, ahead = 0, beside = 0, square = 0, over = 0;
    for (let n = 0; n < 3; n += 1) {
      const ball = s[BALL + n], aside = along * s[AHEAD + n];
      const thigh = places[start + n] - s[goal + n] - ball; // from the ball
      near += thigh * (aside - ball);
      ahead += sign * thigh * s[SIDE + n];
      beside += thigh * aside;
      square += thigh * thigh + ball * ball;
      over += (ball - s[FROM + n]) * up[n];
    }
    const wanted = (square - most * most) / 2 + beside;
    const share = wanted / Math.max(Math.sqrt(near * near + ahead * ahead), 1e-9);
    const lacking = Math.atan2(ahead, near) - Math.acos(Math.min(1, Math.max(-1, share)));
    const bears = Math.min(1, Math.max(0, 1 - over / (STANDS * this.#rest.lengths[leg])));
    const half = (s[STAYS + leg] * bears * Math.min(TIPTOE, Math.max(0, lacking))) / 2, sine = sign * Math.sin(half);
    for (let n = 0; n < 3; n += 1) s[TURN + n] = sine * s[AHEAD + n];
    s[TURN + 3] = Math.cos(half);
    multiply(s, TURN, rotations, 4 * ankle, rotations, 4 * ankle);
    rotate(s, TURN, s, BALL, s, TO);
    for (let n = 0; n < 3; n += 1) s[goal + n] += s[BALL + n] - s[TO + n];
  }

  /** Turns thigh and shin so that the ankle is at its goal, or as near as the leg reaches. @param {number} leg */
  #bend(leg) {
    const { turns, rotations, places, scratch: s } = this;
    const { forward } = this.basis;
    const hip = LEGS[leg][0], knee = LEGS[leg][1], ankle = LEGS[leg][2], goal = GOALS + 3 * leg;
    const start = 3 * hip, bend = 3 * knee, end = 3 * ankle;
    gap(places, bend, places, start, s, LENGTH);
    const thigh = s[LENGTH];
    gap(places, end, places, bend, s, LENGTH);
    const shin = s[LENGTH];
    s[MOST] = s[REACHES + leg];
    s[LEAST] = 1.001 * Math.abs(thigh - shin);
    this.#within(start, goal);
    gap(s, goal, places, start, s, LENGTH);
    const far = s[LENGTH];
    for (let n = 0; n < 3; n += 1) {
      s[ALONG + n] = (s[goal + n] - places[start + n]) / far;
      s[SIDE + n] = places[bend + n] - places[start + n];
    }
    without(s, SIDE, s, ALONG);
    rotate(turns, 4 * hip, forward, 0, s, FRONT);
    without(s, FRONT, s, ALONG);
    size(s, FRONT, MOST);
    const inFront = 1 / Math.max(s[MOST], 1e-6);
    for (let n = 0; n < 3; n += 1) s[FRONT + n] *= inFront;
    const bent = s[SIDE] * s[FRONT] + s[SIDE + 1] * s[FRONT + 1] + s[SIDE + 2] * s[FRONT + 2];
    const lacking = Math.max(0, BEND * thigh - bent);
    for (let n = 0; n < 3; n += 1) s[SIDE + n] += lacking * s[FRONT + n];
    size(s, SIDE, LENGTH);
    const wide = Math.max(s[LENGTH], 1e-9);
    const reach = (thigh * thigh + far * far - shin * shin) / (2 * far);
    const out = Math.sqrt(Math.max(0, thigh * thigh - reach * reach)) / wide;
    for (let n = 0; n < 3; n += 1) {
      s[FROM + n] = places[bend + n] - places[start + n];
      s[TO + n] = reach * s[ALONG + n] + out * s[SIDE + n]; // the knee from the hip
      s[MORE + n] = places[end + n] - places[bend + n];
      s[goal + n] -= places[start + n] + s[TO + n]; // the foot from the knee
    }
    arc(s, FROM, s, TO, s, TURN);
    multiply(s, TURN, rotations, 4 * hip, rotations, 4 * hip);
    arc(s, MORE, s, goal, s, TURN);
    multiply(s, TURN, rotations, 4 * knee, rotations, 4 * knee);
  }

  /** Brings a goal to where the leg reaches: at its height, if it can, nearer to the hip: MOST or LEAST. @param {number} start @param {number} goal */
  #within(start, goal) {
    const { places, scratch: s } = this;
    const { up } = this.basis;
    for (let n = 0; n < 3; n += 1) s[SIDE + n] = s[goal + n] - places[start + n];
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
    for (let n = 0; n < 3; n += 1) s[goal + n] = places[start + n] + share * s[SIDE + n] + down * up[n];
  }

  /** Rotations relative to the nodes' parents, and places of loose bones. */
  #relate() {
    const { mapped, loose, hangs, rotations, places, local, moved, scratch: s } = this;
    const { parentTurn, parentPlace, parentScale } = this.#rest;
    for (let n = 0; n < mapped.length; n += 1) {
      const b = 4 * mapped[n], a = hangs[mapped[n]];
      if (a < 0) {
        relative(parentTurn, b, rotations, b, local, b);
        continue;
      }
      multiply(rotations, 4 * a, parentTurn, b, s, TURN);
      relative(s, TURN, rotations, b, local, b);
    }
    for (let n = 0; n < loose.length; n += 1) {
      const bone = loose[n], b = 3 * bone, a = hangs[bone];
      for (let k = 0; k < 3; k += 1) s[TO + k] = parentPlace[b + k];
      if (a >= 0) {
        rotate(rotations, 4 * a, parentPlace, b, s, TO);
        for (let k = 0; k < 3; k += 1) s[TO + k] += places[3 * a + k];
        multiply(rotations, 4 * a, parentTurn, 4 * bone, s, TURN);
      } else {
        for (let k = 0; k < 4; k += 1) s[TURN + k] = parentTurn[4 * bone + k];
      }
      for (let k = 0; k < 3; k += 1) s[FROM + k] = places[b + k] - s[TO + k];
      rotateBack(s, TURN, s, FROM, moved, b);
      for (let k = 0; k < 3; k += 1) moved[b + k] /= parentScale[b + k];
    }
  }
}

/** Takes out of a vector what lies along `up`. @param {Float64Array} s @param {number} at @param {Float64Array} up */
function flatten(s, at, up) {
  const high = s[at] * up[0] + s[at + 1] * up[1] + s[at + 2] * up[2];
  for (let n = 0; n < 3; n += 1) s[at + n] -= high * up[n];
}

/** Takes out of a vector what lies along a unit vector. @param {Float64Array} s @param {number} at @param {Float64Array} t @param {number} j */
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
