// Where to walk among others: of some ways, the best one. The server's world/avoidance/, where the
// rules are explained. World: metres, m/s, seconds.

import { apart, bounded, times } from "./steering.js";

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
 * @property {{ spot: Point }} aims where it will stand
 */
/**
 * Metres: half of the greatest and of the least width of a way over the next metre.
 * @typedef {{ most: number, least: number }} Width
 */
/** @typedef {{ other: Other, dx: number, dy: number, distance: number }} Neighbour */

const RADIUS = Math.fround(0.22); // of a person among others
const TURNS = [0, 12, -12, 25, -25, 40, -40, 60, -60, 85, -85, 120, -120];
const FAN = TURNS.map((turn) => ({ x: Math.cos((turn * Math.PI) / 180), y: Math.sin((turn * Math.PI) / 180) }));
const NEIGHBOURS = 10, SIGHT = 8, HORIZON = 3.5, SHORTEST = 0.7, SOON = 0.3, CLOSE = 1.5, SLOWEST = 0.5;
export const REACTION = 0.3;
const COMFORT = 0.35, SHARE = 0.5, APART = 0.05, SETS_OFF = 0.5, HEADWAY = 0.6, HEADWAY_AT_DOORS = 0.45, DEEP = 0.55, SQUEEZE = 0.95;
const WAY = [0.2, 0.4, 0.7, 1], WALL_ROOM = 0.1, WALL_SLACK = 0.04, WALL_SHARE = 0.42, LANES = 0.9, PASSING = 0.3, PASS_SHARE = 0.8;
const DEVIATION = 2, CHANGE = 0.7, COLLISION = 1.8, WALL = 1, TOUCH = 12, NEXT = 0.5, EVEN = 1e-4;
const PUSH = 2, PATIENCE = 2.5, YIELDING = Math.fround(1.6), YIELD_SPEED = 0.6, BLOCKING = 1.6, FACING = 0.3;
const OPPOSITE = 0.5, LANE = 0.6, LANE_SIGHT = 12, LANE_WIDE = 1.8, BESIDE = 1.2, LANE_SOON = 0.5, LANE_MOST = 0.8;

/** @type {Width} */
export const ENDLESS = { most: Infinity, least: Infinity };

/** @returns {Memory} */
export const freshMemory = () => ({ preferred: [0, 0], chosen: [0, 0], waited: 0, yields: 0, retreat: [0, 0] });

/**
 * The velocity of a person that would walk at `preferred`, not zero, and its new memory.
 * `clear`: metres to the nearest wall; null: there are none. `seconds`: since it was asked last.
 * `left`: metres to where it will stop; `width`: of its way.
 * @param {Other[]} people @param {Other} self @param {Point} preferred @param {((x: number, y: number) => number) | null} clear @param {number} seconds @param {number} [left] @param {Width} [width]
 * @returns {{ velocity: Point, waits: boolean, memory: Memory }}
 */
export function avoid(people, self, preferred, clear, seconds, left = Infinity, width = ENDLESS) {
  const half = width.most, headway = width.least < LANES ? HEADWAY_AT_DOORS : HEADWAY;
  const { memory, memory: { chosen } } = self, near = neighbours(people, self);
  const aim = memory.yields > 0 ? times(YIELD_SPEED, memory.retreat) : keepRight(people, self, preferred, Math.min(LANE, PASS_SHARE * half));
  const speed = Math.hypot(...aim), slowest = Math.min(SLOWEST, speed);
  let least = Infinity, velocity = /** @type {Point} */ ([0, 0]);
  ways(aim, chosen).forEach((way, k) => {
    const walls = clear ? wallsOn(self, way, clear, half) : { free: Infinity, cost: 0 };
    let pace = Math.min(speed, walls.free / headway);
    for (const each of near) pace = Math.min(pace, freePace(self, each, way, speed, headway));
    const waits = pace <= SETS_OFF * slowest || (!way[0] && !way[1]);
    pace = waits ? 0 : Math.max(pace, slowest);
    const tried = times(pace, way);
    let cost = DEVIATION * apart(tried, aim) + walls.cost * pace + speed * meetings(self, near, tried, left, half);
    if (chosen[0] || chosen[1]) cost += CHANGE * apart(tried, chosen);
    if (cost >= least - EVEN) return;
    least = cost;
    velocity = !k && pace === speed ? aim : [Math.fround(tried[0]), Math.fround(tried[1])];
  });
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
  for (const other of people) {
    const { position, walks, memory: { preferred: [x, y] } } = other;
    const dx = Math.fround(position[0] - self.position[0]), dy = Math.fround(position[1] - self.position[1]);
    const ahead = dx * ux + dy * uy, left = dy * ux - dx * uy, fast = Math.max(Math.hypot(x, y), 1e-6);
    if (!walks || ahead <= 0 || ahead >= LANE_SIGHT || Math.abs(left) >= LANE_WIDE) continue;
    if (-(x * ux + y * uy) / fast <= OPPOSITE || !areAgainst(self, other)) continue;
    const aside = Math.max(lane - left, 0) / Math.max(ahead / (speed + fast), LANE_SOON);
    pair = Math.max(pair, aside * bounded(left + BESIDE, 0, 1));
    sum += aside;
    count += 1;
  }
  const stream = count ? (sum / count) * (1 - 1 / count) : 0;
  const sideways = Math.min(Math.max(pair, stream), LANE_MOST * speed) / (1 + self.memory.waited / PUSH);
  if (!sideways) return preferred;
  const x = preferred[0] + sideways * uy, y = preferred[1] - sideways * ux, turned = speed / Math.max(Math.hypot(x, y), 1e-6);
  return [Math.fround(turned * x), Math.fround(turned * y)];
}

/** Directions: a fan around the aim, the last one, a stop. @param {Point} aim @param {Point} last @returns {Point[]} */
function ways([x, y], last) {
  const speed = Math.max(Math.hypot(x, y), 1e-6);
  const fan = FAN.map((way) => /** @type {Point} */ ([Math.fround((way.x * x - way.y * y) / speed), Math.fround((way.x * y + way.y * x) / speed)]));
  const before = Math.max(Math.hypot(...last), 1e-6);
  return [...fan, [Math.fround(last[0] / before), Math.fround(last[1] / before)], [0, 0]];
}

/** Cosine between the directions in which two would walk; 0 if one would not. @param {Other} self @param {Other} other */
function alongOf({ memory: { preferred: [px, py] } }, { memory: { preferred: [x, y] } }) {
  return (x * px + y * py) / Math.max(Math.hypot(x, y) * Math.hypot(px, py), 1e-6);
}

/** Whether the places where two will stand lie in opposite directions. @param {Other} self @param {Other} other */
function areAgainst({ position: [px, py], aims: { spot: [sx, sy] } }, { position: [x, y], aims: { spot } }) {
  return Math.fround(sx - px) * Math.fround(spot[0] - x) + Math.fround(sy - py) * Math.fround(spot[1] - y) <= 0;
}

/** Whether a person is more in the way of another one, which goes its way, than that one in its. @param {Other} self @param {Neighbour} near */
function precedes(self, { other, dx, dy }) {
  const [px, py] = self.memory.preferred, [x, y] = other.memory.preferred;
  const behind = (x * dx + y * dy) / Math.max(Math.hypot(x, y), 1e-6) + (px * dx + py * dy) / Math.max(Math.hypot(px, py), 1e-6);
  return (behind < 0 || (!behind && self.number < other.number)) && x * px + y * py > 0;
}

/** The pace at which a way is free, as one other has it. @param {Other} self @param {Neighbour} near @param {Point} way @param {number} speed @param {number} headway */
function freePace(self, near, [wayX, wayY], speed, headway) {
  const { other, dx: x, dy: y } = near, [ux, uy] = self.velocity, [ox, oy] = other.velocity;
  const toX = x + REACTION * (ox - ux), toY = y + REACTION * (oy - uy);
  const narrow = precedes(self, near) ? SQUEEZE : Math.max(1 / (1 + self.memory.waited / PUSH), SQUEEZE);
  const touch = 2 * RADIUS * (other.walks ? narrow : 1);
  const ahead = toX * wayX + toY * wayY, aside = toY * wayX - toX * wayY, share = Math.min((aside * aside) / (touch * touch), 1);
  let pace = share < 1 && ahead > 0 ? (ahead - DEEP * touch * Math.sqrt(1 - share)) / headway : Infinity;
  const wx = speed * wayX - ox, wy = speed * wayY - oy, square = Math.max(wx * wx + wy * wy, 1e-4);
  const on = toX * wx + toY * wy, beside = toY * wx - toX * wy, depth = touch * touch - (beside * beside) / square;
  if (on > 0 && depth > 0) pace = Math.min(pace, (speed * (on / square - Math.sqrt(depth / square))) / headway);
  return pace;
}

/** How soon and how nearly others are met. @param {Other} self @param {Neighbour[]} near @param {Point} tried @param {number} left @param {number} half */
function meetings(self, near, [vx, vy], left, half) {
  const [ux, uy] = self.velocity, touch = 2 * RADIUS;
  const soon = 1 / Math.max(HORIZON / (1 + self.memory.waited / PUSH), SHORTEST);
  const last = Math.min(HORIZON, Math.max(left / Math.max(Math.hypot(vx, vy), 1e-3), SOON));
  let most = 0, sum = 0;
  for (const { other, dx: x, dy: y, distance } of near) {
    const [ox, oy] = other.velocity, room = Math.max(Math.min(COMFORT, SHARE * (distance - touch), 0.25 * left), APART);
    const oncoming = half < LANES && other.walks && alongOf(self, other) < -OPPOSITE, wide = oncoming ? Math.min(touch + room, PASSING) : touch + room;
    const share = other.walks && ox * ox + oy * oy > 0.09 ? 1 + bounded((distance - touch) / CLOSE - 1, 0, 1) : 1;
    const wx = share * vx - ((share - 1) * ux + ox), wy = share * vy - ((share - 1) * uy + oy);
    const dx = x - REACTION * (ux - vx), dy = y - REACTION * (uy - vy);
    const slowly = 1 / Math.max(wx * wx + wy * wy, 1e-4);
    const at = Math.min(Math.max((wx * dx + wy * dy) * slowly, SOON), last);
    const gap = Math.hypot(dx - wx * at, dy - wy * at);
    const depth = Math.min((COLLISION / room) * Math.max(wide - gap, 0), COLLISION);
    const sooner = at - Math.sqrt(Math.max(wide * wide - gap * gap, 0) * slowly);
    const next = Math.hypot(x + NEXT * (ox - vx), y + NEXT * (oy - vy));
    const each = depth * (1 - bounded(sooner * soon, 0, 1)) + TOUCH * Math.max(touch - next, 0);
    most = Math.max(most, each);
    sum += each;
  }
  return most + 0.25 * sum;
}

/** Metres of a way that are free of walls, and what 1 m/s costs near a wall. @param {Other} self @param {Point} way @param {(x: number, y: number) => number} clear @param {number} half */
function wallsOn({ position: [x, y], velocity: [ux, uy] }, [wayX, wayY], clear, half) {
  const here = Math.min(WALL_SHARE * half, clear(x, y)), wanted = Math.min(RADIUS + WALL_ROOM, here), needed = Math.min(RADIUS - WALL_SLACK, here);
  let lack = 0, free = Infinity, before = 0;
  for (const far of WAY) {
    const room = clear(x + REACTION * ux + far * wayX, y + REACTION * uy + far * wayY);
    lack = Math.max(lack, wanted - room);
    if (room < needed - 1e-4) free = Math.min(free, before);
    before = far;
  }
  return { free, cost: (WALL * Math.min(lack, WALL_ROOM)) / WALL_ROOM };
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
      && along < 0 && slow && areAgainst(self, other);
  });
  if (!first) return memory;
  const [x, y] = first.other.memory.preferred, speed = Math.max(Math.hypot(x, y), 1e-6);
  const ahead = [x / speed, y / speed], along = -first.dx * ahead[0] - first.dy * ahead[1];
  const across = [-first.dx - along * ahead[0], -first.dy - along * ahead[1]];
  const wide = Math.max(Math.hypot(across[0], across[1]), 1e-6);
  const away = [ahead[0] + across[0] / wide, ahead[1] + across[1] / wide], long = Math.max(Math.hypot(away[0], away[1]), 1e-6);
  return { ...memory, waited: 0, yields: YIELDING, retreat: [Math.fround(away[0] / long), Math.fround(away[1] / long)] };
}
