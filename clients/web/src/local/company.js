// The effect of others on a person's goal and way: where it stops, and whether its way is blocked. It mirrors the
// server's world/scenes (company, detours), which explain the rules. World: metres.

import { wayAround } from "./around.js";
import { SIDEWAYS, lane } from "./lanes.js";
import { turn } from "./passages.js";
import { follow, lay, lengthOf, passing, pointAt, restOf } from "./routes.js";
import { FARTHEST, takeSpot } from "./spots.js";
import { STEP, STRAFING, angleBetween, dot, minus, plus, times } from "./steering.js";

const REACH = 1, TOLD = 3.9, STUCK = 8, PACE = Math.fround(0.2), NEAR = 1.5, SHUFFLE = 0.3, WAITS = 0.4, GOAL_MOVES = 0.3;
export const PATIENCE = 2.5, TOUCH = 0.4;
const AHEAD = Array.from({ length: 20 }, (_, k) => 0.2 + 0.2 * k);
const IN_WAY = 0.36, PASSES = 0.42, AROUND = 8, ASIDE = 5, CELL = 0.15, SLACK = 0.05, LONGER = 2, BIT = 1, STOPS = 1.2;
const BEFORE = [0.1, 0.4, 0.7, 1], CLOSE = 0.62, TURNED = 0.25, RETRY = 5, SLOW = 0.15;

/** @typedef {import("./scene.js").Point} Point */
/** @typedef {import("./person.js").Person} Person */
/** @typedef {import("./steering.js").GoalRow} GoalRow */
/**
 * Where a person goes among others, from step to step. `wants`: it has a way to go; `asked`: the goal that it
 * received. `spot`: where it will stand. `barred`: seconds for which standing people have blocked its way. `stuck`:
 * seconds by which it has fallen behind a slow pace since the last "blocked". `advanced`: metres along its way,
 * negative while it makes up for having gone back.
 * @typedef {{ wants: boolean, asked: Point, spot: Point, barred: number, stuck: number, advanced: number }} Aims
 */
/** State kept of a person. @typedef {{ route: import("./routes.js").Route, memory: import("./avoidance.js").Memory, aims: Aims }} Walker */
/** A person as others see it at a moment. @typedef {import("./avoidance.js").Other & { person: Person, aims: Aims, stands: boolean }} Seen */
/** A person about to be stepped; `goal`, `ahead` and `width` are replaced. @typedef {{ person: Person, hips: Point, facing: Point, width: import("./avoidance.js").Width, gait: import("./steering.js").Gait, goal: GoalRow, ahead: GoalRow, walker: Walker, self: Seen }} Row */

export class Company {
  /** @param {import("./scene.js").LocalScene | null} scene @param {import("./guide.js").Tell} tell */
  constructor(scene, tell) {
    this.scene = scene;
    this.tell = tell;
    this.clear = scene && ((/** @type {number} */ x, /** @type {number} */ y) => scene.distance(x, y));
  }

  /** Moves goals to the spots where people will stand; a person that can reach no near spot waits. @param {Row[]} rows @param {Seen[]} people */
  place(rows, people) {
    for (const row of rows) {
      const { gait, goal, walker: { aims } } = row;
      if (!goal.given || gait.arrived) aims.barred = 0;
      if (people.length < 2) continue;
      const concerned = goal.given && !goal.through && !gait.arrived;
      const found = takeSpot(people, row.self, aims, goal, concerned, this.clear, this.scene?.radius ?? 0);
      row.goal = found.goal;
      if (!found.far) continue;
      const waits = Math.hypot(...minus(aims.spot, row.hips)) < WAITS;
      if (waits) this.#wait(row, people);
      row.goal = { ...row.goal, radius: -1, given: !waits };
    }
  }

  /** Lead people around others standing in their way, or make them wait. @param {Row[]} rows @param {Seen[]} people */
  bar(rows, people) {
    const found = rows.map((row) => ({ row, by: this.#inTheWay(row, people) }));
    for (const { row: { walker: { aims, route } }, by } of found) {
      aims.barred = by.length ? Math.fround(aims.barred + STEP) : 0;
      if (!this.scene) route.wait = Math.max(route.wait - 1, 0);
    }
    const due = found.filter(({ row, by }) => by.length && !row.walker.route.wait);
    const longest = Math.max(...due.map(({ row }) => row.walker.aims.barred));
    const first = due.find(({ row }) => row.walker.aims.barred === longest);
    if (first) {
      first.row.walker.route.wait = RETRY;
      if (this.#look(first.row, people)) first.by = [];
    }
    for (const { row, by } of found) {
      const { person, hips, walker: { aims } } = row;
      const gaps = by.map(({ position }) => Math.hypot(...minus(position, hips))), near = Math.min(...gaps);
      const waits = near < STOPS + (person.planned.gait.speed < SLOW ? SHUFFLE : 0);
      const reported = by.length > 0 && aims.barred >= TOLD && aims.barred < TOLD + STEP, stuck = isStuck(row);
      this.#settle(row, waits, people);
      if (waits) row.ahead = { ...row.ahead, given: false, place: by[gaps.indexOf(near)].position }; // it asks that one to make way
      if (reported) aims.stuck = 0;
      if (stuck && !reported) {
        const others = people.filter(({ position, person: other }) => other !== person && Math.hypot(...minus(position, hips)) < NEAR);
        this.tell(person, "blocked", person.waypoint, others.map((other) => other.person));
      }
      if (reported) this.tell(person, "blocked", person.waypoint, by.map((other) => other.person));
    }
  }

  /** Makes people wait before narrow places that others come out of. @param {Row[]} rows @param {Seen[]} people */
  takeTurns(rows, people) {
    if (!this.clear || people.length < 2) return;
    for (const row of rows) {
      if (!row.ahead.given) continue;
      const found = turn(people, row.self, this.#ahead(row, AHEAD), this.clear);
      if (!found) continue;
      row.ahead = found.there ? { ...row.ahead, given: false } : passing(row.ahead, found.place, minus(found.place, row.hips));
    }
  }

  /** Keeps people to the right in narrow ways, and turns their shoulders there. @param {Row[]} rows @param {Seen[]} people */
  keepLanes(rows, people) {
    if (!this.clear) return;
    for (const row of rows) {
      if (!row.ahead.given) continue;
      const { width, keeps, place, turn: angle, way } = lane(people, row.self, this.#ahead(row, BEFORE), this.clear);
      row.width = { most: Math.fround(width.most), least: Math.fround(width.least) };
      if (keeps && row.ahead.through) row.ahead = { ...row.ahead, place };
      const turned = row.person.planned.gait.mode === STRAFING && angleBetween(row.facing, way) > TURNED;
      if (row.ahead.strafe || !(turned || angle > TURNED)) continue;
      const heading = plus(times(Math.cos(angle), way), times(Math.sin(angle), [way[1], -way[0]]));
      row.ahead = { ...row.ahead, heading, strafe: true, speed: Math.min(row.ahead.speed, Math.fround(SIDEWAYS)) };
    }
  }

  /** Notes whether others are beside a person. @param {Row} row @param {Seen[]} people */
  standClose(row, people) {
    const { self } = row;
    row.ahead = { ...row.ahead, close: people.some((other) => other !== self && Math.hypot(...minus(other.position, self.position)) < CLOSE) };
  }

  /** The way around others on the endless floor. @param {Row} row */
  leadOnFloor(row) {
    const { route } = row.walker;
    if (!isLed(row)) return;
    if (Math.hypot(...minus(route.points[route.points.length - 1], row.goal.place)) > GOAL_MOVES) {
      route.open = false;
      return;
    }
    follow(route, row.hips);
    if (lengthOf(route) - route.progress <= REACH) return;
    const [target] = this.#ahead(row, [REACH]);
    row.ahead = passing(row.ahead, target, minus(target, row.hips));
  }

  /** Stops a person that is near its goal and gets no nearer, if it is in nobody there. @param {Row} row @param {boolean} barred @param {Seen[]} people */
  #settle({ hips, goal, self, walker: { aims, memory } }, barred, people) {
    const off = Math.hypot(...minus(aims.asked, hips));
    if (goal.through || off >= FARTHEST || !(barred || memory.waited > PATIENCE)) return;
    const touches = people.some((other) => other !== self && other.stands && Math.hypot(...minus(other.position, self.position)) < TOUCH);
    if (!touches) aims.spot = hips;
  }

  /** Reports, once, that a person waits at a spot too far from its goal. @param {Row} row @param {Seen[]} people */
  #wait({ person, walker: { aims } }, people) {
    if (aims.barred < TOLD) {
      const others = people.filter(({ stands, position }) => stands && Math.hypot(...minus(position, aims.asked)) < FARTHEST);
      this.tell(person, "blocked", person.waypoint, others.map((other) => other.person));
      aims.barred = TOLD + 0.1; // now it has been told
    }
    aims.barred = Math.fround(aims.barred + STEP);
  }

  /** Points on a person's way. @param {Row} row @param {number[]} metres ahead */
  #ahead(row, metres) {
    const { hips, goal, walker: { route } } = row;
    if (isLed(row)) return metres.map((at) => pointAt(route, Math.min(route.progress + at, lengthOf(route))));
    const way = minus(goal.place, hips), length = Math.hypot(...way);
    return metres.map((at) => plus(hips, times(Math.min(at, length) / Math.max(length, 1e-6), way)));
  }

  /** @param {Row} row @param {Seen[]} people */
  #inTheWay(row, people) {
    const stand = people.filter((other) => other.stands && other !== row.self);
    if (!stand.length) return stand;
    const points = this.#ahead(row, AHEAD);
    return stand.filter(({ position }) => points.some((point) => Math.hypot(...minus(point, position)) < IN_WAY));
  }

  /** Looks for a way around others, and takes it; whether there is one. @param {Row} row @param {Seen[]} people */
  #look(row, people) {
    const { hips, goal, walker: { route }, person } = row;
    const [back] = this.#ahead(row, [AROUND]);
    const low = [0, 1].map((k) => Math.min(hips[k], back[k]) - ASIDE);
    const [columns, rows] = [0, 1].map((k) => Math.ceil((Math.max(hips[k], back[k]) + ASIDE - low[k]) / CELL));
    const x = Array.from({ length: columns }, (_, k) => low[0] + CELL * k), y = Array.from({ length: rows }, (_, k) => low[1] + CELL * k);
    const stand = people.filter(({ stands, position: [u, v], person: other }) => stands && other !== person
      && u > low[0] && v > low[1] && u < x[columns - 1] && v < y[rows - 1]);
    const room = new Float64Array(rows * columns);
    y.forEach((v, r) => x.forEach((u, c) => {
      let most = this.scene ? this.scene.distance(u, v) - (this.scene.radius - SLACK) : Infinity;
      for (const { position: [px, py] } of stand) most = Math.min(most, Math.hypot(u - px, v - py) - PASSES);
      room[columns * r + c] = most;
    }));
    const cell = (/** @type {Point} */ p) => /** @type {[number, number]} */ ([Math.round((p[1] - low[1]) / CELL), Math.round((p[0] - low[0]) / CELL)]);
    const corners = wayAround({ room, rows, columns }, cell(hips), cell(back));
    if (!corners.length) return false;
    const points = corners.map(([r, c]) => /** @type {Point} */ ([x[c], y[r]]));
    points[0] = hips;
    if (Math.hypot(...minus(cell(back), corners[corners.length - 1])) === 0) points[points.length - 1] = back; // else somebody stands there
    let length = 0;
    for (let k = 1; k < points.length; k += 1) length += Math.hypot(...minus(points[k], points[k - 1]));
    const left = isLed(row) ? lengthOf(route) - route.progress : Math.hypot(...minus(goal.place, hips));
    if (length > LONGER * Math.min(AROUND, left) + BIT) return false;
    const rest = isLed(row) ? restOf(route, AROUND) : [goal.place];
    const goesOn = Math.hypot(...minus(rest[rest.length - 1], points[points.length - 1])) > CELL;
    lay(route, goesOn ? [...points, ...rest] : points, person.revision, person.waypoint);
    return true;
  }
}

/** Notes how far a person has got on. Returns whether it has fallen too far behind; its count begins again then. @param {Row} row before its way is bent */
function isStuck({ hips, ahead, self: { velocity }, walker: { aims } }) {
  const way = minus(ahead.place, hips);
  const advanced = Math.fround(aims.advanced + (STEP * dot(velocity, way)) / Math.max(Math.hypot(...way), 1e-6));
  const seconds = Math.fround(aims.stuck - Math.max(advanced, 0) / PACE);
  Object.assign(aims, { advanced: Math.min(advanced, 0), stuck: seconds >= STUCK ? 0 : Math.max(seconds, 0) });
  return seconds >= STUCK;
}

/** Whether there is a way to a person's present goal. @param {Row} row */
function isLed({ person, walker: { route } }) {
  return route.open && route.revision === person.revision && route.waypoint === person.waypoint;
}
