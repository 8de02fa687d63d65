// Drawings over people that show how they walk: skeletons, feet on the ground, footprints.

import { BufferAttribute, BufferGeometry, Group, LineBasicMaterial, LineSegments, Mesh, MeshBasicMaterial, RingGeometry } from "./vendor/three.min.js";

const PRINTS = 240; // maximum kept, of all people
const PEOPLE = 40; // maximum number of people whose skeletons are drawn
const FEET = [["left_ankle", "left_foot"], ["right_ankle", "right_foot"]];
const LIFT = 0.018; // metres over the ground
const COLOURS = ["#0b7285", "#b0522a"]; // left, right

/** Skeletons of people whose bodies have a rig (`rig.places` after a pose). */
export class Overlays {
  constructor(stage) {
    this.group = new Group();
    this.skeleton = new LineSegments(new BufferGeometry(), new LineBasicMaterial({ color: "#e03131", depthTest: false, transparent: true }));
    this.skeleton.frustumCulled = false;
    this.skeleton.renderOrder = 2;
    this.prints = new Group();
    this.marks = { skeleton: false, feet: false };
    this.stood = new Map(); // alias → contacts of the picture before
    this.soles = COLOURS.map((color) => new MeshBasicMaterial({ color, transparent: true, opacity: 0.55, depthWrite: false }));
    this.sole = new RingGeometry(0, 0.5, 20);
    this.sole.rotateX(-Math.PI / 2);
    this.sole.scale(0.1, 1, 0.27);
    this.skeleton.visible = this.prints.visible = false;
    this.group.add(this.skeleton, this.prints);
    stage.add(this.group);
  }

  /** `name`: "skeleton" or "feet". */
  mark(name, visible) {
    this.marks[name] = visible;
    if (name === "skeleton") this.skeleton.visible = visible;
    else {
      this.prints.visible = visible;
      if (!visible) this.prints.clear();
    }
  }

  /** Called once per picture, after the poses. `contactsOf(person)` returns 1 for the left foot, 2 for the right foot. */
  update(people, contactsOf) {
    if (this.marks.skeleton) this.#bones(people.filter(({ shown, group, body }) => shown && group.visible && body.rig).slice(0, PEOPLE));
    if (this.marks.feet) for (const person of people) this.#feet(person, contactsOf(person));
  }

  #bones(people) {
    const points = [];
    for (const { body: { rig } } of people) {
      const { parents, places } = rig;
      for (let joint = 1; joint < rig.count; joint += 1) {
        const parent = parents[joint];
        if (parent < 0) continue;
        points.push(places[3 * parent], places[3 * parent + 1], places[3 * parent + 2], places[3 * joint], places[3 * joint + 1], places[3 * joint + 2]);
      }
    }
    this.skeleton.geometry.dispose();
    this.skeleton.geometry = new BufferGeometry();
    this.skeleton.geometry.setAttribute("position", new BufferAttribute(Float32Array.from(points), 3));
  }

  /** Adds a print where a foot is set down. */
  #feet(person, contacts) {
    const { alias } = person.agent;
    const before = this.stood.get(alias) ?? contacts;
    this.stood.set(alias, contacts);
    const rig = person.body?.rig;
    if (!rig || !person.shown) return;
    FEET.forEach(([ankle, toes], side) => {
      if (!(contacts & ~before & (1 << side))) return;
      const [a, b] = [rig.placeOf(ankle), rig.placeOf(toes)];
      if (!a || !b) return;
      const print = new Mesh(this.sole, this.soles[side]);
      print.position.set((a[0] + b[0]) / 2, person.y + LIFT, (a[2] + b[2]) / 2);
      print.rotation.y = Math.atan2(b[0] - a[0], b[2] - a[2]);
      this.prints.add(print);
      if (this.prints.children.length > PRINTS) this.prints.remove(this.prints.children[0]);
    });
  }
}
