// Leads people through a scene: ways around walls, and around each other. The server's world/scenes (guide, planner,
// routes, collision_avoidance, people) on a level floor, where the rules are explained. World: metres, Z up.

import { avoid, freshMemory } from "./avoidance.js";
import { Unreachable } from "./scene.js";
import { STEP_SECONDS, WALKING, bounded, minus, plus, times, unit } from "./steering.js";

const FPS = 40;
const REACH = 1, SHARES = [1, 0.75, 0.5, 0.3, 0.15], LINE = 8;
const ROOM = 0.2, SLACK = 0.01, ELBOW = 0.18, PUSH = [2.5, 0.25];
const STRAYED = 1, DETOUR = 1;
const CURVE = [0.4, 1.6], BENDS = [(25 * Math.PI) / 180, (80 * Math.PI) / 180], CORNER_SPEED = [1.5, 0.75];
const NARROW = [0.02, 0.15], NARROW_SPEED = [0.8, 1.5];
const PASSED = 0.3, TURNED = 0.1;
const QUERIES = 4; // ways that one step looks for; others wait a step
const OFF = 1.2, ASTRAY = [0.5, 3], GOAL_MOVES = 0.4, GOAL_SHARE = 0.15, RETRY = 5;
export const MOVED = 0.01;
const BACK = 0.5, WINDOW = 2;
const FORESIGHT = 0.4, SLOW = 0.15;

/** @typedef {import("./scene.js").Point} Point */
/** @typedef {import("./person.js").Person} Person */
/** @typedef {import("./steering.js").GoalRow} GoalRow */
/** `ahead`: the goal that steering sees, the next stretch of the way; `judged`: by which arrival is judged. @typedef {{ ahead: GoalRow, judged: GoalRow }} Course */
/**
 * The way to one goal of a person's path. `open`: there is one; `wait`: steps until it is looked for again.
 * @typedef {object} Route
 * @property {boolean} open @property {number} revision @property {number} waypoint @property {Point[]} points
 * @property {number[]} along metres to each point @property {number} progress metres that lie behind @property {number} wait
 */

export class Guide {
  /** @type {WeakMap<Person, Route>} */
  #routes = new WeakMap();
  /** @type {WeakMap<Person, import("./avoidance.js").Memory>} */
  #memories = new WeakMap();
  #looks = 0; // in this step

  /**
   * `tell(person, kind, waypoint, place)`: a goal was moved to a place ("goal_moved"), or no way leads to it
   * ("unreachable"; the place can be reached).
   * @param {import("./scene.js").LocalScene} scene @param {(person: Person, kind: string, waypoint: number, place: Point) => void} tell
   */
  constructor(scene, tell) {
    this.scene = scene;
    this.tell = tell;
  }

  /**
   * Where the ways of people who are about to be stepped lead for now.
   * @param {import("./person.js").Begun[]} begun @param {Iterable<Person>} everybody @returns {Course[]}
   */
  courses(begun, everybody) {
    this.#looks = 0;
    const led = begun.map((state) => this.#led(state));
    const walkers = begun.flatMap((state, k) => (led[k].leads ? [{ state, ahead: led[k].ahead, k }] : []));
    if (!walkers.length) return led;
    const moment = Math.max(...begun.map(({ person }) => person.nextFrame));
    const seen = new Map([...everybody].map((person) => [person, this.#seen(person, moment)]));
    if (seen.size < 2) return led;
    const people = [...seen.values()];
    for (const { state: { person, start }, ahead, k } of walkers) {
      const self = /** @type {import("./avoidance.js").Other} */ (seen.get(person));
      const way = minus(ahead.place, start.hips), distance = Math.max(Math.hypot(...way), 1e-6);
      /** @type {Point} */
      const preferred = [Math.fround((way[0] / distance) * ahead.speed), Math.fround((way[1] / distance) * ahead.speed)];
      const course = avoid(people, self, preferred, (x, y) => this.scene.distance(x, y), STEP_SECONDS);
      this.#memories.set(person, course.memory);
      led[k].ahead = turned(ahead, start.hips, preferred, course.velocity, course.waits);
    }
    return led;
  }

  /** @param {import("./person.js").Begun} state @returns {Course & { leads: boolean }} */
  #led({ person, start, gait, goal }) {
    const away = Math.hypot(...minus(goal.place, start.hips));
    const back = !goal.through && away > goal.radius + STRAYED;
    const wanted = goal.given && (!gait.arrived || back);
    const route = this.#update(person, start.hips, gait.waypoint, goal, wanted);
    const open = Boolean(route?.open);
    const ahead = { ...goal, given: goal.given && (open || !wanted) };
    const left = route?.open ? lengthOf(route) - route.progress : Infinity;
    const judged = wanted && left > goal.radius + DETOUR ? { ...goal, radius: -1 } : goal;
    if (!wanted || !route?.open) return { ahead, judged, leads: false };
    return { ahead: this.#lead(route, start.hips, ahead), judged, leads: true };
  }

  /** The route to a goal, looked for where it is wanted and there is none. @param {Person} person @param {Point} hips @param {number} waypoint @param {GoalRow} goal @param {boolean} wanted @returns {Route | undefined} */
  #update(person, hips, waypoint, goal, wanted) {
    const route = this.#routes.get(person);
    const known = route && route.revision === person.revision && route.waypoint === waypoint ? route : undefined;
    const wait = route?.wait ?? 0;
    let lost = false;
    if (known?.open) {
      const off = follow(known, hips), end = known.points[known.points.length - 1];
      const moved = Math.hypot(...minus(end, goal.place));
      const waits = (this.#memories.get(person)?.waited ?? 0) > ASTRAY[1], astray = off > OFF || (off > ASTRAY[0] && waits);
      lost = moved > Math.max(GOAL_MOVES, GOAL_SHARE * (lengthOf(known) - known.progress)) || (astray && wait === 0);
    }
    if (route) route.wait = Math.max(wait - 1, 0);
    if (!wanted || (known && !lost && (known.open || known.wait > 0)) || this.#looks >= QUERIES) return known;
    this.#looks += 1;
    const found = this.#look(person, hips, waypoint, goal, known);
    this.#routes.set(person, found);
    return found;
  }

  /** @param {Person} person @param {Point} hips @param {number} waypoint @param {GoalRow} goal @param {Route | undefined} known @returns {Route} */
  #look(person, hips, waypoint, goal, known) {
    const { revision } = person;
    try {
      const { points, moved } = this.scene.path(hips, goal.place), end = points[points.length - 1];
      if (moved > MOVED) {
        person.moveGoal(waypoint, end);
        this.tell(person, "goal_moved", waypoint, end);
      }
      const along = [0];
      for (let k = 1; k < points.length; k += 1) along.push(along[k - 1] + Math.hypot(...minus(points[k], points[k - 1])));
      return { open: true, revision, waypoint, points, along, progress: 0, wait: RETRY };
    } catch (error) {
      if (!(error instanceof Unreachable)) throw error;
      if (!known || known.open) this.tell(person, "unreachable", waypoint, error.nearest);
      return { open: false, revision, waypoint, points: [], along: [], progress: 0, wait: RETRY };
    }
  }

  /** The point of the way to head for. @param {Route} route @param {Point} hips @param {GoalRow} goal @returns {GoalRow} */
  #lead(route, hips, goal) {
    const length = lengthOf(route), { progress } = route;
    const metres = SHARES.map((share) => Math.min(progress + REACH * share, length));
    const points = metres.map((at) => pointAt(route, at));
    const [near, far] = CURVE.map((at) => pointAt(route, Math.min(progress + at, length)));
    const { best, room } = this.#visible(hips, points);
    const into = minus(near, hips), out = minus(far, near);
    const bend = Math.hypot(...out) > 0.1 ? angleBetween(into, out) : 0;
    const most = Math.min(interpolated(bend, BENDS, CORNER_SPEED), interpolated(room, NARROW, NARROW_SPEED));
    const speed = Math.fround(Math.min(goal.speed, most));
    if (metres[best] >= length - 1e-6) return { ...goal, speed };
    const target = plus(points[best], this.#pushed(hips));
    return passing({ ...goal, speed }, target, minus(target, hips));
  }

  /** The first of the points that a straight line leads to, and the room that the way leaves. @param {Point} hips @param {Point[]} points */
  #visible(hips, points) {
    const here = this.scene.distance(...hips), ends = points.map(([x, y]) => this.scene.distance(x, y));
    const own = ends.map((_, k) => Math.min(...ends.slice(k)));
    const best = points.findIndex((point, k) => {
      const floor = Math.min(this.scene.radius + ROOM, own[k], here) - SLACK;
      for (let n = 0; n < LINE; n += 1) {
        const [x, y] = plus(hips, times(n / (LINE - 1), minus(point, hips)));
        if (this.scene.distance(x, y) < floor) return false;
      }
      return true;
    });
    return { best: best < 0 ? points.length - 1 : best, room: own[0] - this.scene.radius };
  }

  /** Metres to head aside, away from walls that are too near. @param {Point} hips */
  #pushed(hips) {
    const lacks = bounded(this.scene.radius + ELBOW - this.scene.distance(...hips), 0, PUSH[1]);
    return times(PUSH[0] * lacks, this.scene.away(...hips));
  }

  /** A person as others see it at a world frame. @param {Person} person @param {number} moment @returns {import("./avoidance.js").Other} */
  #seen(person, moment) {
    const { planned: { seed: { translation }, gait }, number } = person;
    const way = [translation[3] - translation[0], translation[4] - translation[1]];
    const pace = (gait.speed < SLOW ? 0 : gait.speed) / Math.max(Math.hypot(...way), 1e-6);
    const velocity = /** @type {Point} */ ([Math.fround(way[0] * pace), Math.fround(way[1] * pace)]);
    const ahead = bounded((moment - person.nextFrame) / FPS, -FORESIGHT, FORESIGHT);
    const route = this.#routes.get(person);
    const onWay = Boolean(route?.open) && route?.revision === person.revision && !gait.arrived;
    return {
      number, velocity, walks: onWay || gait.mode === WALKING, memory: this.#memories.get(person) ?? freshMemory(),
      position: [Math.fround(translation[3] + velocity[0] * ahead), Math.fround(translation[4] + velocity[1] * ahead)],
    };
  }
}

/** @param {GoalRow} ahead @param {Point} hips @param {Point} preferred @param {Point} chosen @param {boolean} waits @returns {GoalRow} */
function turned(ahead, hips, preferred, chosen, waits) {
  if (waits) return { ...ahead, given: false };
  const speed = Math.fround(Math.hypot(...chosen));
  if (angleBetween(preferred, chosen) <= TURNED) return { ...ahead, speed };
  const way = times(1 / Math.max(speed, 1e-6), chosen);
  return passing({ ...ahead, speed }, plus(hips, times(REACH, way)), way);
}

/** The goal at another place, to be passed through. @param {GoalRow} goal @param {Point} place @param {Point} way @returns {GoalRow} */
function passing(goal, place, way) {
  return { ...goal, place, through: true, radius: PASSED, heading: goal.strafe ? goal.heading : null, bend: 0, onward: unit(way) };
}

/** @param {Route} route */
const lengthOf = ({ along }) => Math.fround(along[along.length - 1]);

/** Go on to the point of the way nearest to a place; metres it is off. @param {Route} route @param {Point} place */
function follow(route, place) {
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
function pointAt({ points, along }, metres) {
  if (points.length < 2) return points[0];
  let k = 0;
  while (k < points.length - 2 && along[k + 1] <= metres) k += 1;
  const share = bounded((metres - along[k]) / Math.max(along[k + 1] - along[k], 1e-9), 0, 1);
  return plus(points[k], times(share, minus(points[k + 1], points[k])));
}

/** @param {number} x @param {number[]} from @param {number[]} to */
const interpolated = (x, [a, b], [c, d]) => c + bounded((x - a) / (b - a), 0, 1) * (d - c);

/** Radians between vectors of any length. @param {Point} a @param {Point} b */
function angleBetween(a, b) {
  const length = Math.max(Math.hypot(...a), 1e-6) * Math.max(Math.hypot(...b), 1e-6);
  return Math.acos(bounded((a[0] * b[0] + a[1] * b[1]) / length, -1, 1));
}
