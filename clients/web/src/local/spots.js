// Where people stop that share a goal: each at its own spot. It mirrors the server's world/scenes/spots.py, which
// explains the rules. World: metres.

import { apart } from "./steering.js";

/** @typedef {import("./scene.js").Point} Point */
/** @typedef {import("./company.js").Seen} Seen */

const NEAR = 5, APART = 0.65, STRANGERS = 0.48, SHARED = 0.3, SLACK = 0.1, RADIUS = 0.2, KEEPS = 0.1, WAY = 0.35, TOO_FAR = 10, LINE = 8;
export const FARTHEST = 2;
const RINGS = [[0.4, 8], [0.7, 12], [1.4, 18], [2.1, 24], [2.8, 30], [3.5, 36]];
/** @type {Point[]} */
const SPOTS = [[0, 0], ...RINGS.flatMap(([radius, count]) => Array.from({ length: count }, (_, k) => {
  const turn = (2 * Math.PI * k) / count;
  return /** @type {Point} */ ([radius * Math.cos(turn), radius * Math.sin(turn)]);
}))];

/**
 * Chooses where a person stops that walks to a goal if `concerned`. Returns the goal at that spot, and whether the spot
 * is too far from the goal to count as arrived. `room`: metres kept from walls.
 * @param {Seen[]} people @param {Seen} self @param {import("./company.js").Aims} aims its own, which change @param {import("./steering.js").GoalRow} goal
 * @param {boolean} concerned @param {((x: number, y: number) => number) | null} clear @param {number} room
 */
export function takeSpot(people, self, aims, goal, concerned, clear, room) {
  if (aims.asked[0] !== goal.place[0] || aims.asked[1] !== goal.place[1]) aims.spot = goal.place;
  aims.asked = goal.place;
  if (concerned) choose(people, self, aims, clear, room);
  const moved = apart(aims.spot, aims.asked) > 0 && goal.given && !goal.through;
  if (!moved) return { goal, far: false };
  const far = apart(aims.spot, aims.asked) > FARTHEST;
  return { goal: { ...goal, place: aims.spot, radius: Math.min(goal.radius, RADIUS) }, far };
}

/** @param {Seen[]} people @param {Seen} self @param {import("./company.js").Aims} aims @param {((x: number, y: number) => number) | null} clear @param {number} room */
function choose(people, self, aims, clear, room) {
  const place = self.position, goal = aims.asked;
  if (apart(goal, place) > NEAR) {
    aims.spot = goal;
    return;
  }
  const mine = apart(aims.spot, place), last = RINGS[RINGS.length - 1][0];
  const others = people.filter((other) => other !== self && apart(claim(other), goal) < last + APART);
  const taken = others.filter((other) => {
    const theirs = apart(claim(other), other.position);
    return other.stands || theirs < mine - KEEPS || (theirs <= mine + KEEPS && other.number < self.number);
  });
  const shares = (/** @type {Seen} */ other) => apart(other.aims.asked, goal) < SHARED;
  const by = (/** @type {Seen} */ other) => (shares(other) ? APART : STRANGERS);
  const home = (/** @type {Seen} */ other) => (other.memory.yields > 0 ? other.aims.spot : claim(other)); // it will return
  const empty = others.every((other) => !shares(other) && Math.min(apart(claim(other), goal), apart(home(other), goal)) >= APART);
  if (empty || (mine > RADIUS && !others.some((other) => apart(claim(other), goal) < by(other)))) {
    aims.spot = goal;
    return;
  }
  // a person that gets no nearer stops where it is
  const isTaken = mine > SLACK && taken.some((other) => apart(claim(other), aims.spot) - by(other) < -SLACK);
  if (!isTaken && apart(aims.spot, goal) <= FARTHEST) return;
  const spot = freeSpot(place, goal, others.map((other) => ({ spot: claim(other), by: by(other) })), clear, room);
  if (spot && (isTaken || apart(spot, goal) <= FARTHEST)) aims.spot = spot;
}

/**
 * The best free spot for a person at `place`.
 * @param {Point} place @param {Point} goal @param {{ spot: Point, by: number }[]} taken @param {((x: number, y: number) => number) | null} clear @param {number} room @returns {Point | null}
 */
function freeSpot(place, goal, taken, clear, room) {
  const way = [place[0] - goal[0], place[1] - goal[1]], length = Math.hypot(way[0], way[1]);
  const [x, y] = length > 1e-3 ? [way[0] / length, way[1] / length] : [1, 0];
  const spots = SPOTS.map(([u, v]) => /** @type {Point} */ ([goal[0] + u * x - v * y, goal[1] + u * y + v * x]));
  const costs = spots.map((spot) => {
    if (taken.some((other) => apart(other.spot, spot) < other.by) || !reaches(goal, spot, clear, room)) return Infinity;
    const off = apart(spot, goal);
    return off + WAY * apart(spot, place) + (off > FARTHEST ? TOO_FAR : 0);
  });
  const least = Math.min(...costs);
  return least < Infinity ? spots[costs.findIndex((cost) => cost <= least + 1e-4)] : null;
}

/** @param {Point} goal @param {Point} spot @param {((x: number, y: number) => number) | null} clear @param {number} room */
function reaches(goal, spot, clear, room) {
  if (!clear) return true;
  if (clear(spot[0], spot[1]) < room) return false;
  return Array.from({ length: LINE }, (_, k) => k / (LINE - 1)).every((share) =>
    clear(goal[0] + share * (spot[0] - goal[0]), goal[1] + share * (spot[1] - goal[1])) > 0);
}

/** Where a person stands, or will stand. @param {Seen} other */
const claim = (other) => (other.stands ? other.position : other.aims.spot);
