// Leads people around walls, and around each other. It mirrors the server's world/scenes (guide, planner,
// collision_avoidance, people) on a level floor, which explain the rules. World: metres, Z up.

import { ENDLESS, avoid, freshMemory } from "./avoidance.js";
import { Company } from "./company.js";
import { MakingWay } from "./making_way.js";
import { follow, lay, lengthOf, noRoute, passing, pointAt } from "./routes.js";
import { Unreachable } from "./scene.js";
import { STEP, STEP_SECONDS, WALKING, angleBetween, apart, bounded, minus, plus, times } from "./steering.js";

const FPS = 40;
const REACH = 1, SHARES = [1, 0.75, 0.5, 0.3, 0.15], LINE = 8;
const ROOM = 0.2, SLACK = 0.01, ELBOW = 0.18, CLOSE = 0.05, PUSH = [2.5, 0.25], PRESSED = 1.5;
const STRAYED = 1, DETOUR = 1;
const CURVE = [0.4, 1.6], BENDS = [(25 * Math.PI) / 180, (80 * Math.PI) / 180], CORNER_SPEED = [1.5, 0.75];
const NARROW = [0.02, 0.15], NARROW_SPEED = [0.8, 1.5];
const TURNED = 0.1;
const QUERIES = 4; // most ways computed in one step; others wait a step
const OFF = 1.2, ASTRAY = [0.5, 3], GOAL_MOVES = 0.4, GOAL_SHARE = 0.15, RETRY = 5;
export const MOVED = 0.01;
const FORESIGHT = 0.4, SLOW = 0.15;

/** @typedef {import("./scene.js").Point} Point */
/** @typedef {import("./person.js").Person} Person */
/** @typedef {import("./steering.js").GoalRow} GoalRow */
/** @typedef {import("./routes.js").Route} Route */
/** @typedef {import("./company.js").Row} Row */
/** @typedef {import("./company.js").Seen} Seen */
/**
 * `ahead` is the goal that steering sees, the next stretch of the way. `judged` is the goal by which arrival is judged.
 * @typedef {{ ahead: GoalRow, judged: GoalRow }} Course
 */
/**
 * A goal was moved to a place ("goal_moved"), no way leads to it ("unreachable"; the place can be reached), or people
 * stand in the way ("blocked").
 * @typedef {(person: Person, kind: string, waypoint: number, what: Point | Person[]) => void} Tell
 */

export class Guide {
  /** @type {WeakMap<Person, import("./company.js").Walker>} */
  #walkers = new WeakMap();
  #looks = 0; // in this step

  /** @param {import("./scene.js").LocalScene | null} scene null: the floor has no end @param {Tell} tell @param {boolean} avoid people avoid each other */
  constructor(scene, tell, avoid) {
    this.scene = /** @type {import("./scene.js").LocalScene} */ (scene); // methods for rows in a scene rely on it
    this.tell = tell;
    this.company = avoid ? new Company(scene, tell) : null;
    this.makingWay = avoid ? new MakingWay(scene) : null;
  }

  /**
   * Where the ways of people about to be stepped lead at present.
   * @param {import("./person.js").Begun[]} begun @param {Iterable<Person>} everybody @returns {Course[]}
   */
  courses(begun, everybody) {
    this.#looks = 0;
    const moment = Math.max(...begun.map(({ person }) => person.nextFrame));
    const people = [...everybody].map((person) => this.#seen(person, moment));
    /** @type {Row[]} */
    const rows = begun.map(({ person, start, gait, goal }) => {
      const self = /** @type {Seen} */ (people.find((other) => other.person === person));
      return { person, hips: start.hips, facing: start.facing, width: ENDLESS, gait, goal, ahead: goal, walker: this.#walker(person), self };
    });
    this.company?.place(rows, people);
    const courses = rows.map((row) => (this.scene ? this.#led(row, people) : this.#onFloor(row)));
    const led = rows.filter((_, k) => courses[k].leads);
    this.company?.bar(led, people);
    this.company?.takeTurns(led, people);
    this.company?.keepLanes(led, people);
    if (this.company && people.length > 1) for (const row of led) this.#bend(row, people);
    for (const row of rows) {
      this.company?.standClose(row, people);
      this.makingWay?.update(row, people);
    }
    return rows.map(({ ahead }, k) => ({ ahead, judged: courses[k].judged }));
  }

  /** @param {Person} person */
  #walker(person) {
    let walker = this.#walkers.get(person);
    if (!walker) {
      walker = { route: noRoute(), memory: freshMemory(), aims: { wants: false, asked: [0, 0], spot: [0, 0], barred: 0, stuck: 0, advanced: 0 } };
      this.#walkers.set(person, walker);
    }
    return walker;
  }

  /** Makes a person walk around others, or wait for them. A person that waits remembers where it would walk now, and for how long it has waited. @param {Row} row @param {Seen[]} people */
  #bend(row, people) {
    const { hips, goal, ahead, walker, self, width } = row;
    const way = minus(ahead.place, hips), distance = Math.max(Math.hypot(...way), 1e-6);
    /** @type {Point} */
    const preferred = [Math.fround((way[0] / distance) * ahead.speed), Math.fround((way[1] / distance) * ahead.speed)];
    if (!ahead.given) {
      walker.memory = { ...walker.memory, preferred, chosen: [0, 0], waited: Math.fround(walker.memory.waited + STEP) };
      return;
    }
    const left = goal.through ? Infinity : Math.fround(Math.hypot(...minus(goal.place, hips)));
    const course = avoid(people, self, preferred, this.company?.clear ?? null, STEP_SECONDS, left, width);
    walker.memory = course.memory;
    row.ahead = turned(ahead, hips, preferred, course.velocity, course.waits);
  }

  /** On the endless floor: the goal by which arrival is judged, and whether there is a way to go. @param {Row} row */
  #onFloor(row) {
    const { goal, gait, walker } = row, wanted = goal.given && !gait.arrived;
    begin(walker, wanted);
    row.ahead = goal;
    if (wanted) this.company?.leadOnFloor(row);
    return { judged: goal, leads: wanted };
  }

  /** The same in a scene. @param {Row} row @param {Seen[]} people */
  #led(row, people) {
    const { hips, gait, goal, walker } = row;
    const away = Math.hypot(...minus(goal.place, hips));
    const back = !goal.through && away > goal.radius + STRAYED && walker.memory.yields <= 0;
    const wanted = goal.given && (!gait.arrived || back);
    begin(walker, wanted);
    const route = this.#update(row, wanted), open = Boolean(route?.open);
    row.ahead = { ...goal, given: goal.given && (open || !wanted) };
    const left = route?.open ? lengthOf(route) - route.progress : Infinity;
    const judged = wanted && left > goal.radius + DETOUR ? { ...goal, radius: -1 } : goal;
    if (!wanted || !route?.open) return { judged, leads: false };
    row.ahead = this.#lead(route, hips, row.ahead, this.#crowded(row, people));
    return { judged, leads: true };
  }

  /** The route to a goal, computed if it is wanted and missing. @param {Row} row @param {boolean} wanted @returns {Route | undefined} */
  #update({ person, hips, gait: { waypoint }, goal, walker: { route, memory, aims } }, wanted) {
    const known = route.revision === person.revision && route.waypoint === waypoint ? route : undefined;
    const { wait } = route;
    let lost = false;
    if (known?.open) {
      const off = follow(known, hips), end = known.points[known.points.length - 1];
      const moved = Math.hypot(...minus(end, goal.place));
      const astray = off > OFF || (off > ASTRAY[0] && memory.waited > ASTRAY[1]);
      lost = moved > Math.max(GOAL_MOVES, GOAL_SHARE * (lengthOf(known) - known.progress)) || (astray && wait === 0);
    }
    route.wait = Math.max(wait - 1, 0);
    if (!wanted || (known && !lost && (known.open || known.wait > 0)) || this.#looks >= QUERIES) return known;
    this.#looks += 1;
    const isSpot = !apart(goal.place, aims.spot) && apart(aims.asked, aims.spot) > 0;
    this.#look(person, hips, waypoint, goal, route, Boolean(known), isSpot);
    return route;
  }

  /** Looks for the way to a goal, or to a spot beside others, which may be nearer to a wall than a goal. @param {Person} person @param {Point} hips @param {number} waypoint @param {GoalRow} goal @param {Route} route @param {boolean} known @param {boolean} isSpot */
  #look(person, hips, waypoint, goal, route, known, isSpot) {
    const { revision } = person, wasOpen = route.open;
    route.wait = RETRY;
    try {
      const { points, moved } = this.scene.path(hips, goal.place), end = points[points.length - 1];
      if (moved > MOVED && !isSpot) {
        person.moveGoal(waypoint, end);
        this.tell(person, "goal_moved", waypoint, end);
      }
      lay(route, points, revision, waypoint);
    } catch (error) {
      if (!(error instanceof Unreachable)) throw error;
      if (!known || wasOpen) this.tell(person, "unreachable", waypoint, error.nearest);
      Object.assign(route, { open: false, revision, waypoint });
    }
  }

  /** Whether a person walks in a crowd. @param {Row} row @param {Seen[]} people */
  #crowded({ self }, people) {
    const { position } = self;
    return Boolean(this.company) && people.some((other) => other !== self && other.walks && Math.hypot(...minus(other.position, position)) < PRESSED);
  }

  /** The point of the way to head for. @param {Route} route @param {Point} hips @param {GoalRow} goal @param {boolean} crowded @returns {GoalRow} */
  #lead(route, hips, goal, crowded) {
    const length = lengthOf(route), { progress } = route;
    const metres = SHARES.map((share) => Math.min(progress + REACH * share, length));
    const points = metres.map((at) => pointAt(route, at));
    const [near, far] = CURVE.map((at) => pointAt(route, Math.min(progress + at, length)));
    const { best, room } = this.#visible(hips, points, crowded ? CLOSE : ROOM);
    const into = minus(near, hips), out = minus(far, near);
    const bend = Math.hypot(...out) > 0.1 ? angleBetween(into, out) : 0;
    const most = Math.min(interpolated(bend, BENDS, CORNER_SPEED), interpolated(room, NARROW, NARROW_SPEED));
    const speed = Math.fround(Math.min(goal.speed, most));
    if (metres[best] >= length - 1e-6) return { ...goal, speed };
    const target = plus(points[best], this.#pushed(hips, crowded ? CLOSE : ELBOW));
    return passing({ ...goal, speed }, target, minus(target, hips));
  }

  /** The first of the points that a straight line reaches, and the room along the way. @param {Point} hips @param {Point[]} points @param {number} wide kept beyond the radius */
  #visible(hips, points, wide) {
    const here = this.scene.distance(...hips), ends = points.map(([x, y]) => this.scene.distance(x, y));
    const own = ends.map((_, k) => Math.min(...ends.slice(k)));
    const best = points.findIndex((point, k) => {
      const floor = Math.min(this.scene.radius + wide, own[k], here) - SLACK;
      for (let n = 0; n < LINE; n += 1) {
        const [x, y] = plus(hips, times(n / (LINE - 1), minus(point, hips)));
        if (this.scene.distance(x, y) < floor) return false;
      }
      return true;
    });
    return { best: best < 0 ? points.length - 1 : best, room: own[0] - this.scene.radius };
  }

  /** Metres to head aside, away from walls that are too near. @param {Point} hips @param {number} wide kept beyond the radius */
  #pushed(hips, wide) {
    const lacks = bounded(this.scene.radius + wide - this.scene.distance(...hips), 0, PUSH[1]);
    return times(PUSH[0] * lacks, this.scene.away(...hips));
  }

  /** A person as others see it at a world frame. @param {Person} person @param {number} moment @returns {Seen} */
  #seen(person, moment) {
    const { planned: { seed: { translation }, gait }, number, revision } = person;
    const { route, memory, aims } = this.#walker(person);
    const way = [translation[3] - translation[0], translation[4] - translation[1]];
    const pace = (gait.speed < SLOW ? 0 : gait.speed) / Math.max(Math.hypot(...way), 1e-6);
    const velocity = /** @type {Point} */ ([Math.fround(way[0] * pace), Math.fround(way[1] * pace)]);
    const ahead = bounded((moment - person.nextFrame) / FPS, -FORESIGHT, FORESIGHT);
    const onWay = aims.wants && !gait.arrived && (!this.scene || (route.open && route.revision === revision));
    const walks = onWay || gait.mode === WALKING;
    return {
      person, number, velocity, walks, memory, aims: { ...aims }, stands: !walks && !velocity[0] && !velocity[1],
      position: [Math.fround(translation[3] + velocity[0] * ahead), Math.fround(translation[4] + velocity[1] * ahead)],
    };
  }
}

/** Notes whether a person has a way to go, and for how long. A person that begins or ends a way no longer makes way. @param {import("./company.js").Walker} walker @param {boolean} wanted */
function begin(walker, wanted) {
  const { memory, aims } = walker;
  if (wanted !== aims.wants) {
    walker.memory = { ...memory, yields: 0 };
    Object.assign(aims, { wants: wanted, stuck: 0, advanced: 0 });
  }
  if (wanted) aims.stuck = Math.fround(aims.stuck + STEP);
}

/** @param {GoalRow} ahead @param {Point} hips @param {Point} preferred @param {Point} chosen @param {boolean} waits @returns {GoalRow} */
function turned(ahead, hips, preferred, chosen, waits) {
  if (waits) return { ...ahead, given: false };
  const speed = Math.fround(Math.hypot(...chosen));
  if (angleBetween(preferred, chosen) <= TURNED) return { ...ahead, speed };
  const way = times(1 / Math.max(speed, 1e-6), chosen);
  return passing({ ...ahead, speed }, plus(hips, times(REACH, way)), way);
}

/** @param {number} x @param {number[]} from @param {number[]} to */
const interpolated = (x, [a, b], [c, d]) => c + bounded((x - a) / (b - a), 0, 1) * (d - c);
