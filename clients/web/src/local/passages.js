// Doors and other narrow places: the order of passing, and where the others wait. It mirrors the server's
// world/scenes/passages.py, which explains the rules. World: metres.

import { dot, minus, times, unit } from "./steering.js";

/** @typedef {import("./scene.js").Point} Point */
/** @typedef {import("./company.js").Seen} Seen */

const NARROW = 0.55, OPEN = 0.6, INSIDE = 0.8, CONTEST = 2.5, HESITATES = 6, MOUTH = 1.3, ASIDE = 0.9, AGAINST = 0.3;

/**
 * Where a person waits before a narrow place on its way ahead, `points`; null: nowhere.
 * @param {Seen[]} people @param {Seen} self @param {Point[]} points @param {(x: number, y: number) => number} clear @returns {Point | null}
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
      off, nearer, inside: off < INSIDE, beyond: dot(minus(other.position, mouth), way) > 0,
      oncoming: along < -AGAINST, same: along > AGAINST,
    };
  });
  const place = /** @type {Point} */ ([mouth[0] - MOUTH * way[0] + ASIDE * way[1], mouth[1] - MOUTH * way[1] - ASIDE * way[0]]);
  if (others.some(({ oncoming, inside }) => oncoming && inside)) return place;
  if (others.some(({ same, inside }) => same && inside)) return null;
  const isFirst = !others.some(({ same, nearer, beyond }) => same && nearer && !beyond);
  if (isFirst && self.memory.waited > HESITATES) return null;
  return others.some(({ oncoming, beyond, nearer, off }) => oncoming && beyond && nearer && off < CONTEST) ? place : null;
}
