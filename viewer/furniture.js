// The furniture of a town, drawn instead of plain blocks of its size: fountains, columns, market stalls, benches with lamps.
// No DOM, no three.js.

import { boxOf, frameOf, middleOf, quad, sides, turnedOf } from "./facets.js";

const ROUND_CORNERS = 12; // a ring with more corners is round
const SIZES = { // metres, minimum and maximum: height, width, and depth if it has four corners
  basin: [[0.4, 1.1], [3, 9]], column: [[2.2, 3.9], [0.7, 1.5]], stall: [[2, 2.6], [1.8, 3.4], [1, 1.8]], bench: [[0.4, 0.6], [1.4, 2.4], [0.4, 0.65]],
};
const STONE = "#cdc5b4", RIM = "#ded7c8", WATER = "#5d97a8", FOAM = "#cfe3e6";
const WOOD = "#8d6440", PLANK = "#a87a4d", IRON = "#39403f", PANE = "#f3e3b8", CLOTH = "#f4efe2";
const AWNINGS = ["#b8463c", "#3d7a70", "#c98a2e", "#4a6a96"];
const WARES = ["#c8552f", "#d99a2b", "#7f9a3d", "#8f3b46", "#e0c46a"];
const STRIPES = 7;
const LAMP_HIGH = 3.3; // metres

/** Triangles that are drawn instead of the walls of a block; null: it is no furniture. */
export function furnitureOf(block, number) {
  const { top, bottom } = block;
  const high = top[0].y - bottom, [long, wide] = [...sides(top)].sort((a, b) => b - a);
  const fits = (kind) => [high, long, wide].every((value, k) => !SIZES[kind][k] || (value >= SIZES[kind][k][0] && value <= SIZES[kind][k][1]));
  if (top.some(({ y }) => y !== top[0].y)) return null;
  if (top.length > ROUND_CORNERS && long - wide < 0.1 * long) {
    if (fits("basin")) return basinOf(middleOf(top), long / 2, bottom, high);
    if (fits("column")) return columnOf(middleOf(top), long / 2, bottom, high);
  }
  if (top.length === 4 && fits("stall")) return stallOf(frameOf(top), bottom, high, number);
  if (top.length === 4 && fits("bench")) return benchOf(frameOf(top), bottom, high, number % 2 === 0);
  return null;
}

/** A basin of water, with a bowl over it that overflows. */
function basinOf(middle, radius, y, high) {
  const top = y + high, bowl = Math.min(1.5, 0.45 * radius), water = top - 0.14;
  return [
    ...turnedOf(middle, [
      [radius, y], [radius, y + 0.14, STONE], [radius - 0.08, y + 0.16, STONE], [radius - 0.08, top - 0.12, STONE], [radius, top - 0.1, RIM],
      [radius, top, RIM], [radius - 0.36, top, RIM], [radius - 0.36, water, STONE], [bowl, water, WATER], [0.6, water, FOAM],
      [0.42, top + 0.3, STONE], [0.36, top + 0.7, STONE], [bowl - 0.2, top + 0.92, STONE], [bowl, top + 1.04, RIM], [bowl, top + 1.1, RIM],
      [bowl - 0.12, top + 1.1, RIM], [bowl - 0.14, top + 1.05, WATER], [0, top + 1.05, WATER],
    ]),
    ...Array.from({ length: 8 }, (_, k) => (k * Math.PI) / 4).flatMap((angle) => { // thin falls from its rim
      const at = { x: middle.x + (bowl + 0.03) * Math.cos(angle), z: middle.z + (bowl + 0.03) * Math.sin(angle) };
      return turnedOf(at, [[0.045, water], [0.02, top + 1.08, FOAM]]);
    }),
  ];
}

/** A stone column with foot and head, a ball on it. */
function columnOf(middle, radius, y, high) {
  const top = y + high, ball = 0.5 * radius;
  return turnedOf(middle, [
    [radius, y], [radius, y + 0.3, STONE], [0.8 * radius, y + 0.4, STONE], [0.55 * radius, y + 0.6, STONE], [0.45 * radius, top - 0.7, STONE],
    [0.7 * radius, top - 0.55, RIM], [0.7 * radius, top - 0.45, RIM], [0.2 * radius, top - 0.4, RIM],
    ...[-60, -30, 0, 30, 60].map((degrees) => (degrees * Math.PI) / 180).map((up) => [ball * Math.cos(up), top - ball + ball * Math.sin(up), RIM]),
    [0, top, RIM],
  ]);
}

/** A counter with wares, four posts, a striped awning with a lantern below. */
function stallOf(frame, y, high, number) {
  const { long, wide } = frame, [u, v] = [long / 2, wide / 2];
  const counter = y + 0.85, eaves = y + high - 0.05, ridge = eaves + 0.45, over = 0.3;
  const cloth = AWNINGS[number % AWNINGS.length];
  const parts = [
    ...boxOf(frame, [0.04 - u, y, 0.06 - v], [u - 0.04, counter, v - 0.06], PLANK),
    ...boxOf(frame, [-u, counter, -v], [u, counter + 0.06, v], WOOD),
    ...[[-1, -1], [1, -1], [1, 1], [-1, 1]].flatMap(([p, q]) => (
      boxOf(frame, [p * (u - 0.05) - 0.05, y, q * (v - 0.05) - 0.05], [p * (u - 0.05) + 0.05, eaves + 0.1, q * (v - 0.05) + 0.05], WOOD)
    )),
    ...boxOf(frame, [-0.09, eaves - 0.3, -0.09], [0.09, eaves - 0.05, 0.09], PANE, 1.6),
  ];
  for (let crate = 0; crate < 4; crate += 1) {
    const at = -u + ((crate + 0.5) * long) / 4;
    for (const side of [-1, 1]) {
      const colour = WARES[(number + crate + 2 * side + 2) % WARES.length];
      const [low, tall] = [Math.min(side * 0.08, side * (v - 0.1)), counter + 0.16 + 0.05 * ((number + crate) % 3)];
      parts.push(...boxOf(frame, [at - 0.22, counter + 0.06, low], [at + 0.22, tall, low + v - 0.18], colour));
    }
  }
  const reach = v + over, step = (long + 2 * 0.15) / STRIPES;
  const slope = Math.hypot(reach, ridge - eaves);
  for (let stripe = 0; stripe < STRIPES; stripe += 1) {
    const left = -u - 0.15 + stripe * step, colour = stripe % 2 ? CLOTH : cloth;
    for (const side of [-1, 1]) {
      const up = frame.turned(0, reach / slope, (side * (ridge - eaves)) / slope);
      const sheet = (lift) => [[left, eaves + lift, side * reach], [left + step, eaves + lift, side * reach], [left + step, ridge + lift, 0], [left, ridge + lift, 0]]
        .map((corner) => frame.at(...corner));
      parts.push(...quad(sheet(0), up, colour), ...quad(sheet(-0.02), { x: -up.x, y: -up.y, z: -up.z }, colour));
      parts.push(...boxOf(frame, [left, eaves - 0.2, side * reach - 0.01], [left + step, eaves, side * reach + 0.01], colour));
    }
  }
  return parts;
}

/** Planks on two feet of stone; with a lamp that stands at one end. */
function benchOf(frame, y, high, lamp) {
  const { long, wide } = frame, [u, v] = [long / 2, wide / 2];
  const seat = y + high, end = lamp ? u - 0.45 : u, plank = wide / 3;
  const parts = [-1, 1].flatMap((side) => {
    const at = side < 0 ? 0.25 - u : end - 0.25;
    return boxOf(frame, [at - 0.08, y, 0.05 - v], [at + 0.08, seat - 0.06, v - 0.05], STONE);
  });
  for (let row = 0; row < 3; row += 1) {
    parts.push(...boxOf(frame, [-u, seat - 0.06, row * plank - v + 0.015], [end, seat, (row + 1) * plank - v - 0.015], PLANK));
  }
  return lamp ? [...parts, ...lampOf(frame.at(u - 0.24, 0, 0), y)] : parts;
}

/** A lamp on an iron post. */
function lampOf(middle, y) {
  const top = y + LAMP_HIGH;
  return turnedOf(middle, [
    [0.12, y], [0.12, y + 0.25, IRON], [0.05, y + 0.4, IRON], [0.04, top - 0.5, IRON], [0.13, top - 0.46, IRON],
    [0.19, top - 0.08, PANE, 2], [0.22, top - 0.06, IRON], [0.05, top + 0.1, IRON], [0, top + 0.18, IRON],
  ]);
}
