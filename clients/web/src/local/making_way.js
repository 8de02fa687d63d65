// Making way: a standing agent steps aside when another is stuck before it or stands in it, and returns. It mirrors the
// server's world/scenes/making_way.py, which explains the rule. World: metres.

import { PATIENCE, TOUCH } from "./company.js";
import { stop } from "./passages.js";
import { FARTHEST } from "./spots.js";
import { STEP_SECONDS, bounded, dot, minus, plus, times, unit } from "./steering.js";

const SIGHT = 2.5, CLOSES = 0.5, ASIDE = 0.8, APART = 0.46, BODY = 0.37, NEARER = 0.9, ROOMIER = 0.05, RETURNS = 1, HOME = 0.25;
const SIDES = [75, 45, 105, 135, -75, -45, -105, -135].map((angle) => (angle * Math.PI) / 180);
const STEPS = [1, 0.6].flatMap((size) => SIDES.map((turned) => ({ x: size * Math.cos(turned), aside: size * Math.sin(turned) })))
  .concat([1, 0.6, -1, -0.6].map((x) => ({ x, aside: 0 })));

/** @typedef {import("./scene.js").Point} Point */
/** @typedef {import("./company.js").Row} Row */
/** @typedef {import("./company.js").Seen} Seen */
/** The way of another person. `left`: metres by which a place is to its left. `touches`: bodies touch there. @typedef {{ way: Point, left: number, touches?: boolean }} Way */

export class MakingWay {
  /** @param {import("./scene.js").LocalScene | null} scene */
  constructor(scene) {
    this.scene = scene;
  }

  /** Sends a person that stays aside, or back, and a waiting person out of another one. @param {Row} row @param {Seen[]} people */
  update(row, people) {
    const { hips, self, walker } = row, stays = !walker.aims.wants;
    if (!stays && row.ahead.given) return;
    if (!mayStep(row)) return;
    const aside = stays && walker.memory.yields > 0, others = people.filter((other) => other !== self), { spot } = walker.aims;
    const home = aside || Math.hypot(...minus(spot, hips)) < HOME ? spot : hips;
    const asks = toucher(others, self) ?? (stays ? comer(others, self, hips, false) : null);
    const runsOn = isStopped(hips, stop(self), others), step = asks && !runsOn && this.#step(row, asks, others);
    if (step && !stays) return stepTo(row, plus(hips, times(ASIDE, step)), others);
    if (step) {
      walker.aims.spot = home;
      walker.memory = { ...walker.memory, retreat: plus(step, times(1 / ASIDE, minus(hips, home))) };
    } else if (!aside) return;
    const taken = others.some((other) => Math.hypot(...minus(stop(other), walker.aims.spot)) < TOUCH);
    // a person that is in the way where it is, and can step no farther, is better off at its place
    const place = nextPlace(row, taken || Boolean(step) || (aside && comer(others, self, home, true) !== null));
    if (!walker.memory.yields) return;
    stepTo(row, place, others);
  }

  /** A person's step, in `ASIDE`, to a free place to which nobody stops it. @param {Row} row @param {Way} asks @param {Seen[]} others @returns {Point | undefined} */
  #step({ hips, ahead, walker: { aims } }, { way, left, touches }, others) {
    const side = left >= 0 ? 1 : -1, goal = ahead.given ? aims.asked : hips;
    const roomAt = (/** @type {Point} */ place) => Math.min(...others.map((other) => Math.hypot(...minus(place, stop(other)))));
    const found = STEPS.map(({ x, aside }) => ({ x, y: side * aside })).map(({ x, y }) => {
      const step = /** @type {Point} */ ([x * way[0] - y * way[1], x * way[1] + y * way[0]]), place = plus(hips, times(ASIDE, step));
      const may = (touches || Math.abs(left + ASIDE * y) >= CLOSES || (!y && x > 0)) && Math.hypot(...minus(place, goal)) < FARTHEST
        && (!this.scene || this.scene.distance(...place) >= this.scene.radius) && !isStopped(hips, place, others);
      return { step, room: may ? roomAt(place) : 0 };
    });
    const most = Math.max(...found.map(({ room }) => room)), least = touches ? Math.min(APART, Math.max(roomAt(hips) + ROOMIER, most - ROOMIER)) : APART;
    return found.find(({ room }) => room >= least)?.step;
  }
}

/** Whether a person faces no heading, and is near its goal or has stepped from there. @param {Row} row */
const mayStep = ({ hips, ahead, walker: { aims, memory } }) =>
  !ahead.given || (!ahead.heading && (memory.yields > 0 || Math.hypot(...minus(hips, aims.asked)) < FARTHEST));

/** Makes a person step to a place, facing as it does, unless others stop it. @param {Row} row @param {Point} place @param {Seen[]} others */
function stepTo(row, place, others) {
  const given = !isStopped(row.hips, stop(row.self), others) && !isStopped(row.hips, place, others), heading = given ? row.gait.stopFacing : null;
  row.ahead = { ...row.ahead, place, heading, given, through: false, strafe: true, radius: Math.fround(0.1), speed: Math.fround(0.8) };
}

/** Where a person steps to; counts the seconds since its place was last needed. @param {Row} row @param {boolean} needed @returns {Point} */
function nextPlace({ hips, walker }, needed) {
  const { memory, memory: { yields, retreat }, aims: { spot: home } } = walker;
  const seconds = needed ? RETURNS : Math.fround(Math.max(yields - STEP_SECONDS, 0.01)), returns = seconds < STEP_SECONDS / 2;
  walker.memory = { ...memory, yields: returns && Math.hypot(...minus(home, hips)) < HOME ? 0 : seconds };
  return returns ? home : plus(home, times(ASIDE, retreat));
}

/** The way of the nearest, that is stuck or anybody, that a person at a place closes. @param {Seen[]} others @param {Seen} self @param {Point} place @param {boolean} anybody @returns {Way | null} */
function comer(others, self, place, anybody) {
  const comes = others.filter(({ walks, aims, memory }) => walks && (anybody || (Math.max(aims.barred, memory.waited) > PATIENCE && self.stands))).map((other) => {
    const way = unit(other.memory.preferred), to = minus(place, other.position);
    return { way, on: dot(to, way), left: way[0] * to[1] - way[1] * to[0], goes: Math.hypot(...minus(other.aims.spot, other.position)) };
  }).filter(({ on, left, goes }) => on > 0 && on < Math.min(SIGHT, goes) && Math.abs(left) < CLOSES);
  return comes.length ? comes.reduce((a, b) => (b.on < a.on ? b : a)) : null;
}

/** Like `comer`, of the nearest that is still where a person stands: a way through it, past the person. @param {Seen[]} others @param {Seen} self @returns {Way | null} */
function toucher(others, self) {
  const touches = others.filter((other) =>
    !other.velocity[0] && !other.velocity[1] && ((other.walks && self.stands) || other.number < self.number) && Math.hypot(...minus(self.position, other.position)) < TOUCH,
  ).map((other) => {
    const to = minus(self.position, other.position);
    return { way: unit([to[1], -to[0]]), left: Math.hypot(...to), touches: true };
  });
  return touches.length ? touches.reduce((a, b) => (b.left < a.left ? b : a)) : null;
}

/** Whether others stand in the way of a person that steps from here to a place. @param {Point} here @param {Point} place @param {Seen[]} others */
function isStopped(here, place, others) {
  const span = Math.hypot(...minus(place, here)), step = unit(minus(place, here));
  return others.map((other) => minus(stop(other), here)).some((gap) => {
    const far = Math.hypot(...gap), along = dot(gap, step), beyond = along - bounded(along, 0, span);
    return far ** 2 - along ** 2 + beyond ** 2 < Math.min(BODY, NEARER * far) ** 2;
  });
}
