// Where the first people of a scene walk, and a view of them: near, with whole people. No DOM, no three.js.

const SEARCHED = [0, 2, 4.5, 7]; // metres from the middle
const ROOM = [1, 2]; // metres around a person that should be ground
const NEARNESS = 1.5; // samples of ground that a metre towards the middle is worth
const LOW = 0.6; // metres over the lowest ground
const EYE = { wide: [[7, 3.2], [7, 5], [5, 8.5]], tall: [[7, 3.4], [7, 5.5], [6, 9]] }; // metres off and up: the first that is free
const LOOKED_AT = { up: 0.75, inward: 0.4, beside: 1.5 }; // metres up, share of the way to the middle, metres
const DIRECTIONS = 8;
const FEW = 0.7; // fraction of the samples: with less ground, fewer people have more space
const SLIM = 0.8; // fraction of the radius in a picture that is higher than wide
const WELCOME = { roomy: { count: 10, radius: 2.8 }, narrow: { count: 6, radius: 6 } };

/**
 * { eye, target, area: { x, z, radius }, count } for a level (level.js), whose middle is { x, z }: `count` people walk in
 * `area`. `tall`: the picture is higher than wide.
 */
export function vantageOf(level, middle, tall) {
  const { focus, share } = focusOf(level, middle);
  const { count, radius } = share < FEW ? WELCOME.narrow : WELCOME.roomy;
  const base = level.heightAt(focus.x, focus.z, level.base);
  const inward = (axis) => focus[axis] + LOOKED_AT.inward * (middle[axis] - focus[axis]);
  const target = { x: inward("x"), y: base + LOOKED_AT.up, z: inward("z") };
  const ahead = Math.atan2(focus.x - middle.x, focus.z - middle.z); // from the middle towards them; 0 is +Z
  const [first] = EYE[tall ? "tall" : "wide"];
  const eyes = EYE[tall ? "tall" : "wide"].flatMap((reach) => turns().map((turn) => eyeAt(focus, base, ahead + turn, reach)));
  const eye = eyes.find((one) => sees(level, one, focus, base)) ?? eyeAt(focus, base, ahead, first);
  return { eye, target, area: { ...focus, radius: tall ? SLIM * radius : radius }, count };
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
function turns() {
  return Array.from({ length: DIRECTIONS }, (_, k) => (Math.ceil(k / 2) * (k % 2 ? 1 : -1) * 2 * Math.PI) / DIRECTIONS);
}

function eyeAt({ x, z }, base, direction, [away, up]) {
  return { x: x + away * Math.sin(direction), y: base + up, z: z + away * Math.cos(direction) };
}

/** Whether people around the focus are visible from there, past walls. */
function sees(level, eye, focus, base) {
  const aside = { x: focus.z - eye.z, z: eye.x - focus.x }, length = Math.hypot(aside.x, aside.z);
  return [-1, 0, 1].every((side) => {
    const step = (side * LOOKED_AT.beside) / length;
    const way = { x: focus.x + step * aside.x - eye.x, y: base + 1 - eye.y, z: focus.z + step * aside.z - eye.z };
    const reach = Math.hypot(way.x, way.y, way.z);
    const direction = { x: way.x / reach, y: way.y / reach, z: way.z / reach };
    return level.freeAlong({ origin: eye, direction }) >= reach;
  });
}
