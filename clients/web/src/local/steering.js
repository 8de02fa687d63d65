// Chooses what a person does next: stand, walk, stop, turn, or step sideways. It mirrors the server's
// world/goals/steering.py, for one person. World: metres, Z up, heading 0 faces +Y; places and directions are [x, y].

export const STANDING = 0, WALKING = 1, STOPPING = 2, TURNING = 3, STRAFING = 4;
export const MODES = Object.freeze(["STANDING", "WALKING", "STOPPING", "TURNING", "STRAFING"]);
export const STEP_SECONDS = 0.2;
export const STEP = Math.fround(STEP_SECONDS); // for sums of seconds, which the server has in float32

const TRIM_GAIN = 0.12, TRIM_MOST = 0.15, STEADY = 0.3;
const GONE_BY = 0.2; // metres
const FARTHER = 1.5; // factor on the way to a point that is passed: a body slows down before its goal
const SHIFTS = [13, 21], CALM = 4; // seconds: when a standing body shifts its weight, and how soon in full
const PACE = 0.7; // m/s: least speed on the way to a goal, unless a lower one is asked for

/** @typedef {[number, number]} Point */
/**
 * The state from step to step; never changed, only replaced.
 * @typedef {object} Gait
 * @property {number} mode @property {number} speed m/s over the last step @property {number} slowSeconds
 * @property {Point} stopPlace @property {Point} stopFacing @property {boolean} arrived @property {number} waypoint
 * @property {number} trim @property {boolean} rested it stood when the step began
 */
/**
 * A goal on a path, as steering has it. `given` false: there is none.
 * @typedef {object} GoalRow
 * @property {boolean} given @property {Point} place @property {number} radius @property {number} speed
 * @property {Point | null} heading unit vector to face @property {boolean} strafe @property {boolean} through
 * @property {number} dwell @property {boolean} more @property {number} bend radians @property {Point} onward
 * @property {boolean} close somebody is beside the person: standing, it does not shift its weight
 */
/**
 * A goal as it is given: core frame, metres.
 * @typedef {object} CoreGoal
 * @property {number} x @property {number} y @property {number} [radius] @property {number} [speed]
 * @property {number} [heading] @property {boolean} [stop] @property {boolean} [strafe] @property {number} [dwell]
 */
/**
 * Hips and facing where a step starts.
 * @typedef {object} Start
 * @property {Point} hips @property {Point} first hips in the first frame of the seed @property {Point} facing
 */

/** @type {GoalRow} */
const NO_GOAL = {
  given: false, place: [0, 0], radius: 0, speed: 0, heading: null, strafe: false, through: false, dwell: 0, more: false,
  bend: 0, onward: [0, 0], close: false,
};

/** The rows of a path that is walked from `start`. @param {CoreGoal[]} goals @param {Point} start @returns {GoalRow[]} */
export function goalRows(goals, start) {
  const ways = goals.map((goal, k) => {
    const from = k ? goals[k - 1] : { x: start[0], y: start[1] };
    return unit([goal.x - from.x, goal.y - from.y]);
  });
  return goals.map((goal, k) => {
    const onward = ways[k + 1] ?? ways[k];
    const { heading, stop = true } = goal;
    return {
      given: true, place: [goal.x, goal.y], radius: goal.radius ?? 0.3, speed: goal.speed ?? 1.2,
      heading: heading === undefined ? null : [-Math.sin(heading), Math.cos(heading)],
      strafe: goal.strafe ?? false, through: !stop, dwell: goal.dwell ?? 0, more: k + 1 < goals.length,
      bend: between(ways[k], onward), onward, close: false,
    };
  });
}

/** The goal at a place of a path. @param {GoalRow[]} rows @param {number} waypoint */
export const goalAt = (rows, waypoint) => rows[waypoint] ?? NO_GOAL;

/** The rules, with the constants of an export's sidecar. */
export class Steering {
  /** @param {Record<string, { value: number }>} constants `steering` of wayfarer.json */
  constructor(constants) {
    const read = (/** @type {string} */ name) => {
      if (!(name in constants)) throw new Error(`wayfarer.json: steering has no ${name}; write it again: wayfarer export --for web`);
      return constants[name].value;
    };
    this.brakingSeconds = read("braking_seconds");
    this.brakingMargin = read("braking_margin");
    this.coastingSeconds = read("coasting_seconds");
    this.pausing = read("pausing");
    this.slow = read("slow");
    this.slowSeconds = read("slow_seconds");
    this.resumeMargin = read("resume_margin");
    this.lookahead = read("lookahead");
    this.lookaheadSeconds = read("lookahead_seconds");
    this.faced = read("faced");
    this.astray = read("astray");
    this.reactions = read("reactions");
    this.turnRadius = read("turn_radius");
    this.turnSpeed = read("turn_speed");
    this.strafeSpeed = read("strafe_speed");
    this.strafeSlowest = read("strafe_slowest");
    this.weightShift = read("weight_shift");
  }

  /** Sends a person that is done with a goal on to the next. @param {Gait} gait @param {GoalRow} goal @returns {Gait} */
  advance(gait, goal) {
    const dwelt = gait.slowSeconds >= this.slowSeconds + goal.dwell - 1e-3;
    const done = goal.through || (gait.mode === STANDING && dwelt);
    if (!(goal.more && gait.arrived && done)) return gait;
    return { ...gait, mode: WALKING, slowSeconds: 0, arrived: false, waypoint: gait.waypoint + 1 };
  }

  /** The gait of the next step. @param {Gait} gait @param {Start} start @param {GoalRow} goal @param {boolean} ready @returns {Gait} */
  decide(gait, start, goal, ready) {
    const { mode, speed, arrived } = gait;
    const way = minus(goal.place, start.hips), distance = Math.hypot(...way);
    const braking = Math.min(goal.radius / 2, this.brakingMargin) + this.brakingSeconds * speed;
    const walking = mode === WALKING || mode === STRAFING, stopping = mode === STOPPING;
    const standing = mode === STANDING, turning = mode === TURNING;

    const isSlow = speed < this.slow;
    const slowSeconds = standing || (stopping && isSlow) ? gait.slowSeconds + STEP_SECONDS : 0;
    const still = stopping && slowSeconds >= this.slowSeconds - 1e-3;

    const holds = goal.given && !(goal.through && arrived);
    const paused = mode === WALKING && speed < this.pausing * Math.min(goal.speed, PACE);
    const atRest = still || standing || turning || (walking && isSlow);
    const waits = !ready && gait.rested && isSlow && (standing || mode === WALKING);
    const missed = holds && !arrived && !waits;
    const strayed = holds && distance > Math.max(goal.radius, braking) + this.resumeMargin && !waits;
    const far = distance > braking && (strayed || !(arrived && (isSlow || paused)));

    const walks = (walking && holds && (goal.through || far) && !waits) || ((still || standing || turning) && missed)
      || (!walking && strayed);
    const hasHeading = goal.heading !== null && !waits;
    const off = between(start.facing, goal.heading ?? [0, 0]);
    const astray = hasHeading && off > (turning ? this.faced : this.astray);
    const turns = atRest && astray && !walks;
    const stands = waits || ((standing || still) && !walks && !turns);
    const next = walks && goal.strafe ? STRAFING : walks ? WALKING : turns ? TURNING : stands ? STANDING : STOPPING;

    const brakes = walking && !walks && !waits, rests = still && !walks;
    let { stopPlace, stopFacing } = gait;
    if (turns && holds && arrived) stopPlace = goal.place; // its steps bring it nearer
    else if (rests && holds && distance > goal.radius / 2) stopPlace = goal.place;
    else if (rests || (turning && !turns)) stopPlace = start.hips;
    else if (brakes) stopPlace = holds ? goal.place : this.#rest(gait, start);
    if (hasHeading && !walks && goal.heading) stopFacing = goal.heading;
    else if (brakes || rests) stopFacing = start.facing;
    return { ...gait, mode: next, slowSeconds, rested: stands, stopPlace, stopFacing };
  }

  /** The target of the next step. @param {Gait} gait @param {Start} start @param {GoalRow} goal */
  targets(gait, start, goal) {
    const { mode, stopPlace, stopFacing } = gait;
    if (mode === TURNING) {
      const arc = plus(start.facing, stopFacing), share = this.turnRadius / Math.max(Math.hypot(...arc), 0.1);
      return { place: plus(stopPlace, times(share, arc)), facing: stopFacing, speed: this.turnSpeed };
    }
    if (mode !== WALKING && mode !== STRAFING) {
      const aside = mode === STANDING && !goal.close ? this.weightShift * leans(stopPlace, gait.slowSeconds) : 0;
      return { place: plus(stopPlace, times(aside, [stopFacing[1], -stopFacing[0]])), facing: stopFacing, speed: 0 };
    }
    /** @type {Point} */
    const facing = mode === STRAFING && goal.heading ? goal.heading : [0, 0];
    const [least, most] = goal.strafe ? [this.strafeSlowest, this.strafeSpeed] : [0, Infinity];
    const speed = bounded(goal.speed * (1 + gait.trim), least, most);
    return { place: this.#ahead(start, goal), facing, speed };
  }

  /** @param {Start} start @param {GoalRow} goal @returns {Point} */
  #ahead(start, goal) {
    const to = minus(goal.place, start.hips), distance = Math.hypot(...to);
    if (!goal.through || dot(to, goal.onward) <= 0) return goal.place; // a person past it has missed it, and turns back
    const lookahead = Math.max(this.lookahead, this.lookaheadSeconds * goal.speed);
    const beyond = Math.max(lookahead * Math.cos(goal.bend) - distance, 0);
    return plus(start.hips, times(FARTHER, plus(to, times(beyond, goal.onward))));
  }

  /** Where a person comes to rest that begins to brake now. @param {Gait} gait @param {Start} start @returns {Point} */
  #rest(gait, start) {
    return plus(start.hips, times(this.coastingSeconds * gait.speed, unit(minus(start.hips, start.first))));
  }
}

/** Where its weight is, from -1 (left) to 1 (right), of a body that stands. @param {Point} place @param {number} seconds */
function leans(place, seconds) {
  const own = 10 * (place[0] + 2 * place[1]);
  const wave = Math.sin(2 * Math.PI * seconds / SHIFTS[0] + own) + Math.sin(2 * Math.PI * seconds / SHIFTS[1] + 3 * own);
  return Math.min(seconds / CALM, 1) * Math.tanh(2 * wave);
}

/**
 * The gait after a step. `translation` has the hips of its frames.
 * @param {Gait} gait @param {Point} start @param {Float64Array} translation @param {GoalRow} goal @returns {Gait}
 */
export function observe(gait, start, translation, goal) {
  const frames = translation.length / 3;
  const walks = gait.mode === WALKING || gait.mode === STRAFING;
  let there = gait.arrived, away = Math.hypot(start[0] - goal.place[0], start[1] - goal.place[1]);
  for (let t = 0; t < frames && goal.given; t += 1) {
    const before = away;
    away = Math.hypot(translation[3 * t] - goal.place[0], translation[3 * t + 1] - goal.place[1]);
    there ||= away <= goal.radius + (goal.through && walks && away > before ? GONE_BY : 0);
  }
  const last = 3 * (frames - 1);
  const speed = Math.hypot(translation[last] - start[0], translation[last + 1] - start[1]) / STEP_SECONDS;
  const lacks = 1 - speed / Math.max(goal.speed, 1e-3);
  const steady = goal.given && walks && Math.abs(lacks) < STEADY;
  const trim = bounded(gait.trim + (steady ? TRIM_GAIN * lacks : 0), -TRIM_MOST, TRIM_MOST);
  return { ...gait, speed, trim, arrived: there };
}

/** Horizontal unit vector that the hips face after rotation `q`. @param {ArrayLike<number>} q @param {number} i @returns {Point} */
export function facingOf(q, i) {
  const x = q[i], y = q[i + 1], z = q[i + 2], w = q[i + 3];
  const ahead = [-2 * (x * y + z * w), 1 - 2 * (y * y + z * z)];
  const length = Math.max(Math.hypot(ahead[0], ahead[1]), 1e-9);
  return [ahead[0] / length, ahead[1] / length];
}

/** @param {number} value @param {number} low @param {number} high */
export const bounded = (value, low, high) => Math.min(Math.max(value, low), high);

/** @param {Point} a @param {Point} b @returns {Point} */
export const plus = (a, b) => [a[0] + b[0], a[1] + b[1]];
/** @param {Point} a @param {Point} b @returns {Point} */
export const minus = (a, b) => [a[0] - b[0], a[1] - b[1]];
/** @param {Point} a @param {Point} b */
export const dot = (a, b) => a[0] * b[0] + a[1] * b[1];
/** @param {Point} a @param {Point} b */
export const apart = (a, b) => Math.hypot(a[0] - b[0], a[1] - b[1]);
/** @param {number} s @param {Point} a @returns {Point} */
export const times = (s, a) => [s * a[0], s * a[1]];
/** @param {Point} a @returns {Point} */
export const unit = (a) => times(1 / Math.max(Math.hypot(...a), 1e-6), a);
/** Radians between unit vectors. @param {Point} a @param {Point} b */
const between = (a, b) => Math.acos(bounded(a[0] * b[0] + a[1] * b[1], -1, 1));

/** Radians between vectors of any length. @param {Point} a @param {Point} b */
export function angleBetween(a, b) {
  const length = Math.max(Math.hypot(...a), 1e-6) * Math.max(Math.hypot(...b), 1e-6);
  return Math.acos(bounded((a[0] * b[0] + a[1] * b[1]) / length, -1, 1));
}
