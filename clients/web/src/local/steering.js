// What a person does next: stand, walk, stop, turn, or go in side steps. The server's world/goals/steering.py, for one
// person. World: metres, Z up, heading 0 faces +Y; places and directions are [x, y].

export const STANDING = 0, WALKING = 1, STOPPING = 2, TURNING = 3, STRAFING = 4;
export const MODES = Object.freeze(["STANDING", "WALKING", "STOPPING", "TURNING", "STRAFING"]);
export const STEP_SECONDS = 0.2;

const TRIM_GAIN = 0.12, TRIM_MOST = 0.15, STEADY = 0.3;
const HURRY = [1.6, 2.0]; // m/s between which habits of stride go to nothing
export const STRIDE = [-0.05, 0.11]; // range of the share by which steps are shorter
const SHORTEN_RATE = 0.6 * STEP_SECONDS;

/** @typedef {[number, number]} Point */
/**
 * What is remembered from step to step; never changed, only replaced.
 * @typedef {object} Gait
 * @property {number} mode @property {number} speed m/s over the last step @property {number} slowSeconds
 * @property {Point} stopPlace @property {Point} stopFacing @property {boolean} arrived @property {number} waypoint
 * @property {Point} carried m/s in side steps @property {number} trim @property {number} shortened
 * @property {boolean} planted @property {Float64Array} soles places of the sole markers, x and y, while planted
 */
/**
 * A goal on a path, as steering has it. `given` false: there is none.
 * @typedef {object} GoalRow
 * @property {boolean} given @property {Point} place @property {number} radius @property {number} speed
 * @property {Point | null} heading unit vector to face @property {boolean} strafe @property {boolean} through
 * @property {number} dwell @property {boolean} more @property {number} bend radians @property {Point} onward
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
  bend: 0, onward: [0, 0],
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
      bend: between(ways[k], onward), onward,
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
    this.slowingDistance = read("slowing_distance");
    this.slowest = read("slowest");
    this.acceleration = read("acceleration");
    this.coastingSeconds = read("coasting_seconds");
    this.sharp = read("sharp");
    this.cornerSpeed = read("corner_speed");
    this.pausing = read("pausing");
    this.slow = read("slow");
    this.slowSeconds = read("slow_seconds");
    this.resumeMargin = read("resume_margin");
    this.lookahead = read("lookahead");
    this.behind = read("behind");
    this.abeam = read("abeam");
    this.faced = read("faced");
    this.astray = read("astray");
    this.turnAhead = read("turn_ahead");
    this.reactions = read("reactions");
    this.sideStepSpeed = read("side_step_speed");
    this.sideStepAcceleration = read("side_step_acceleration");
    this.sideStepFaced = read("side_step_faced");
  }

  /** Who is done with a goal that another follows is sent on. @param {Gait} gait @param {GoalRow} goal @returns {Gait} */
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
    const paused = mode === WALKING && speed < this.pausing * Math.min(goal.speed, this.slowest);
    const far = distance > braking && !(arrived && (isSlow || paused));
    const atRest = still || standing || turning || (walking && isSlow);
    const waits = !ready && gait.planted && isSlow && (standing || mode === WALKING);
    const missed = holds && !arrived && !waits;
    const strayed = holds && distance > Math.max(goal.radius, braking) + this.resumeMargin && !waits;

    const direction = times(1 / Math.max(distance, 1e-6), way);
    const reverses = missed && far && between(start.facing, direction) > (turning ? this.abeam : this.behind)
      && !goal.strafe;
    const about = reverses && (atRest || isSlow);
    let walks = ((walking && holds && (goal.through || far) && !waits) || ((still || standing || turning) && missed)
      || (!walking && strayed)) && !reverses;
    const hasHeading = goal.heading !== null && !waits;
    const off = between(start.facing, goal.heading ?? [0, 0]);
    const astray = hasHeading && off > (turning ? this.faced : this.astray);
    const faces = off < (turning ? this.faced : this.sideStepFaced);
    const sideSteps = walks && goal.strafe && (mode === STRAFING || (atRest && faces));
    const turnsFirst = walks && goal.strafe && atRest && !sideSteps;
    const stopsFirst = walks && goal.strafe && !atRest && !sideSteps;
    walks &&= !(turnsFirst || stopsFirst);
    const turns = about || turnsFirst || (atRest && astray && !walks);
    const stands = waits || ((standing || still) && !walks && !turns);
    const next = sideSteps ? STRAFING : walks ? WALKING : turns ? TURNING : stands ? STANDING : STOPPING;

    const brakes = walking && !walks && !waits, rests = still && !walks;
    const turnsAway = (about || turnsFirst) && !turning;
    let { stopPlace, stopFacing } = gait;
    const facesThere = turns && holds && arrived && !about && !turnsFirst;
    if (facesThere) stopPlace = goal.place; // its steps take it nearer
    else if (rests || turnsAway) stopPlace = start.hips;
    else if (brakes) stopPlace = holds && !reverses && !stopsFirst ? goal.place : this.#rest(gait, start);
    if (about) stopFacing = direction;
    else if (hasHeading && !walks && goal.heading) stopFacing = goal.heading;
    else if (brakes || rests) stopFacing = start.facing;
    const planted = gait.planted && next !== WALKING && next !== TURNING;
    return { ...gait, mode: next, slowSeconds, planted, stopPlace, stopFacing };
  }

  /** What the next step aims at. @param {Gait} gait @param {Start} start @param {GoalRow} goal */
  targets(gait, start, goal) {
    const { mode } = gait;
    /** @type {Point} */
    let facing = [0, 0];
    if (mode === TURNING) facing = turnedTowards(start.facing, gait.stopFacing, this.turnAhead);
    else if (mode === STRAFING) facing = goal.heading ?? facing;
    else if (mode !== WALKING) facing = gait.stopFacing;
    const place = mode === STRAFING ? start.hips : mode === WALKING ? this.#ahead(start, goal) : gait.stopPlace;
    return { place, facing, speed: mode === WALKING ? this.#speed(gait, start, goal) : 0 };
  }

  /** Velocity at the end of the step of a body in side steps. @param {Gait} gait @param {Start} start @param {GoalRow} goal */
  carried(gait, start, goal) {
    const way = minus(this.#ahead(start, goal), start.hips), distance = Math.hypot(...way);
    const target = Math.min(goal.speed, this.sideStepSpeed);
    const slowing = goal.through ? target : distance / (2 * STEP_SECONDS);
    const speed = gait.mode === STRAFING ? Math.min(target, slowing) : 0;
    const change = minus(times(speed / Math.max(distance, 1e-6), way), gait.carried);
    const most = this.sideStepAcceleration * STEP_SECONDS;
    return plus(gait.carried, times(Math.min(1, most / Math.max(Math.hypot(...change), 1e-9)), change));
  }

  /** @param {Start} start @param {GoalRow} goal @returns {Point} */
  #ahead(start, goal) {
    if (!goal.through) return goal.place;
    const distance = Math.hypot(...minus(goal.place, start.hips));
    return plus(goal.place, times(Math.max(this.lookahead * Math.cos(goal.bend) - distance, 0), goal.onward));
  }

  /** @param {Gait} gait @param {Start} start @param {GoalRow} goal */
  #speed(gait, start, goal) {
    const distance = Math.hypot(...minus(goal.place, start.hips));
    const habit = bounded(gait.shortened, STRIDE[0], STRIDE[1]);
    const target = (goal.speed * (1 + gait.trim)) / (1 - habit);
    const atGoal = !goal.through ? this.slowest : goal.bend > this.sharp ? this.cornerSpeed : target;
    const slowing = (target * distance) / this.slowingDistance;
    const reachable = gait.speed / (1 - gait.shortened) + (this.acceleration * STEP_SECONDS) / (1 - habit);
    return Math.min(target, reachable, Math.max(slowing, atGoal));
  }

  /** Where a person who begins to brake now comes to rest. @param {Gait} gait @param {Start} start @returns {Point} */
  #rest(gait, start) {
    return plus(start.hips, times(this.coastingSeconds * gait.speed, unit(minus(start.hips, start.first))));
  }
}

/** The gait with the share that steps are shortened by at its end. @param {Gait} gait @param {GoalRow} goal @param {number} stride 0 … 1 @returns {Gait} */
export function shortenedGait(gait, goal, stride) {
  const calm = bounded((HURRY[1] - goal.speed) / (HURRY[1] - HURRY[0]), 0, 1);
  const habit = (STRIDE[0] + (STRIDE[1] - STRIDE[0]) * stride) * calm;
  const wanted = gait.mode === WALKING || gait.mode === STOPPING ? habit : 0;
  const shortened = gait.shortened + bounded(wanted - gait.shortened, -SHORTEN_RATE, SHORTEN_RATE);
  return { ...gait, shortened: Math.fround(shortened) };
}

/** What a step brought; `translation`: hips of its frames. @param {Gait} gait @param {Point} start @param {Float64Array} translation @param {GoalRow} goal @returns {Gait} */
export function observe(gait, start, translation, goal) {
  const frames = translation.length / 3;
  let there = gait.arrived;
  for (let t = 0; t < frames && goal.given; t += 1) {
    const away = Math.hypot(translation[3 * t] - goal.place[0], translation[3 * t + 1] - goal.place[1]);
    there ||= away <= goal.radius;
  }
  const last = 3 * (frames - 1);
  const speed = Math.hypot(translation[last] - start[0], translation[last + 1] - start[1]) / STEP_SECONDS;
  const lacks = 1 - speed / Math.max(goal.speed, 1e-3);
  const steady = goal.given && gait.mode === WALKING && gait.shortened <= Math.fround(STRIDE[1])
    && Math.abs(lacks) < STEADY;
  const trim = bounded(gait.trim + (steady ? TRIM_GAIN * lacks : 0), -TRIM_MOST, TRIM_MOST);
  return { ...gait, speed, trim, arrived: there };
}

/** Horizontal unit vector that hips turned so face. @param {ArrayLike<number>} q @param {number} i @returns {Point} */
export function facingOf(q, i) {
  const x = q[i], y = q[i + 1], z = q[i + 2], w = q[i + 3];
  const ahead = [-2 * (x * y + z * w), 1 - 2 * (y * y + z * z)];
  const length = Math.max(Math.hypot(ahead[0], ahead[1]), 1e-9);
  return [ahead[0] / length, ahead[1] / length];
}

/** @param {Point} facing @param {Point} asked @param {number} most @returns {Point} */
function turnedTowards([x, y], asked, most) {
  const angle = bounded(Math.atan2(x * asked[1] - y * asked[0], x * asked[0] + y * asked[1]), -most, most);
  return [Math.cos(angle) * x - Math.sin(angle) * y, Math.sin(angle) * x + Math.cos(angle) * y];
}

/** @param {number} value @param {number} low @param {number} high */
export const bounded = (value, low, high) => Math.min(Math.max(value, low), high);

/** @param {Point} a @param {Point} b @returns {Point} */
export const plus = (a, b) => [a[0] + b[0], a[1] + b[1]];
/** @param {Point} a @param {Point} b @returns {Point} */
export const minus = (a, b) => [a[0] - b[0], a[1] - b[1]];
/** @param {number} s @param {Point} a @returns {Point} */
export const times = (s, a) => [s * a[0], s * a[1]];
/** @param {Point} a @returns {Point} */
export const unit = (a) => times(1 / Math.max(Math.hypot(...a), 1e-6), a);
/** Radians between unit vectors. @param {Point} a @param {Point} b */
const between = (a, b) => Math.acos(bounded(a[0] * b[0] + a[1] * b[1], -1, 1));
