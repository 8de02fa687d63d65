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
    let slot = this.trails.indexOf(undefined);
    if (slot < 0) slot = this.trails.length;
    if (slot >= this.capacity) this.#room(2 * this.capacity);
    const trail = { count: 0, colour: new Color(colour) };
    this.trails[slot] = trail;
    const { r, g, b } = trail.colour;
    for (let k = 0; k < POINTS; k += 1) this.colours.array.set([r, g, b], 3 * (slot * POINTS + k));
    this.colours.needsUpdate = true;
    return {
      add: (x, y, z) => this.#add(slot, trail, x, y, z),
      end: () => {
        this.trails[slot] = undefined;
        this.#collapse(slot, 0, [0, 0, 0]);
      },
    };
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
    this.#collapse(slot, trail.count, [x, y + 0.012, z]);
    trail.count += 1;
  }

  #collapse(slot, from, point) {
    const { array } = this.places;
    for (let k = 3 * (slot * POINTS + from); k < 3 * (slot + 1) * POINTS; k += 3) [array[k], array[k + 1], array[k + 2]] = point;
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
      for (let k = 1; k < POINTS; k += 1, at += 2) index.set([slot * POINTS + k - 1, slot * POINTS + k], at);
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
