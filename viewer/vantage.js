// Where the first people of a scene walk, and a view of them: near, with whole people. No DOM, no three.js.

import { middleOf } from "./facets.js";
import { contains } from "./ground.js";

const SEARCHED = [0, 2, 4.5, 7]; // metres from the middle
const ROOM = [1, 2]; // metres around a person that should be ground
const NEARNESS = 1.5; // samples of ground that a metre towards the middle is worth
const LOW = 0.6; // metres over the lowest ground
const EYE = { wide: [[6, 3.2], [6.5, 5], [5, 8.5]], tall: [[6.5, 3.4], [7, 5.5], [6, 9]] }; // metres off and up
const LOOKED_AT = { up: 0.75, inward: 0.4 }; // metres up, share of the way to the middle
const DIRECTIONS = 8;
const VIEWS = 24; // directions that are tried for the eye
const SIGHTS = 6; // lines of sight on either side of the middle
const DEPTHS = [0.7, 1]; // where they end, as shares of the way to the focus: at the first people, and in their middle
const TALL = 1.2; // metres over the ground: lower blocks hide nobody
const AROUND = 30; // metres: farther blocks are not in front
const HIGHER = 3; // lines of sight that a higher eye must win
const TURNED = 4; // lines of sight that an eye aside must win, per radian: the middle should be behind the people
const WAIST = 0.6; // metres: the end of a line of sight above the ground
const MARGIN = 0.4; // metres that awnings and roofs reach beyond their block
const FEW = 0.7; // fraction of the samples: with less ground, fewer people have more space
const SLIM = 0.8; // fraction of the radius in a picture that is higher than wide
const WELCOME = { roomy: { count: 10, radius: 2.8 }, narrow: { count: 6, radius: 6 } };

/**
 * { eye, target, area: { x, z, radius }, count } for a level (scene_level.js), whose middle is { x, z }: `count` people walk in
 * `area`. `opening`: half the picture's width at a distance of a metre; `tall`: the picture is higher than wide.
 */
export function vantageOf(level, middle, { opening, tall }) {
  const { focus, share } = focusOf(level, middle);
  const { count, radius } = share < FEW ? WELCOME.narrow : WELCOME.roomy;
  const base = level.heightAt(focus.x, focus.z, level.base);
  const inward = (axis) => focus[axis] + LOOKED_AT.inward * (middle[axis] - focus[axis]);
  const target = { x: inward("x"), y: base + LOOKED_AT.up, z: inward("z") };
  const ahead = Math.atan2(focus.x - middle.x, focus.z - middle.z); // from the middle towards them; 0 is +Z
  const near = ({ top }) => top.some(({ x, y, z }) => y > base + TALL && Math.hypot(x - focus.x, z - focus.z) < AROUND);
  const blocks = level.solids.filter(near).map(grown);
  let best = { cost: Infinity };
  for (const [number, reach] of EYE[tall ? "tall" : "wide"].entries()) {
    for (const turn of turns(VIEWS)) {
      const worse = HIGHER * number + TURNED * Math.abs(turn);
      if (worse >= best.cost) continue;
      const eye = eyeAt(focus, base, ahead + turn, reach);
      const cost = worse + hiddenFrom(eye, { ...focus, y: base + WAIST }, Math.min(radius / reach[0], opening), blocks);
      if (cost < best.cost) best = { eye, cost };
    }
  }
  return { eye: best.eye, target, area: { ...focus, radius: tall ? SLIM * radius : radius }, count };
}

/** The place near the middle with most ground around it, and the fraction of the samples that is ground. */
function focusOf(level, middle) {
  let best = { worth: -Infinity };
  for (const away of SEARCHED) {
    for (const turn of away ? turns() : [0]) {
      const focus = { x: middle.x + away * Math.sin(turn), z: middle.z + away * Math.cos(turn) };
      const around = ROOM.flatMap((radius) => turns().map((angle) => ({ x: focus.x + radius * Math.sin(angle), z: focus.z + radius * Math.cos(angle) })));
      const free = isLow(level, focus) ? around.filter((point) => isLow(level, point)).length : 0;
      const worth = free - NEARNESS * away;
      if (free && worth > best.worth) best = { worth, focus, share: free / around.length };
    }
  }
  return best.focus ? best : { focus: { x: middle.x, z: middle.z }, share: 0 };
}

function isLow(level, { x, z }) {
  const height = level.ground.heightAt(x, z, level.base);
  return height !== null && height < level.base + LOW;
}

/** Directions, by the size of their turn. */
function turns(count = DIRECTIONS) {
  return Array.from({ length: count }, (_, k) => (Math.ceil(k / 2) * (k % 2 ? 1 : -1) * 2 * Math.PI) / count);
}

function eyeAt({ x, z }, base, direction, [away, up]) {
  return { x: x + away * Math.sin(direction), y: base + up, z: z + away * Math.cos(direction) };
}

/** A block with what is drawn beyond its walls: awnings, roofs, edges. */
function grown({ top, bottom }) {
  const middle = middleOf(top);
  const ring = top.map(({ x, z }) => {
    const share = 1 + MARGIN / Math.hypot(x - middle.x, z - middle.z);
    return { x: middle.x + share * (x - middle.x), z: middle.z + share * (z - middle.z) };
  });
  return { ring, bottom, top: Math.max(...top.map(({ y }) => y)) + MARGIN };
}

/** How much of a picture of the people around the focus has a block in front: of the lines of sight, those in the middle count twice. */
function hiddenFrom(eye, focus, opening, blocks) {
  const ahead = { x: focus.x - eye.x, z: focus.z - eye.z };
  let hidden = 0;
  for (const away of DEPTHS) {
    for (let k = -SIGHTS; k <= SIGHTS; k += 1) {
      const aside = (opening * k) / SIGHTS;
      const end = { x: eye.x + away * (ahead.x + aside * ahead.z), y: focus.y, z: eye.z + away * (ahead.z - aside * ahead.x) };
      if (blocks.some((block) => meets(block, eye, end))) hidden += 2 - Math.abs(k) / SIGHTS;
    }
  }
  return hidden;
}

/** Whether a line from the eye down to a point meets a block. */
function meets({ ring, bottom, top }, eye, end) {
  const way = { x: end.x - eye.x, z: end.z - eye.z };
  let [first, last] = [contains(ring, eye) ? 0 : Infinity, contains(ring, end) ? 1 : -Infinity]; // of the line above or below it
  ring.forEach((a, k) => {
    const b = ring[(k + 1) % ring.length];
    const side = { x: b.x - a.x, z: b.z - a.z }, off = { x: a.x - eye.x, z: a.z - eye.z };
    const across = way.x * side.z - way.z * side.x;
    const along = (off.x * side.z - off.z * side.x) / across, at = (off.x * way.z - off.z * way.x) / across;
    if (!(along >= 0 && along <= 1 && at >= 0 && at <= 1)) return;
    first = Math.min(first, along);
    last = Math.max(last, along);
  });
  const height = (along) => eye.y + along * (end.y - eye.y);
  return first <= last && height(first) > bottom && height(last) < top;
}
