// Short ways over the triangles of a scene: A*, string pulling, a step back from corners. It mirrors the server's
// navigation/paths/find.py, which explains the rules.

/** @typedef {import("./scene.js").Point} Point */
/** @typedef {import("./scene.js").Place} Place */
/** @typedef {import("./scene.js").LocalScene} LocalScene */
/** A crossed edge: the triangle behind it, its left and right end. @typedef {{ there: number, left: Point, right: Point }} Portal */

const COMFORT = [0.2, 0.1, 0.05]; // metres beyond the radius, the most first
const DETOUR = 1.025; // how much longer this may make a way
const SPACING = 0.1, SURE = 1.013;

/** Corners of a short way between two places of one island. @param {LocalScene} scene @param {Place} start @param {Place} goal @returns {Point[]} */
export function shortest(scene, start, goal) {
  const [one, other] = before(goal.spot, start.spot) ? [goal, start] : [start, goal];
  /** @type {[Place, Place, boolean][]} */
  const searches = [[one, other, true], [other, one, true], [one, other, false]];
  let best = { length: Infinity, first: start, way: /** @type {Point[]} */ ([]) };
  for (const [first, last, aim] of searches) {
    const way = pull(first.spot, last.spot, corridor(scene, first, last, aim)), length = lengthOf(way);
    if (length < best.length) best = { length, first, way };
  }
  return best.first === start ? best.way : best.way.reverse();
}

/** The way with its corners moved away from walls where there is room. @param {Point[]} points @param {LocalScene} scene @param {number} radius @returns {Point[]} */
export function widened(points, scene, radius) {
  if (points.length < 3) return points;
  for (const comfort of COMFORT) {
    /** @type {Point[]} */
    const wished = points.map(([x, y], k) => {
      if (k === 0 || k === points.length - 1) return [x, y];
      const away = scene.away(x, y), push = Math.min(Math.max(radius + comfort - scene.distance(x, y), 0), comfort);
      return [x + push * away[0], y + push * away[1]];
    });
    const moved = valid(points, wished, scene, radius);
    if (lengthOf(moved) <= DETOUR * lengthOf(points)) return moved;
  }
  return points;
}

/**
 * Moves corners back whose ways to their neighbours come too near a wall.
 * @param {Point[]} points @param {Point[]} moved @param {LocalScene} scene @param {number} radius
 */
function valid(points, moved, scene, radius) {
  const found = [...moved];
  for (let round = 0; round < points.length; round += 1) {
    const bad = found.slice(1).map((to, k) => tightness(found[k], to, scene) < radius * SURE);
    const back = points.flatMap((point, k) => {
      const out = found[k][0] !== point[0] || found[k][1] !== point[1];
      return out && (bad[k] || bad[k - 1]) ? [k] : [];
    });
    if (!back.length) break;
    for (const k of back) found[k] = points[k];
  }
  return found;
}

/** @param {Point} from @param {Point} to @param {LocalScene} scene */
function tightness(from, to, scene) {
  const dx = to[0] - from[0], dy = to[1] - from[1], steps = Math.ceil(Math.hypot(dx, dy) / SPACING);
  let least = Infinity;
  for (let k = 0; k <= steps; k += 1) {
    const share = k / Math.max(steps, 1);
    least = Math.min(least, scene.distance(from[0] + share * dx, from[1] + share * dy));
  }
  return least;
}

/** @param {Point[]} way */
const lengthOf = (way) => way.slice(1).reduce((sum, b, k) => sum + Math.hypot(b[0] - way[k][0], b[1] - way[k][1]), 0);

/** @param {Point} a @param {Point} b */
const before = (a, b) => a[0] < b[0] || (a[0] === b[0] && a[1] < b[1]);

/** Corners of the taut string through portals. @param {Point} start @param {Point} goal @param {Portal[]} portals @returns {Point[]} */
function pull(start, goal, portals) {
  const lefts = [...portals.map(({ left }) => left), goal], rights = [...portals.map(({ right }) => right), goal];
  const way = [start];
  let apex = start, left = start, right = start, leftAt = 0, rightAt = 0;
  for (let index = 0; index < lefts.length; index += 1) {
    const newLeft = lefts[index], newRight = rights[index];
    /** @type {[Point, number] | null} */
    let bend = null;
    if (turn(apex, right, newRight) >= 0) {
      if (same(right, apex) || turn(apex, left, newRight) < 0) [right, rightAt] = [newRight, index];
      else bend = [left, leftAt];
    }
    if (!bend && turn(apex, left, newLeft) <= 0) {
      if (same(left, apex) || turn(apex, right, newLeft) > 0) [left, leftAt] = [newLeft, index];
      else bend = [right, rightAt];
    }
    if (bend) {
      [apex, index] = bend;
      [left, right, leftAt, rightAt] = [apex, apex, index, index];
      way.push(apex);
    }
  }
  way.push(goal);
  return way.filter((corner, k) => !k || !same(corner, way[k - 1]));
}

/** Positive when c lies to the left of a → b. @param {Point} a @param {Point} b @param {Point} c */
const turn = (a, b, c) => (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);

/** @param {Point} a @param {Point} b */
const same = (a, b) => a[0] === b[0] && a[1] === b[1];

/**
 * Portals of a short way; `aim`: measured at their crossing with the straight line to the goal.
 * @param {LocalScene} scene @param {Place} start @param {Place} goal @param {boolean} aim @returns {Portal[]}
 */
function corridor(scene, start, goal, aim) {
  const [gx, gy] = goal.spot;
  const best = new Map([[start.triangle, 0]]);
  /** @type {Map<number, { from: number, portal: Portal }>} */
  const came = new Map();
  const queue = new Queue();
  queue.push({ whole: Math.hypot(gx - start.spot[0], gy - start.spot[1]), cost: 0, here: start.triangle, x: start.spot[0], y: start.spot[1] });
  for (let next = queue.pop(); next; next = queue.pop()) {
    const { cost, here, x, y } = next;
    if (here === goal.triangle) break;
    if (cost > (best.get(here) ?? Infinity)) continue;
    const dx = gx - x, dy = gy - y, corners = scene.corners[here];
    for (let k = 0; k < 3; k += 1) {
      const there = scene.neighbours[here][k];
      if (there < 0 || (best.get(there) ?? Infinity) <= cost) continue;
      const right = corners[k], left = corners[(k + 1) % 3];
      const ex = left[0] - right[0], ey = left[1] - right[1];
      const across = dx * ey - dy * ex;
      let share = ((x - right[0]) * ex + (y - right[1]) * ey) / (ex * ex + ey * ey);
      if (aim) share = across ? (dy * (right[0] - x) - dx * (right[1] - y)) / across : 0.5;
      share = Math.min(Math.max(share, 0), 1);
      const px = right[0] + share * ex, py = right[1] + share * ey, spent = cost + Math.hypot(px - x, py - y);
      if (spent >= (best.get(there) ?? Infinity)) continue;
      best.set(there, spent);
      came.set(there, { from: here, portal: { there, left, right } });
      queue.push({ whole: spent + Math.hypot(gx - px, gy - py), cost: spent, here: there, x: px, y: py });
    }
  }
  const way = [];
  for (let at = goal.triangle; at !== start.triangle;) {
    const { from, portal } = /** @type {{ from: number, portal: Portal }} */ (came.get(at));
    way.push(portal);
    at = from;
  }
  return way.reverse();
}

/** @typedef {{ whole: number, cost: number, here: number, x: number, y: number }} Node */

/** Nodes, the nearest first (a binary heap). */
class Queue {
  /** @type {Node[]} */
  #nodes = [];

  /** @param {Node} node */
  push(node) {
    const nodes = this.#nodes;
    let at = nodes.push(node) - 1;
    for (let up = (at - 1) >> 1; at && sooner(node, nodes[up]); up = (at - 1) >> 1) {
      nodes[at] = nodes[up];
      at = up;
    }
    nodes[at] = node;
  }

  /** @returns {Node | undefined} */
  pop() {
    const nodes = this.#nodes, first = nodes[0], last = nodes.pop();
    if (!last || !nodes.length) return first;
    let at = 0;
    for (;;) {
      let down = 2 * at + 1;
      if (down >= nodes.length) break;
      if (down + 1 < nodes.length && sooner(nodes[down + 1], nodes[down])) down += 1;
      if (!sooner(nodes[down], last)) break;
      nodes[at] = nodes[down];
      at = down;
    }
    nodes[at] = last;
    return first;
  }
}

/** @param {Node} a @param {Node} b */
function sooner(a, b) {
  if (a.whole !== b.whole) return a.whole < b.whole;
  if (a.cost !== b.cost) return a.cost < b.cost;
  return a.here < b.here;
}
