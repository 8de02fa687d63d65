// Narrow ways: how wide they are, where two keep apart in them, and how they turn their shoulders. It mirrors
// the server's world/scenes/lanes.py, which explains the rules. World: metres.

import { REACTION } from "./avoidance.js";
import { bounded, dot, minus, plus, times } from "./steering.js";

/** @typedef {import("./scene.js").Point} Point */
/** @typedef {import("./company.js").Seen} Seen */
/** @typedef {{ width: import("./avoidance.js").Width, keeps: boolean, place: Point, turn: number, way: Point }} Lane */

const REACH = 1.2, STEP = 0.1, THIN = 0.15, LANES = 0.9, LANE = 0.4, STEERS = 0.3, BACK = 4, DRIFT = 0.5, SEES = 7, PAST = -0.3;
const AGAINST = 0.5, TURNS = [0.46, 0.66], TURN = (40 * Math.PI) / 180, SQUEEZE = [0.23, 0.29], TURN_SECONDS = 1.4;
export const SIDEWAYS = 0.9;

/**
 * The lane of one of the people, whose way leads through `points` next. `clear`: metres to the nearest wall.
 * @param {Seen[]} people @param {Seen} self @param {Point[]} points @param {(x: number, y: number) => number} clear @returns {Lane}
 */
export function lane(people, self, points, clear) {
  const last = points[points.length - 1], whole = minus(last, points[0]);
  const way = times(1 / Math.max(Math.hypot(...whole), 1e-6), whole), right = /** @type {Point} */ ([way[1], -way[0]]);
  const walls = points.map((point) => [-1, 1].map((sign) => wall(point, times(sign, right), clear)));
  const sides = walls.map(([before, after]) => [-before.far, after.far]), least = Math.min(...walls.map(([before, after]) => before.open + after.open)) / 2;
  const halves = sides.map(([low, high]) => (high - low) / 2), half = Math.max(...halves);
  const [low, high] = sides[sides.length - 1];
  let keeps = false, passes = false;
  for (const { position, velocity, walks, memory: { preferred } } of people) {
    const apart = minus(position, self.position), ahead = dot(apart, way);
    const against = dot(preferred, way) / Math.max(Math.hypot(...preferred), 1e-6) < -AGAINST;
    if (!walks || !against || ahead <= PAST || ahead >= SEES || Math.abs(dot(apart, right)) >= 2 * LANES) continue;
    keeps = half < LANES;
    passes ||= ahead < Math.max(dot(minus(self.velocity, velocity), way), 0.5) * TURN_SECONDS;
  }
  const wanted = (high + low) / 2 + (LANE * (high - low)) / 2;
  const off = wanted - dot(minus(plus(self.position, times(REACTION, self.velocity)), last), right);
  const turn = Math.max(passes ? narrower(half, TURNS) + BACK * Math.min(off, 0) : 0, narrower(Math.min(...halves), SQUEEZE));
  return { width: { most: half, least }, keeps, place: plus(last, times(wanted + STEERS * off - DRIFT * turn, right)), turn, way };
}

/** How far a wall is from a point of a way, also where a place near it counts as one in it (`open`). @param {Point} point @param {Point} side @param {(x: number, y: number) => number} clear */
function wall(point, side, clear) {
  let far = 0, open = 0, thin = true;
  for (let k = 0; k * STEP < REACH + 1e-6; k += 1) {
    const room = clear(...plus(point, times(k * STEP, side)));
    if (room <= 0) break;
    far = Math.max(far, k * STEP + room);
    thin &&= room > THIN;
    if (thin) open = Math.max(open, k * STEP + room);
  }
  return { far, open };
}

/** Radians by which shoulders are turned in a way of that half width. @param {number} half @param {number[]} between */
const narrower = (half, [low, high]) => TURN * (1 - bounded((half - low) / (high - low), 0, 1));
