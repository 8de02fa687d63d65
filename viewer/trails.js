// The trails of people, in one draw call.

import { BufferAttribute, BufferGeometry, Color, DynamicDrawUsage, LineBasicMaterial, LineSegments } from "./vendor/three.min.js";

const POINTS = 200; // of one trail
const STEP = 0.12; // metres between two points
const FIRST = 16; // trails that there is room for at the start; doubled when more are needed

/** Trails of all people; `begin(colour)` returns one. */
export class Trails {
  constructor() {
    this.lines = new LineSegments(new BufferGeometry(), new LineBasicMaterial({ vertexColors: true }));
    this.lines.frustumCulled = false;
    this.lines.visible = false;
    this.trails = [];
    this.#room(FIRST);
  }

  show(visible) {
    this.lines.visible = visible;
    this.places.clearUpdateRanges(); // unseen changes are not noted: all of it is uploaded
    this.places.needsUpdate = true;
  }

  /** A trail: { add(x, y, z), end() }. */
  begin(colour) {
    let slot = -1; // it takes a place with its first point
    return {
      add: (x, y, z) => {
        if (slot < 0) slot = this.#place(colour);
        this.#add(slot, this.trails[slot], x, y, z);
      },
      end: () => {
        if (slot < 0) return;
        this.trails[slot] = undefined;
        this.#collapse(slot, 0, 0, 0, 0);
      },
    };
  }

  #place(colour) {
    let slot = this.trails.indexOf(undefined);
    if (slot < 0) slot = this.trails.length;
    if (slot >= this.capacity) this.#room(2 * this.capacity);
    this.trails[slot] = { count: 0 };
    const { r, g, b } = new Color(colour);
    fill(this.colours.array, slot * POINTS, (slot + 1) * POINTS, r, g, b);
    this.colours.needsUpdate = true;
    return slot;
  }

  #add(slot, trail, x, y, z) {
    const places = this.places.array;
    const start = 3 * slot * POINTS;
    const last = start + 3 * (trail.count - 1);
    if (trail.count && Math.hypot(x - places[last], z - places[last + 2]) < STEP) return;
    if (trail.count === POINTS) {
      places.copyWithin(start, start + 3, start + 3 * POINTS);
      trail.count -= 1;
    }
    // later points lie on the newest one: the lines to them have no length
    this.#collapse(slot, trail.count, x, y + 0.012, z);
    trail.count += 1;
  }

  #collapse(slot, from, x, y, z) {
    fill(this.places.array, slot * POINTS + from, (slot + 1) * POINTS, x, y, z);
    if (!this.lines.visible) return;
    this.places.addUpdateRange(3 * slot * POINTS, 3 * POINTS);
    this.places.needsUpdate = true;
  }

  #room(capacity) {
    const grown = (before) => {
      const values = new Float32Array(3 * POINTS * capacity);
      if (before) values.set(before.array);
      return new BufferAttribute(values, 3).setUsage(DynamicDrawUsage);
    };
    const index = new Uint32Array(2 * (POINTS - 1) * capacity);
    for (let slot = 0, at = 0; slot < capacity; slot += 1) {
      for (let k = 1; k < POINTS; k += 1) {
        index[at++] = slot * POINTS + k - 1;
        index[at++] = slot * POINTS + k;
      }
    }
    this.capacity = capacity;
    this.places = grown(this.places);
    this.colours = grown(this.colours);
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", this.places);
    geometry.setAttribute("color", this.colours);
    geometry.setIndex(new BufferAttribute(index, 1));
    this.lines.geometry.dispose();
    this.lines.geometry = geometry;
  }
}

/** Writes x, y, z to the points from `from` up to `to`. Hundreds of people come at once: no array is made for a point. */
function fill(points, from, to, x, y, z) {
  for (let k = 3 * from; k < 3 * to; k += 3) {
    points[k] = x;
    points[k + 1] = y;
    points[k + 2] = z;
  }
}
