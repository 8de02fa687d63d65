// Automatic camera moves: behind a person, or with the middle of all.

import { Chase } from "./chase.js";
import { byId } from "./hud.js";

export class Camera {
  constructor(stage, level, crowd) {
    Object.assign(this, { stage, level, crowd });
    this.chase = new Chase();
  }

  get follows() {
    return byId("follow").checked;
  }

  /** Follows, or returns to the user. */
  follow(on) {
    byId("follow").checked = on;
    this.release();
  }

  /** Forgets whom it followed. */
  release() {
    this.chase.reset();
    this.stage.controls.enabled = true;
  }

  /** Moves for some seconds: behind the selected person, or with the middle of several, or of all. */
  advance(selected, seconds) {
    const people = selected.length ? selected : this.crowd.people;
    if (!this.follows || !people.length) return;
    const [person] = selected;
    if (selected.length === 1 && person.shown) {
      this.stage.controls.enabled = false;
      const { eye, target, share } = this.chase.advance(person, seconds, (ray) => this.level.freeAlong(ray));
      this.stage.glide(eye, target, share);
      return;
    }
    const mean = (axis) => people.reduce((sum, person) => sum + person[axis], 0) / people.length;
    this.stage.follow({ x: mean("x"), y: mean("y"), z: mean("z") }, seconds);
  }
}
