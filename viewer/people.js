// People on the stage: the body, its marks on the ground, its trail.

import {
  BufferAttribute, BufferGeometry, Group, Line, LineBasicMaterial, Mesh, MeshBasicMaterial, RingGeometry,
} from "./vendor/three.min.js";
import { BASES, headingOf } from "./client/index.js";

const ACCENT = "#0b7285";
const BESIDE = [0.02, 0.3, 0.75]; // colour of the second person of a comparison
const RING_LIFT = 0.014; // metres over the ground
const WAY_LIFT = 0.025;

/** A flat ring on the floor, or the arc of it around a heading. */
export function floorRing(inner, outer, colour, opacity = 0.9, { heading = 0, width = 2 * Math.PI } = {}) {
  const material = new MeshBasicMaterial({
    color: colour, transparent: true, opacity, depthWrite: false,
    polygonOffset: true, polygonOffsetFactor: -4, polygonOffsetUnits: -4,
  });
  const ring = new Mesh(new RingGeometry(inner, outer, 48, 1, heading - (Math.PI + width) / 2, width), material);
  ring.rotation.x = -Math.PI / 2;
  ring.position.y = RING_LIFT;
  return ring;
}

/** The view of one agent of the session's player. */
export class Person {
  /** `stage`, `bodies` and `trails` are shared by all people. `heightAt(x, z, y)` returns the ground's height. */
  constructor(played, { stage, bodies, trails, heightAt }) {
    const { agent } = played;
    this.played = played;
    this.agent = agent;
    this.stage = stage;
    this.bodies = bodies;
    this.heightAt = heightAt;
    this.x = 0;
    this.y = 0; // of the ground
    this.z = 0;
    this.heading = 0;
    this.height = 1.75; // metres, of the name above the head; set from the mesh
    this.body = null;
    this.colour = agent.beside ? BESIDE : null; // of the whole body; null: skin and clothes
    this.light = null; // the light body, while it shows the fine one
    this.fine = false; // whether its body is the fine one, or was requested
    this.shown = false; // has a body, and a pose
    this.gone = false;
    this.group = new Group(); // on the stage once something is in it
    this.group.matrixAutoUpdate = false; // it stays where it is
    this.marker = null; // the ring around a selected person, made when it is first needed
    this.path = new Group(); // a mark for each goal ahead
    this.path.matrixAutoUpdate = false;
    this.way = null; // the line to the next one
    this.ahead = []; // { x, z, heading? … }
    this.passed = 0; // goals of its path that are behind it
    this.revision = 0; // of its path, as last reported by the server
    this.wanders = false; // only the server knows its goals
    this.trail = trails.begin(colourOf(agent.alias));
  }

  #show(object) {
    this.group.add(object);
    this.stage.add(this.group);
  }

  /** Loads the body (`bodies.load`); the person appears with its first pose. */
  async load(file, boneNames) {
    const body = await this.bodies.load(file, boneNames, this.colour);
    if (this.gone || this.body) body.remove();
    else this.wear(body);
  }

  /** Shows another body: { pose(frame), height, remove() }, with `object` unless it belongs to `bodies`. */
  wear(body) {
    this.light?.remove();
    this.body?.remove();
    this.light = null;
    this.body = body;
    this.height = body.height;
    if (body.object) this.#show(body.object);
  }

  /** Shows a fine body instead of the light one. */
  refine(body) {
    this.light = this.body;
    this.light.hide();
    this.body = body;
  }

  /** Shows the light body again. */
  coarsen() {
    this.body.remove();
    this.body = this.light;
    this.light = null;
    this.fine = false;
  }

  /** Shows that it is selected. */
  mark(selected) {
    if (selected && !this.marker) {
      this.marker = floorRing(0.36, 0.42, ACCENT);
      this.#show(this.marker);
    }
    if (this.marker) this.marker.visible = this.marker.matrixAutoUpdate = selected;
    this.#placeMarker();
  }

  #placeMarker() {
    if (this.marker?.visible) this.marker.position.set(this.x, this.y + RING_LIFT, this.z);
  }

  /** Hides it: at the moment shown it was not there. */
  hide() {
    this.body?.hide();
    this.group.visible = false;
  }

  /** Shows a frame: hips x, y, z, then x, y, z, w per bone, the hips' rotation first. `now`: it is a present frame, not a past one. */
  pose(frame, now = true) {
    this.group.visible = true;
    this.x = frame[0];
    this.z = frame[2];
    this.y = this.heightAt(this.x, this.z, frame[1] - 0.5);
    this.heading = headingOf(BASES.gltf, frame, 3);
    this.#placeMarker();
    if (now && this.body) this.trail.add(this.x, this.y, this.z);
    this.body?.pose(frame);
    this.shown = this.body !== null;
  }

  /** Shows goals ahead; arrivals count again once their `revision` is known. */
  showPath(goals) {
    discard(this.path.children);
    this.showWay([]);
    this.ahead = goals;
    this.passed = 0;
    this.revision = Infinity;
    this.#mark(goals);
  }

  /** Shows goals that were added to the end of the path. */
  extendPath(goals) {
    this.ahead = [...this.ahead, ...goals];
    this.#mark(goals);
  }

  /** Shows the way to the next goal: a line through these points, or none. */
  showWay(points) {
    if (this.way) discard([this.way]);
    this.way = points.length > 1 ? wayLine(points, colourOf(this.agent.alias)) : null;
    if (this.way) this.#show(this.way);
  }

  /** Goal `waypoint` of the path of a revision was reached. */
  reach(revision, waypoint) {
    const count = Math.min(waypoint + 1 - this.passed, this.ahead.length);
    if (this.wanders || revision < this.revision || count <= 0) return; // of an earlier path
    this.passed += count;
    this.ahead = this.ahead.slice(count);
    discard(this.path.children.slice(0, count));
    this.showWay([]);
  }

  #mark(goals) {
    for (const goal of goals) this.path.add(goalMark(goal, colourOf(this.agent.alias)));
    if (goals.length) this.#show(this.path);
  }

  dispose() {
    this.gone = true;
    this.light?.remove();
    this.body?.remove();
    this.trail.end();
    discard([this.group]);
  }
}

function discard(objects) {
  for (const object of [...objects]) {
    object.removeFromParent();
    object.traverse((node) => {
      node.geometry?.dispose();
      node.material?.map?.dispose();
      node.material?.dispose();
    });
  }
}

function wayLine(points, colour) {
  const geometry = new BufferGeometry();
  const places = Float32Array.from(points.flatMap(({ x, y, z }) => [x, y + WAY_LIFT, z]));
  geometry.setAttribute("position", new BufferAttribute(places, 3));
  return new Line(geometry, new LineBasicMaterial({ color: colour }));
}

/** A ring, with an arc in front if a heading is requested. */
function goalMark({ x, y = 0, z, heading }, colour) {
  const mark = new Group();
  mark.position.set(x, y, z);
  mark.add(floorRing(0.24, 0.3, colour));
  if (heading !== undefined) mark.add(floorRing(0.36, 0.46, colour, 0.9, { heading, width: 0.8 }));
  return mark;
}

/** Well spread hues: steps of the golden angle. */
function colourOf(alias) {
  return `hsl(${Math.round((alias * 137.5) % 360)}, 62%, 42%)`;
}
