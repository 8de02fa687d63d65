// A level scene, as `write_scene` of wayfarer_lab writes it: walkable triangles, and a grid of distances to the nearest
// wall. It mirrors the server's navigation/scene.py, locate.py and clearance.py. World: metres, Z up.

import { unpacked } from "./unpacked.js";
import { shortest, widened } from "./ways.js";

const SCHEMA = 1;

/** @typedef {[number, number]} Point */
/** A place on the mesh; `moved`: metres from the requested one. @typedef {{ triangle: number, spot: Point, moved: number }} Place */

/** No way leads to a goal; `nearest` can be reached. */
export class Unreachable extends Error {
  /** @param {Point} nearest */
  constructor(nearest) {
    super("no way leads there");
    this.nearest = nearest;
  }
}

export class LocalScene {
  /** Reads a folder written by `wayfarer export --for web --scene`. @param {import("./graphs.js").Read} reader */
  static async read(reader) {
    const read = async (/** @type {string} */ name) => unpacked(await reader(name));
    const about = JSON.parse(new TextDecoder().decode(await read("scene.json")));
    return new LocalScene(about, await read(about.field.file));
  }

  /** @param {any} about scene.json @param {ArrayBuffer} bytes scene.bin */
  constructor(about, bytes) {
    if (about.schema !== SCHEMA) throw new Error(`scene.json: schema ${about.schema}; this version reads ${SCHEMA}`);
    const { rows, columns } = about.field;
    if (bytes.byteLength !== 4 * rows * columns) throw new Error(`${about.field.file}: ${bytes.byteLength} bytes; expected ${4 * rows * columns}`);
    /** Metres that people's middles keep from walls. @type {number} */
    this.radius = about.radius;
    /** Corners of each triangle, anticlockwise. @type {[Point, Point, Point][]} */
    this.corners = about.corners;
    /** The triangle behind each edge, from a corner to the next one; -1: none. @type {number[][]} */
    this.neighbours = about.neighbours;
    /** Triangles of one island are connected. @type {number[]} */
    this.island = about.island;
    this.grid = about.field;
    this.values = new Float32Array(bytes);
  }

  /** Metres to the nearest wall, negative inside of one; cut at ± 3. @param {number} x @param {number} y */
  distance(x, y) {
    const { origin, cell } = this.grid;
    return this.#sample((x - origin[0]) / cell - 0.5, (y - origin[1]) / cell - 0.5);
  }

  /** The direction in which the distance grows; shorter than 1 between equally near walls. @param {number} x @param {number} y @returns {Point} */
  away(x, y) {
    const { origin, cell } = this.grid, u = (x - origin[0]) / cell - 0.5, v = (y - origin[1]) / cell - 0.5;
    const dx = (this.#sample(u + 1, v) - this.#sample(u - 1, v)) / (2 * cell);
    const dy = (this.#sample(u, v + 1) - this.#sample(u, v - 1)) / (2 * cell);
    const length = Math.max(Math.hypot(dx, dy), 1);
    return [dx / length, dy / length];
  }

  /** The free ground nearest to a point, of some island or of all. @param {Point} point @param {number} [island] @returns {Place} */
  place(point, island) {
    const { corners } = this;
    /** @type {Place} */
    let best = { triangle: -1, spot: point, moved: Infinity };
    for (let triangle = 0; triangle < corners.length; triangle += 1) {
      if (island !== undefined && this.island[triangle] !== island) continue;
      if (holds(corners[triangle], point)) return { triangle, spot: point, moved: 0 };
      for (let k = 0; k < 3; k += 1) {
        const spot = nearestOf(corners[triangle][k], corners[triangle][(k + 1) % 3], point);
        const moved = Math.hypot(spot[0] - point[0], spot[1] - point[1]);
        if (moved < best.moved) best = { triangle, spot, moved };
      }
    }
    return best;
  }

  /** Where a way from a place to another would end. Throws Unreachable. @param {Point} start @param {Point} goal @returns {{ first: Place, last: Place }} */
  reach(start, goal) {
    const first = this.place(start), last = this.place(goal), island = this.island[first.triangle];
    if (this.island[last.triangle] === island) return { first, last };
    const nearest = this.place(goal, island);
    if (!last.moved) throw new Unreachable(nearest.spot);
    return { first, last: nearest };
  }

  /** A short way [P]. Throws Unreachable. @param {Point} start @param {Point} goal @returns {{ points: Point[], moved: number }} */
  path(start, goal) {
    const { first, last } = this.reach(start, goal);
    return { points: widened(shortest(this, first, last), this, this.radius), moved: last.moved };
  }

  /** @param {number} u in cells @param {number} v */
  #sample(u, v) {
    const { rows, columns } = this.grid, { values } = this;
    let x = Math.min(Math.max(u, 0), columns - 1), y = Math.min(Math.max(v, 0), rows - 1);
    const c = Math.min(Math.floor(x), columns - 2), r = Math.min(Math.floor(y), rows - 2);
    x -= c;
    y -= r;
    const at = columns * r + c;
    return (values[at] * (1 - x) + values[at + 1] * x) * (1 - y) + (values[at + columns] * (1 - x) + values[at + columns + 1] * x) * y;
  }
}

/** Whether a triangle holds a point, border included. @param {Point[]} corners @param {Point} point */
function holds(corners, point) {
  return corners.every((a, k) => {
    const b = corners[(k + 1) % 3];
    return (b[0] - a[0]) * (point[1] - a[1]) - (b[1] - a[1]) * (point[0] - a[0]) >= 0;
  });
}

/** @param {Point} a @param {Point} b @param {Point} p @returns {Point} */
function nearestOf(a, b, p) {
  const dx = b[0] - a[0], dy = b[1] - a[1];
  const share = ((p[0] - a[0]) * dx + (p[1] - a[1]) * dy) / Math.max(dx * dx + dy * dy, 1e-12);
  const along = Math.min(Math.max(share, 0), 1);
  return [a[0] + along * dx, a[1] + along * dy];
}
