// Ways of people as lines: their progress, and the rest ahead. It mirrors the server's world/scenes/routes.py. World: metres.

import { bounded, minus, plus, times, unit } from "./steering.js";

const BACK = 0.5, WINDOW = 2, PASSED = 0.3;

/** @typedef {import("./scene.js").Point} Point */
/** @typedef {import("./steering.js").GoalRow} GoalRow */
/**
 * The way to one goal of a person's path. `open`: there is one; `wait`: steps until the next search.
 * @typedef {object} Route
 * @property {boolean} open @property {number} revision @property {number} waypoint @property {Point[]} points
 * @property {number[]} along metres to each point @property {number} progress metres already walked @property {number} wait
 */

/** @returns {Route} */
export const noRoute = () => ({ open: false, revision: -1, waypoint: -1, points: [], along: [], progress: 0, wait: 0 });

/**
 * Lead a person through points to the goal of a path.
 * @param {Route} route @param {Point[]} points @param {number} revision @param {number} waypoint
 */
export function lay(route, points, revision, waypoint) {
  const along = [0];
  for (let k = 1; k < points.length; k += 1) along.push(along[k - 1] + Math.hypot(...minus(points[k], points[k - 1])));
  Object.assign(route, { open: true, revision, waypoint, points, along, progress: 0 });
}

/** The part of a way more than `beyond` metres ahead. @param {Route} route @param {number} beyond @returns {Point[]} */
export function restOf(route, beyond) {
  const begin = route.progress + beyond;
  return [pointAt(route, begin), ...route.points.filter((_, k) => route.along[k] > begin)];
}

/** @param {Route} route */
export const lengthOf = ({ along }) => Math.fround(along[along.length - 1]);

/** Advances to the point of the way nearest to a place; returns its distance, metres. @param {Route} route @param {Point} place */
export function follow(route, place) {
  const { points, along, progress } = route;
  let best = Infinity, at = progress;
  for (let k = 0; k + 1 < points.length; k += 1) {
    const low = Math.max(along[k], progress - BACK), high = Math.min(along[k + 1], progress + WINDOW);
    if (low > high) continue;
    const way = times(1 / Math.max(along[k + 1] - along[k], 1e-9), minus(points[k + 1], points[k]));
    const offset = minus(place, points[k]);
    const share = Math.min(Math.max(offset[0] * way[0] + offset[1] * way[1], low - along[k]), high - along[k]);
    const gap = Math.hypot(...minus(offset, times(share, way)));
    if (gap < best) [best, at] = [gap, along[k] + share];
  }
  if (points.length < 2) best = Math.hypot(...minus(place, points[0]));
  route.progress = Math.fround(at);
  return best;
}

/** @param {Route} route @param {number} metres @returns {Point} */
export function pointAt({ points, along }, metres) {
  if (points.length < 2) return points[0];
  let k = 0;
  while (k < points.length - 2 && along[k + 1] <= metres) k += 1;
  const share = bounded((metres - along[k]) / Math.max(along[k + 1] - along[k], 1e-9), 0, 1);
  return plus(points[k], times(share, minus(points[k + 1], points[k])));
}

/** The goal at another place, to be passed through. @param {GoalRow} goal @param {Point} place @param {Point} way @returns {GoalRow} */
export function passing(goal, place, way) {
  return { ...goal, place, through: true, radius: PASSED, heading: goal.strafe ? goal.heading : null, bend: 0, onward: unit(way) };
}
