// Doors and other narrow places: the order of passing, and where the others wait. It mirrors the server's
// world/scenes/passages.py, which explains the rules. World: metres.

import { dot, minus, plus, times, unit } from "./steering.js";

/** @typedef {import("./scene.js").Point} Point */
/** @typedef {import("./company.js").Seen} Seen */

const BESIDE_WAY = 0.5, NARROW = 1.65, LANES = [1.1, 0.9], OPEN = 0.6, INSIDE = 0.8, ENTERS = 0.2, CONTEST = 2.5, EAGER = 1, HESITATES = 6, AGAINST = 0.3;
const MOUTH = 0.9, ASIDE = 1.2, APART = 0.65, NEARER = 0.5, LAST = 100, BESIDE = 0.3, STAYS = 0.5, COASTS = 0.35, SLOW = 0.15;
const PLACES = Array.from({ length: 25 }, (_, k) => [MOUTH + APART * Math.floor(k / 5), ASIDE + APART * (k % 5)]).concat([[MOUTH, 0.9]]);

/**
 * Where a person waits before a narrow place on its way ahead, `points`, and whether it is there; null: it does not wait.
 * @param {Seen[]} people @param {Seen} self @param {Point[]} points @param {(x: number, y: number) => number} clear @returns {{ place: Point, there: boolean } | null}
 */
export function turn(people, self, points, clear) {
  const [own, ...widths] = widthsOf([self.position, ...points], clear);
  const stretch = points.filter((_, k) => widths[k] < NARROW);
  if (!stretch.length || own < NARROW) return null;
  const mouth = stretch[0], end = stretch[stretch.length - 1];
  const ahead = minus(mouth, self.position), mine = Math.hypot(...ahead);
  const whole = minus(end, mouth), long = Math.hypot(...whole);
  if (long > LANES[1] && Math.min(...widths) > LANES[0]) return null;
  const way = long > 0.1 ? times(1 / long, whole) : times(1 / Math.max(mine, 1e-6), ahead);
  const gap = (/** @type {Seen} */ { position: [x, y] }) => Math.min(...stretch.map(([u, v]) => Math.hypot(x - u, y - v)));
  const seen = (/** @type {Seen} */ other) => {
    const along = dot(unit(minus(other.aims.spot, other.position)), way), off = gap(other);
    const closing = dot(other.velocity, way) * (along < 0 ? -1 : 1), at = dot(minus(other.position, mouth), way);
    return {
      other, off, due: off - EAGER * Math.max(closing, 0), inside: off < INSIDE && (along < 0 ? at < long + ENTERS : at > -ENTERS),
      beyond: at > 0, oncoming: along < -AGAINST, same: along > AGAINST,
    };
  };
  const others = people.filter((other) => other !== self && other.walks && other.aims.wants).map(seen);
  const mates = others.filter(({ same, beyond }) => same && !beyond);
  const waits = () => {
    if (others.some(({ oncoming, inside }) => oncoming && inside)) return true;
    if (others.some(({ same, inside }) => same && inside)) return false;
    const theirs = others.filter(({ oncoming, beyond, off }) => oncoming && beyond && off < CONTEST);
    const leader = first([...mates, seen(self)]);
    return theirs.length > 0 && (leader.other !== self || self.memory.waited <= HESITATES) && first([leader, ...theirs]) !== leader;
  };
  if (!waits()) return null;
  const place = freePlace(mouth, way, stop(self), mates.map(({ other }) => stop(other)), clear);
  const there = Math.hypot(...minus(stop(self), place)) < (Math.hypot(...self.velocity) < SLOW ? STAYS : BESIDE);
  return { place, there };
}

/** Metres from wall to wall across a way; large beside one wall. @param {Point[]} points @param {(x: number, y: number) => number} clear */
const widthsOf = (points, clear) => points.map((point, k) => {
  const [from, to] = k < points.length - 1 ? [point, points[k + 1]] : [points[k - 1], point];
  const step = minus(to, from), size = BESIDE_WAY / Math.max(Math.hypot(...step), 1e-6);
  const right = /** @type {Point} */ ([step[1] * size, -step[0] * size]);
  return 2 * BESIDE_WAY + clear(...plus(point, right)) + clear(...minus(point, right));
});

/** The one that is due first; of two alike, that of the lower number. @template {{ due: number, other: Seen }} T @param {T[]} those @returns {T} */
const first = (those) => those.reduce((a, b) => (b.due < a.due || (b.due === a.due && b.other.number < a.other.number) ? b : a));

/** Where a person would come to a stand. @param {Seen} person @returns {Point} */
export const stop = ({ position, velocity }) => plus(position, times(COASTS, velocity));

/** Where a person waits: where nobody else stands, or stops sooner. @param {Point} mouth @param {Point} way @param {Point} mine @param {Point[]} mates @param {(x: number, y: number) => number} clear @returns {Point} */
function freePlace(mouth, way, mine, mates, clear) {
  const places = PLACES.map(([back, aside]) => /** @type {Point} */ ([
    mouth[0] - back * way[0] + aside * way[1], mouth[1] - back * way[1] - aside * way[0],
  ]));
  const costs = places.map((place, k) => {
    const off = Math.hypot(...minus(mine, place));
    const taken = mates.some((other) => Math.hypot(...minus(other, place)) < Math.min(APART, off));
    const cost = taken || clear(...place) <= OPEN ? Infinity : off + NEARER * Math.hypot(...minus(place, mouth));
    return k < places.length - 1 ? cost : Math.min(cost, LAST);
  });
  const least = Math.min(...costs);
  return places[costs.findIndex((cost) => cost <= least + 1e-4)];
}
