// Where to walk among others: sampled reciprocal velocity obstacles. The server's world/avoidance/kernel.py, where the
// rules are explained. World: metres, m/s, seconds.

import { bounded } from "./steering.js";

/** @typedef {import("./scene.js").Point} Point */
/**
 * The memory of a person from step to step.
 * @typedef {object} Memory
 * @property {Point} preferred where it would have gone @property {Point} chosen where it went
 * @property {number} waited seconds for which it has not got on @property {number} yields seconds for which it makes way
 * @property {Point} retreat unit vector in which it makes way
 */
/**
 * One of all people at a moment. `walks`: it has a way to go, so half of the task is its own.
 * @typedef {object} Other
 * @property {number} number of two who block each other the lower one goes first
 * @property {Point} position @property {Point} velocity @property {boolean} walks @property {Memory} memory
 */
/** @typedef {{ other: Other, dx: number, dy: number, distance: number }} Neighbour */

const RADIUS = Math.fround(0.22); // of a person among others
const TURNS = [0, 12, -12, 25, -25, 40, -40, 60, -60, 85, -85, 120, -120, 160], SPEEDS = [1, 0.6];
const FAN = SPEEDS.flatMap((speed) => TURNS.map((turn) => {
  const angle = (turn * Math.PI) / 180;
  return { x: Math.fround(speed * Math.cos(angle)), y: Math.fround(speed * Math.sin(angle)) };
}));
const NEIGHBOURS = 10, SIGHT = 8, HORIZON = 3.5, SOON = 0.3, CLOSE = 1.5, COMFORT = 0.35, REACTION = 0.25, SLOWEST = 0.5;
const WALL_ROOM = 0.1, WALL_SHARE = 0.42, LANES = 0.9, PASSING = 0.3, PASS_SHARE = 0.8, WALL_TIMES = [0.3, 0.7, 1.2];
const DEVIATION = 2, CHANGE = 0.7, COLLISION = 2.2, WALL = 15;
const PATIENCE = 1.25, YIELDING = Math.fround(1.6), YIELD_SPEED = 0.6, PUSH = 4, MIN_COMFORT = 0.15, HURRY = 2.5, SHORTEST = 1;
const BESIDE_STANDING = 0.1, STANDS_APART = 0.05;
const ALONG = 0.3, BEHIND = 0.1, FOLLOWS = 2, FIRM = 0.25, TOUCH = 6, TOUCHES = 0.15;
const OPPOSITE = 0.5, LANE = 0.6, LANE_SIGHT = 12, LANE_WIDE = 1.8, BESIDE = 1.2, LANE_SOON = 0.5, LANE_MOST = 0.8;
const EVEN = 1e-4, FACING = 0.3, BLOCKING = 1.6;

/** @returns {Memory} */
export const freshMemory = () => ({ preferred: [0, 0], chosen: [0, 0], waited: 0, yields: 0, retreat: [0, 0] });

/**
 * The velocity of a person that would walk at `preferred`, not zero, and its new memory.
 * `clear`: metres to the nearest wall; null: there are none. `seconds`: since it was asked last.
 * `left`: metres to where it will stop; `half`: half the width of its way.
 * @param {Other[]} people @param {Other} self @param {Point} preferred @param {((x: number, y: number) => number) | null} clear @param {number} seconds @param {number} [left] @param {number} [half]
 * @returns {{ velocity: Point, waits: boolean, memory: Memory }}
 */
export function avoid(people, self, preferred, clear, seconds, left = Infinity, half = Infinity) {
  const { memory } = self, near = neighbours(people, self);
  const way = memory.yields > 0 ? scaled(YIELD_SPEED, memory.retreat) : keepRight(people, self, preferred, Math.min(LANE, PASS_SHARE * half));
  const room = clear ? Math.min(RADIUS + WALL_ROOM, WALL_SHARE * half, clear(self.position[0], self.position[1])) : 0;
  const tried = candidates(way, memory.chosen);
  const costs = tried.map((each) => DEVIATION * apart(each, way) + CHANGE * apart(each, memory.chosen)
    + meetings(self, near, each, left, half) + (clear ? walls(self, each, clear, room) : 0));
  const least = Math.min(...costs), velocity = tried[costs.findIndex((cost) => cost <= least + EVEN)];
  const remembered = remember(self, preferred, velocity, seconds);
  return { velocity, waits: !velocity[0] && !velocity[1], memory: makeWay(remembered, self, near) };
}

/** Those in sight who are near now, or will be in a second. @param {Other[]} people @param {Other} self @returns {Neighbour[]} */
function neighbours(people, self) {
  const found = [];
  for (const other of people) {
    if (other === self) continue;
    const dx = Math.fround(other.position[0] - self.position[0]), dy = Math.fround(other.position[1] - self.position[1]);
    const square = dx * dx + dy * dy;
    if (square > SIGHT * SIGHT) continue;
    const distance = Math.sqrt(square);
    const soon = Math.hypot(dx + other.velocity[0] - self.velocity[0], dy + other.velocity[1] - self.velocity[1]);
    found.push({ other, dx, dy, distance, urgency: Math.fround(distance + soon) });
  }
  return found.sort((a, b) => a.urgency - b.urgency).slice(0, NEIGHBOURS);
}

/** The preferred velocity, turned to the right of oncoming people. @param {Other[]} people @param {Other} self @param {Point} preferred @param {number} lane @returns {Point} */
function keepRight(people, self, preferred, lane) {
  const speed = Math.max(Math.hypot(...preferred), 1e-6), ux = preferred[0] / speed, uy = preferred[1] / speed;
  let pair = 0, sum = 0, count = 0;
  for (const { position, walks, memory: { preferred: [x, y] } } of people) {
    const dx = Math.fround(position[0] - self.position[0]), dy = Math.fround(position[1] - self.position[1]);
    const ahead = dx * ux + dy * uy, left = dy * ux - dx * uy, fast = Math.max(Math.hypot(x, y), 1e-6);
    if (!walks || ahead <= 0 || ahead >= LANE_SIGHT || Math.abs(left) >= LANE_WIDE) continue;
    if (-(x * ux + y * uy) / fast <= OPPOSITE) continue;
    const aside = Math.max(lane - left, 0) / Math.max(ahead / (speed + fast), LANE_SOON);
    pair = Math.max(pair, aside * bounded(left + BESIDE, 0, 1));
    sum += aside;
    count += 1;
  }
  const stream = count ? (sum / count) * (1 - 1 / count) : 0;
  const sideways = Math.min(Math.max(pair, stream), LANE_MOST * speed);
  if (!sideways) return preferred;
  const x = preferred[0] + sideways * uy, y = preferred[1] - sideways * ux, turned = speed / Math.max(Math.hypot(x, y), 1e-6);
  return [Math.fround(turned * x), Math.fround(turned * y)];
}

/** The preferred velocity, a fan around it, the last one, a stop. @param {Point} way @param {Point} last @returns {Point[]} */
function candidates(way, last) {
  const speed = Math.hypot(way[0], way[1]), least = Math.min(SLOWEST, speed) / Math.max(speed, 1e-6);
  /** @type {Point[]} */
  const tried = FAN.map(({ x, y }) => {
    const length = Math.hypot(x, y), scale = Math.max(length, least) / length;
    return [Math.fround(scale * (x * way[0] - y * way[1])), Math.fround(scale * (x * way[1] + y * way[0]))];
  });
  tried.push(last, [0, 0]);
  return tried;
}

/** Cosine between the directions in which two would walk; 0 if one would not. @param {Other} self @param {Other} other */
function alongOf({ memory: { preferred: [px, py] } }, { memory: { preferred: [x, y] } }) {
  return (x * px + y * py) / Math.max(Math.hypot(x, y) * Math.hypot(px, py), 1e-6);
}

/** How soon and how nearly others are met. @param {Other} self @param {Neighbour[]} near @param {Point} tried @param {number} left @param {number} half */
function meetings(self, near, [vx, vy], left, half) {
  const [ux, uy] = self.velocity, touch = 2 * RADIUS;
  const { waited } = self.memory;
  const asked = Math.min(Math.max(COMFORT / (1 + waited / PUSH), MIN_COMFORT), Math.max(STANDS_APART, 0.25 * left));
  const soon = 1 / Math.max(HORIZON / Math.max(waited / HURRY, 1), SHORTEST);
  const last = Math.min(HORIZON, Math.max(left / Math.max(Math.hypot(vx, vy), 1e-3), SOON));
  let most = 0, sum = 0;
  for (const { other, dx: x, dy: y, distance } of near) {
    const [ox, oy] = other.velocity, fast = ox * ox + oy * oy;
    const along = alongOf(self, other), leads = other.walks && along > ALONG, moves = other.walks || fast > 0, patient = moves ? 1 : 1 + waited;
    const wide = touch + Math.min(asked, leads ? BEHIND : Infinity, moves ? Infinity : BESIDE_STANDING / patient);
    const room = half < LANES && other.walks && along < -OPPOSITE ? Math.min(wide, PASSING) : wide;
    const nextX = x + REACTION * (ox - ux), nextY = y + REACTION * (oy - uy), next = Math.max(Math.hypot(nextX, nextY), 1e-6);
    const presses = (TOUCH * bounded(((touch - next) * patient) / TOUCHES + 1, 0, 1)) / next;
    const share = other.walks && fast > 0.09 ? 1 + bounded((distance - touch) / CLOSE - 1, 0, 1) : 1;
    const wx = share * vx - ((share - 1) * ux + ox), wy = share * vy - ((share - 1) * uy + oy);
    const dx = x - REACTION * (ux - vx), dy = y - REACTION * (uy - vy);
    const slowly = 1 / Math.max(wx * wx + wy * wy, 1e-4);
    const at = Math.min(Math.max((wx * dx + wy * dy) * slowly, SOON), last);
    const gap = Math.hypot(dx - wx * at, dy - wy * at);
    const depth = Math.max(room - gap, 0) / (leads ? FIRM : COMFORT);
    const sooner = at - Math.sqrt(Math.max(room * room - gap * gap, 0) * slowly);
    const near = bounded(sooner * (leads ? Math.max(soon, 1 / FOLLOWS) : soon), 0, 1);
    const each = COLLISION * depth * (1 / (0.1 + near) - 1 / 1.1) + presses * Math.max(vx * nextX + vy * nextY, 0);
    most = Math.max(most, each);
    sum += each;
  }
  return most + 0.25 * sum;
}

/** How far a way leads into walls within the next second. @param {Other} self @param {Point} tried @param {(x: number, y: number) => number} clear @param {number} wanted */
function walls({ position, velocity }, [vx, vy], clear, wanted) {
  let most = 0;
  for (const time of WALL_TIMES) {
    const x = position[0] + REACTION * (velocity[0] - vx) + vx * time, y = position[1] + REACTION * (velocity[1] - vy) + vy * time;
    most = Math.max(most, wanted - clear(x, y));
  }
  return (WALL * most) / WALL_ROOM;
}

/** @param {Other} self @param {Point} preferred @param {Point} chosen @param {number} seconds @returns {Memory} */
function remember({ velocity, memory }, preferred, chosen, seconds) {
  const speed = Math.hypot(preferred[0], preferred[1]);
  const on = (velocity[0] * preferred[0] + velocity[1] * preferred[1]) / Math.max(speed, 1e-6);
  const passed = Math.fround(seconds), waited = on < 0.25 * speed ? Math.fround(memory.waited + passed) : 0;
  return { preferred, chosen, waited, yields: Math.max(Math.fround(memory.yields - passed), 0), retreat: memory.retreat };
}

/** Makes a person give way that has waited too long before others of lower numbers. @param {Memory} memory @param {Other} self @param {Neighbour[]} near @returns {Memory} */
function makeWay(memory, self, near) {
  if (memory.waited <= PATIENCE || memory.yields > 0) return memory;
  const mine = memory.preferred, pace = Math.max(Math.hypot(...mine), 1e-6);
  const first = near.find(({ other, dx, dy, distance }) => {
    const [x, y] = other.memory.preferred, speed = Math.max(Math.hypot(x, y), 1e-6);
    const towards = -(x * dx + y * dy) / (Math.max(distance, 1e-6) * speed);
    const along = (x * mine[0] + y * mine[1]) / (speed * pace);
    const [ox, oy] = other.velocity, slow = ox * ox + oy * oy < 0.25 * speed * speed;
    return other.walks && other.number < self.number && distance < BLOCKING && towards > FACING
      && along < OPPOSITE && slow;
  });
  if (!first) return memory;
  const [x, y] = first.other.memory.preferred, speed = Math.max(Math.hypot(x, y), 1e-6);
  const ahead = [x / speed, y / speed], along = -first.dx * ahead[0] - first.dy * ahead[1];
  const across = [-first.dx - along * ahead[0], -first.dy - along * ahead[1]];
  const wide = Math.max(Math.hypot(across[0], across[1]), 1e-6);
  const away = [ahead[0] + across[0] / wide, ahead[1] + across[1] / wide], long = Math.max(Math.hypot(away[0], away[1]), 1e-6);
  return { ...memory, waited: 0, yields: YIELDING, retreat: [Math.fround(away[0] / long), Math.fround(away[1] / long)] };
}

/** @param {number} s @param {Point} p @returns {Point} */
const scaled = (s, p) => [s * p[0], s * p[1]];
/** @param {Point} a @param {Point} b */
const apart = (a, b) => Math.hypot(a[0] - b[0], a[1] - b[1]);
