// Feet that bear weight stay where they are, in what is shown. The server's world/output/footlock.py, for one person:
// what its rules are for is told there. World: metres, Z up, 40 frames per second.

import { FRAMES, FREE, LegPose, SOLES, moveFeet } from "./legs.js";
import { bounded } from "./steering.js";

const FPS = 40, DEGREE = Math.PI / 180;
const TOUCH_HEIGHT = 0.03, TOUCH_SPEED = 0.4, LIFT_HEIGHT = 0.05, LIFT_SPEED = 0.7, TOLD_HEIGHT = 0.02;
const RISE = 1 / 3;
const SLIPPING = [0.25, LIFT_SPEED], LEASH = [0.07, 0.1];
const FADE = 1 / (0.15 * FPS);
const SETTLE = 0.25, DROP = 0.02;
const STEP_FRAMES = 12, STEP_HEIGHT = 0.05, FLIGHT = [0.15, 0.85];
const STEP_SHIFT = 0.05, STEP_TURN = 24 * DEGREE, STEP_AHEAD = 0.15, AHEAD_SHIFT = 0.1, AHEAD_TURN = 20 * DEGREE;
const AIM = 0.2, TIDY = 0.8, PATIENT = 1.6, LEADING = 0.25, APART = 0.11, RESTING = [0.03, 12 * DEGREE];
const RAISED = 0.006, LOWERED = 0.013, STRAIGHTENED = 0.85;
const KICK = 0.485, KICKED = [0.05, 0.22], SPARED = 0.5, CLEAR = [TOLD_HEIGHT, 0.08];
const AIRBORNE = [0, 0.15], SWAY = 0.016, SURGE = 0.009, AMPLE = 0.5, LONG = [0.66, 0.8], STILL = 0.6;
const EVEN = 1 / (1.3 * FPS), EVEN_MOST = 0.05, FORGET = 0.025 / FPS;
const CLOSE = 0.2, WIDE = 0.75, SOFTNESS = 0.001;
const SIDES = [1, -1];

/** @param {number} value @param {number} low @param {number} high */
function smooth(value, low, high) {
  const t = bounded((value - low) / (high - low), 0, 1);
  return t * t * (3 - 2 * t);
}

// from the remaining frames of a step: the share of its shift that stays in the next one (NaN: the foot does not fly),
// and the metres that it is raised by
const LEFT = Array.from({ length: STEP_FRAMES + 1 }, (_, k) => smooth(k / STEP_FRAMES, FLIGHT[0], FLIGHT[1]));
const KEPT = LEFT.map((left, k) => {
  const later = k ? LEFT[k - 1] : 0;
  return left > 0 && later < 1 ? later / Math.max(left, 1e-6) : NaN;
});
const LIFT = LEFT.map((_, k) => STEP_HEIGHT * Math.sin((Math.PI * k) / STEP_FRAMES) ** 2);

/** What the lock remembers of two feet. */
class LockState {
  soles = new Float64Array(6 * SOLES); // where the model had them in the last frame [side, 4, 3]
  contact = [false, false];
  hold = [0, 0];
  shift = [[0, 0, 0], [0, 0, 0]];
  turn = [0, 0];
  aim = [[0, 0, 0], [0, 0, 0]];
  swing = [0, 0];
  shortened = 0;
  reach = [0, 0];
  evened = 0;
}

/** Locks the feet of one person, chunk after chunk. */
export class FootLock {
  /** @type {LockState | null} */
  #state = null;

  /** @param {import("./legs.js").Legs} legs */
  constructor(legs) {
    this.legs = legs;
    this.shortened = 0; // of the last step, also while the lock is off
  }

  /** Forget the past: the next chunk starts in another pose. */
  restart() {
    this.#state = null;
  }

  /** @param {Float64Array} translation @param {Float64Array} rotations */
  #begin(translation, rotations) {
    const state = new LockState(), pose = new LegPose(this.legs, translation, rotations, 1);
    state.soles.set(pose.soles.subarray(0, 6 * SOLES));
    state.shortened = this.shortened;
    for (let side = 0; side < 2; side += 1) {
      state.contact[side] = lowest(pose.soles, SOLES * side) < TOUCH_HEIGHT;
      state.hold[side] = Number(state.contact[side]);
    }
    return state;
  }

  /**
   * Clean a chunk in place. `steps`: the person is on the spot, where feet step, and `waits` with it who comes to a
   * stand. `shortened`: the share that the way of the hips is shortened by at its end. `upright`: how far they have straightened their knees in each frame.
   * Returns contacts, left and right of each frame.
   * @param {Float64Array} translation @param {Float64Array} rotations @param {boolean} steps @param {boolean} waits
   * @param {number} shortened @param {Float64Array} upright
   */
  clean(translation, rotations, steps, waits, shortened, upright) {
    const state = (this.#state ??= this.#begin(translation, rotations));
    const { legs } = this, pose = new LegPose(legs, translation, rotations);
    const { drawn, along, stride } = drawnIn(pose, state, steps, shortened);
    moveSoles(pose, drawn, 1);
    const { slide, turning, height, speed } = slides(pose, state.soles, steps);
    const contacts = new Uint8Array(2 * FRAMES), shifts = new Float64Array(6 * FRAMES);
    const turns = new Float64Array(2 * FRAMES);
    for (let t = 0; t < FRAMES; t += 1) {
      const { across, between } = apartness(pose, t);
      const land = [0, 1].map((side) => landing(slide, turning, 2 * t + side));
      const rests = [2 * t, 2 * t + 1].every((k) =>
        FPS * Math.hypot(slide[2 * k], slide[2 * k + 1]) < RESTING[0] && FPS * Math.abs(turning[k]) < RESTING[1]);
      for (let side = 0; side < 2; side += 1) {
        const k = 2 * t + side, up = state.contact[side] ? LIFT_HEIGHT : TOUCH_HEIGHT;
        state.contact[side] = height[k] < up && speed[k] < (state.contact[side] ? LIFT_SPEED : TOUCH_SPEED);
        state.hold[side] = bounded(state.hold[side] + (state.contact[side] ? RISE : -RISE), 0, 1);
      }
      setOut(state, steps, rests ? TIDY : waits ? PATIENT : 1, across);
      const goals = uncrossed(land.map((goal) => goal.map((n) => (steps ? n : 0))), state.shift, between, across);
      const next = [0, 1].map((side) => {
        const k = 2 * t + side, shift = state.shift[side], stays = KEPT[state.swing[side]];
        const flies = stays === stays;
        const leashed = (1 - smooth(speed[k], SLIPPING[0], SLIPPING[1]))
          * (1 - smooth(Math.hypot(shift[0], shift[1]), LEASH[0], LEASH[1]));
        const grip = flies ? 0 : state.hold[side] * (steps ? 1 : leashed);
        const kept = flies ? stays : 1 - (1 - grip) * FADE, ahead = flies ? 1 - kept : 0;
        state.swing[side] = Math.max(state.swing[side] - 1, 0);
        const settling = -height[k] * (1 - smooth(height[k], 0, DROP));
        const level = shift[2] + SETTLE * (state.hold[side] * settling - shift[2]);
        const aim = state.aim[side].map((n, axis) => n + AIM * (goals[side][axis] - n));
        state.aim[side] = aim;
        const turn = kept * state.turn[side] + ahead * aim[2] - (steps ? grip * turning[k] : 0);
        const lift = level + LIFT[state.swing[side]];
        contacts[k] = Number(state.contact[side] && grip >= 0.5 && height[k] + lift <= TOLD_HEIGHT);
        const moved = [0, 1].map((axis) => kept * shift[axis] + ahead * aim[axis] - grip * slide[2 * k + axis]);
        shifts.set([moved[0], moved[1], lift], 3 * k);
        turns[k] = turn;
        return { shift: [moved[0], moved[1], level], turn };
      });
      state.shift = next.map(({ shift }) => shift);
      state.turn = next.map(({ turn }) => turn);
    }
    state.soles.set(pose.soles.subarray(-6 * SOLES));
    state.shortened = this.shortened = shortened;
    sink(legs, pose, drawn, translation, height, shifts, upright);
    moveSoles(pose, drawn, -1);
    const before = Float64Array.from(translation);
    for (let t = 0; t < FRAMES; t += 1) {
      const way = swayed(pose, along, stride, speed, height, t);
      for (let axis = 0; axis < 2; axis += 1) {
        translation[3 * t + axis] += way[axis];
        for (let side = 0; side < 2; side += 1) shifts[6 * t + 3 * side + axis] -= way[axis];
      }
      translation[3 * t + 2] -= pose.sunk[t];
    }
    moveFeet(pose, before, shifts, turns, rotations, upright.map((share) => FREE + (STRAIGHTENED - FREE) * share));
    return contacts;
  }

  /** Steps as long as the way of the hips, without a lock. @param {Float64Array} translation @param {Float64Array} rotations @param {number} shortened */
  shortenSteps(translation, rotations, shortened) {
    this.restart();
    const before = this.shortened;
    this.shortened = shortened;
    if (!before && !shortened) return;
    const pose = new LegPose(this.legs, translation, rotations), state = new LockState();
    state.shortened = before;
    const { drawn } = drawnIn(pose, state, true, shortened, false), shifts = new Float64Array(6 * FRAMES);
    for (let k = 0; k < 2 * FRAMES; k += 1) shifts.set(drawn.subarray(2 * k, 2 * k + 2), 3 * k);
    moveFeet(pose, translation, shifts, new Float64Array(2 * FRAMES), rotations);
  }
}

/** @param {Float64Array} soles @param {number} at */
function lowest(soles, at) {
  let least = Infinity;
  for (let p = 0; p < SOLES; p += 1) least = Math.min(least, soles[3 * (at + p) + 2]);
  return least;
}

/**
 * Way [frame, side, 2] of ankles along the facing where steps are shortened, and evened; how far along they are; and steps [frame].
 * @param {LegPose} pose @param {LockState} state @param {boolean} steps @param {number} shortened @param {boolean} [evens]
 */
function drawnIn(pose, state, steps, shortened, evens = true) {
  const drawn = new Float64Array(4 * FRAMES), along = new Float64Array(2 * FRAMES), stride = new Float64Array(FRAMES);
  for (let t = 0; t < FRAMES; t += 1) {
    const x = pose.facing[2 * t], y = pose.facing[2 * t + 1];
    for (let k = 2 * t; k < 2 * t + 2; k += 1) along[k] = pose.ankle[3 * k] * x + pose.ankle[3 * k + 1] * y;
    if (evens) {
      const lead = along[2 * t] - along[2 * t + 1];
      state.reach = [Math.max(state.reach[0] - FORGET, lead), Math.max(state.reach[1] - FORGET, -lead)];
      stride[t] = (state.reach[0] + state.reach[1]) / 2;
      const wanted = bounded((state.reach[1] - state.reach[0]) / 4, -EVEN_MOST, EVEN_MOST);
      state.evened += (steps ? 0 : EVEN) * (wanted - state.evened);
    }
    const share = state.shortened + ((t + 1) / FRAMES) * (shortened - state.shortened);
    for (let side = 0; side < 2; side += 1) {
      const way = SIDES[side] * state.evened - share * along[2 * t + side];
      drawn[4 * t + 2 * side] = way * x;
      drawn[4 * t + 2 * side + 1] = way * y;
    }
  }
  return { drawn, along, stride };
}

/** @param {LegPose} pose @param {Float64Array} drawn @param {number} sign */
function moveSoles(pose, drawn, sign) {
  for (let k = 0; k < 2 * FRAMES; k += 1) {
    for (let p = 0; p < SOLES; p += 1) {
      pose.soles[3 * (SOLES * k + p)] += sign * drawn[2 * k];
      pose.soles[3 * (SOLES * k + p) + 1] += sign * drawn[2 * k + 1];
    }
  }
}

/** Way of the bearing points, turns, heights and speeds of feet. @param {LegPose} pose @param {Float64Array} before @param {boolean} steps */
function slides(pose, before, steps) {
  const slide = new Float64Array(4 * FRAMES), turning = new Float64Array(2 * FRAMES);
  const height = new Float64Array(2 * FRAMES), speed = new Float64Array(2 * FRAMES);
  for (let t = 0; t < FRAMES; t += 1) {
    for (let side = 0; side < 2; side += 1) {
      const k = 2 * t + side, now = 3 * SOLES * k;
      const old = t ? pose.soles : before, from = t ? now - 6 * SOLES : 3 * SOLES * side;
      height[k] = lowest(pose.soles, SOLES * k);
      const way = [0, 0], mean = [0, 0];
      let loads = 0;
      for (let p = 0; p < SOLES; p += 1) {
        const load = Math.exp((height[k] - pose.soles[now + 3 * p + 2]) / SOFTNESS);
        loads += load;
        for (let axis = 0; axis < 2; axis += 1) {
          const step = pose.soles[now + 3 * p + axis] - old[from + 3 * p + axis];
          way[axis] += load * step;
          mean[axis] += step / SOLES;
        }
      }
      speed[k] = (FPS * Math.hypot(way[0], way[1])) / loads;
      slide[2 * k] = steps ? mean[0] : way[0] / loads;
      slide[2 * k + 1] = steps ? mean[1] : way[1] / loads;
      const toe = 3 * (SOLES - 1);
      const x0 = old[from + toe] - old[from], y0 = old[from + toe + 1] - old[from + 1];
      const x1 = pose.soles[now + toe] - pose.soles[now], y1 = pose.soles[now + toe + 1] - pose.soles[now + 1];
      turning[k] = Math.atan2(x0 * y1 - y0 * x1, x0 * x1 + y0 * y1);
    }
  }
  return { slide, turning, height, speed };
}

/** Where a foot that steps now is to land, ahead of the model: x, y and turn. @param {Float64Array} slide @param {Float64Array} turning @param {number} k */
function landing(slide, turning, k) {
  const x = slide[2 * k], y = slide[2 * k + 1], way = STEP_AHEAD * FPS;
  const share = way * Math.min(1, AHEAD_SHIFT / Math.max(way * Math.hypot(x, y), 1e-9));
  return [share * x, share * y, bounded(way * turning[k], -AHEAD_TURN, AHEAD_TURN)];
}

/** From the left to the right foot. @param {LegPose} pose @param {number} t */
function apartness(pose, t) {
  const apart = [0, 0];
  for (let p = 0; p < SOLES; p += 1) {
    for (let axis = 0; axis < 2; axis += 1) {
      const left = pose.soles[3 * (2 * SOLES * t + p) + axis], right = pose.soles[3 * (2 * SOLES * t + SOLES + p) + axis];
      apart[axis] += (right - left) / SOLES;
    }
  }
  const between = Math.hypot(apart[0], apart[1]);
  return { between, across: apart.map((n) => n / Math.max(between, 1e-6)) };
}

/** One foot sets out on a step if it is due. @param {LockState} state @param {boolean} steps @param {number} bound @param {number[]} across */
function setOut(state, steps, bound, across) {
  const { shift, turn, swing, contact } = state;
  const error = [0, 1].map((side) =>
    Math.max(Math.hypot(shift[side][0], shift[side][1]) / STEP_SHIFT, Math.abs(turn[side]) / STEP_TURN));
  const lag = ((shift[0][0] + shift[1][0]) * across[0] + (shift[0][1] + shift[1][1]) * across[1]) / STEP_SHIFT;
  const toLeft = lag - (turn[0] + turn[1]) / STEP_TURN;
  const first = error[0] + (toLeft > 0 ? LEADING : -LEADING) >= error[1] ? 0 : 1;
  const free = steps && contact[0] && contact[1] && swing[0] === 0 && swing[1] === 0;
  if (free && error[first] > bound) swing[first] = STEP_FRAMES;
}

/** Landings at which no foot comes nearer to the other than `APART`. @param {number[][]} goals @param {number[][]} shift @param {number} between @param {number[]} across */
function uncrossed(goals, shift, between, across) {
  const over = (/** @type {number[]} */ a, /** @type {number[]} */ b) =>
    Math.max(APART - between - ((a[0] - b[0]) * across[0] + (a[1] - b[1]) * across[1]), 0);
  const left = over(shift[1], goals[0]), right = over(goals[1], shift[0]);
  return [
    [goals[0][0] - left * across[0], goals[0][1] - left * across[1], goals[0][2]],
    [goals[1][0] + right * across[0], goals[1][1] + right * across[1], goals[1][2]],
  ];
}

/** Bears the body: 1, and less in the air. @param {Float64Array} height @param {number} t */
const borne = (height, t) => 1 - smooth(Math.min(height[2 * t], height[2 * t + 1]), AIRBORNE[0], AIRBORNE[1]);

/**
 * Metres [2] by which hips are moved in a frame: aside, to the foot that bears, and along.
 * @param {LegPose} pose @param {Float64Array} along @param {Float64Array} stride @param {Float64Array} speed
 * @param {Float64Array} height @param {number} t
 */
function swayed(pose, along, stride, speed, height, t) {
  const left = 2 * t, right = left + 1;
  const phase = bounded((along[left] - along[right]) / Math.max(stride[t], 0.1), -1, 1);
  const onLeft = (speed[right] - speed[left]) / Math.max(speed[left] + speed[right], STILL);
  const strong = onLeft * Math.min(stride[t] / AMPLE, 1) * borne(height, t);
  const aside = -SWAY * strong * Math.cos((Math.PI / 2) * phase);
  const ahead = SURGE * strong * (1 - smooth(stride[t], LONG[0], LONG[1])) * Math.sin(Math.PI * phase);
  const x = pose.facing[left], y = pose.facing[right];
  return [ahead * x + aside * y, ahead * y - aside * x];
}

/**
 * Lower the hips over feet that are apart, and heels that are kicked up. Fills `pose.sunk`, adds to `shifts`.
 * @param {import("./legs.js").Legs} legs @param {LegPose} pose @param {Float64Array} drawn @param {Float64Array} translation
 * @param {Float64Array} height @param {Float64Array} shifts @param {Float64Array} upright
 */
function sink(legs, pose, drawn, translation, height, shifts, upright) {
  for (let t = 0; t < FRAMES; t += 1) {
    const bears = borne(height, t);
    const spared = (/** @type {number} */ side, /** @type {number[]} */ off) => {
      const i = 6 * t + 3 * side;
      const [x, y, z] = off.map((moved, n) => pose.ankle[i + n] + moved - pose.hip[i + n]);
      return legs.length[side] - Math.hypot(x, y, z);
    };
    const spare = [0, 1].map((side) => spared(side, [0, 0, 0]));
    const placed = [0, 1].map((side) => {
      const k = 2 * t + side;
      return spared(side, [shifts[3 * k] + drawn[2 * k], shifts[3 * k + 1] + drawn[2 * k + 1], 0]);
    });
    const at = (/** @type {number} */ side, /** @type {number} */ axis) =>
      pose.ankle[6 * t + 3 * side + axis] + drawn[4 * t + 2 * side + axis];
    const square = (at(0, 0) - at(1, 0)) ** 2 + (at(0, 1) - at(1, 1)) ** 2;
    const wide = (bounded(square, CLOSE ** 2, WIDE ** 2) - CLOSE ** 2) / (WIDE ** 2 - CLOSE ** 2);
    const walking = LOWERED * wide - Math.min(RAISED, Math.min(...spare) / 2) * (1 - wide);
    const straight = -STRAIGHTENED * Math.max(Math.min(...placed), 0);
    const sunk = (walking + upright[t] * (straight - walking)) * bears;
    pose.sunk[t] = sunk;
    for (let side = 0; side < 2; side += 1) {
      const k = 2 * t + side, ankle = pose.ankle[3 * k + 2] + translation[3 * t + 2];
      const [low, high] = KICKED, over = bounded(ankle - low, 0, high - low);
      const raised = (over * over) / (2 * (high - low)) + Math.max(ankle - high, 0);
      const kick = Math.min(KICK * raised * smooth(height[k], CLEAR[0], CLEAR[1]), SPARED * spare[side]);
      shifts[3 * k] += drawn[2 * k];
      shifts[3 * k + 1] += drawn[2 * k + 1];
      shifts[3 * k + 2] += sunk - kick * bears;
    }
  }
}
