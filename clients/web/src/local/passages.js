// Doors and other narrow places: the order of passing, and where the others wait. It mirrors the server's
// world/scenes/passages.py, which explains the rules. World: metres.

import { dot, minus, plus, times, unit } from "./steering.js";

/** @typedef {import("./scene.js").Point} Point */
/** @typedef {import("./company.js").Seen} Seen */

const NARROW = 0.55, OPEN = 0.6, INSIDE = 0.8, CONTEST = 2.5, HESITATES = 6, AGAINST = 0.3;
const MOUTH = 0.9, ASIDE = 1.2, APART = 0.65, NEARER = 0.5, LAST = 100, BESIDE = 0.3, STAYS = 0.5, COASTS = 0.35, SLOW = 0.15;
const PLACES = Array.from({ length: 25 }, (_, k) => [MOUTH + APART * Math.floor(k / 5), ASIDE + APART * (k % 5)]).concat([[MOUTH, 0.9]]);

/**
 * Where a person waits before a narrow place on its way ahead, `points`, and whether it is there; null: it does not wait.
 * @param {Seen[]} people @param {Seen} self @param {Point[]} points @param {(x: number, y: number) => number} clear @returns {{ place: Point, there: boolean } | null}
 */
export function turn(people, self, points, clear) {
  const stretch = points.filter(([x, y]) => clear(x, y) < NARROW);
  if (!stretch.length || clear(...self.position) < OPEN) return null;
  const mouth = stretch[0], end = stretch[stretch.length - 1];
  const ahead = minus(mouth, self.position), mine = Math.hypot(...ahead);
  const whole = minus(end, mouth), long = Math.hypot(...whole);
  const way = long > 0.1 ? times(1 / long, whole) : times(1 / Math.max(mine, 1e-6), ahead);
  const gap = (/** @type {Seen} */ { position: [x, y] }) => Math.min(...stretch.map(([u, v]) => Math.hypot(x - u, y - v)));
  const own = gap(self);
  const others = people.filter((other) => other !== self && other.walks && other.aims.wants).map((other) => {
    const to = minus(other.aims.spot, other.position), along = dot(unit(to), way);
    const off = gap(other), nearer = off < own || (off === own && other.number < self.number);
    return {
      other, off, nearer, inside: off < INSIDE, beyond: dot(minus(other.position, mouth), way) > 0,
      oncoming: along < -AGAINST, same: along > AGAINST,
    };
  });
  const waits = () => {
    if (others.some(({ oncoming, inside }) => oncoming && inside)) return true;
    if (others.some(({ same, inside }) => same && inside)) return false;
    const isFirst = !others.some(({ same, nearer, beyond }) => same && nearer && !beyond);
    if (isFirst && self.memory.waited > HESITATES) return false;
    return others.some(({ oncoming, beyond, nearer, off }) => oncoming && beyond && nearer && off < CONTEST);
  };
  if (!waits()) return null;
  const mates = others.filter(({ same, beyond }) => same && !beyond).map(({ other }) => stop(other));
  const place = freePlace(mouth, way, stop(self), mates, clear);
  const there = Math.hypot(...minus(stop(self), place)) < (Math.hypot(...self.velocity) < SLOW ? STAYS : BESIDE);
  return { place, there };
}

/** Where a person would come to a stand. @param {Seen} person @returns {Point} */
const stop = ({ position, velocity }) => plus(position, times(COASTS, velocity));

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
