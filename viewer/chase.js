// A camera that walks behind a person. No DOM, no three.js; angles as headings (0: +Z, towards +X).

const BEHIND = 3.8; // metres
const ABOVE = 1.9; // metres of the eye above the ground
const LOOKED_AT = 1.25;
const WALL = 0.35; // metres between the eye and what hides the person
const LEAST = 0.8;
const TURN_SECONDS = 0.9; // within which most of a turn of the person is followed
const MOVE_SECONDS = 0.22;

export class Chase {
  constructor() {
    this.heading = null;
  }

  reset() {
    this.heading = null;
  }

  /**
   * The camera's wanted eye and target, and the share of the way there that it moves in `seconds`:
   * { eye, target, share }. `freeAlong({ origin, direction })` returns the visible distance.
   */
  advance({ x, y, z, heading }, seconds, freeAlong = () => Infinity) {
    this.heading ??= heading;
    this.heading += turnTo(this.heading, heading) * (1 - Math.exp(-seconds / TURN_SECONDS));
    const target = { x, y: y + LOOKED_AT, z };
    const reach = Math.hypot(BEHIND, ABOVE - LOOKED_AT);
    const direction = {
      x: (-Math.sin(this.heading) * BEHIND) / reach,
      y: (ABOVE - LOOKED_AT) / reach,
      z: (-Math.cos(this.heading) * BEHIND) / reach,
    };
    const away = Math.max(LEAST, Math.min(reach, freeAlong({ origin: target, direction }) - WALL));
    const eye = { x: x + direction.x * away, y: target.y + direction.y * away, z: z + direction.z * away };
    return { eye, target, share: 1 - Math.exp(-seconds / MOVE_SECONDS) };
  }
}

/** The shorter turn from one heading to another. */
export function turnTo(from, to) {
  return Math.atan2(Math.sin(to - from), Math.cos(to - from));
}
