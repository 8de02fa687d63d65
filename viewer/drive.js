// A person driven by the user: with W A S D, a gamepad or a finger, in the directions of the camera. No DOM but the keys.

const GOAL_SECONDS = 0.25; // between two goals: a step is 0.2 s, and the server counts calls
const AHEAD = 2.5; // metres that the goal lies before the person, times the speed in m/s, at least 1
const DEAD = 0.25; // dead zone of a stick
const KEYS = { w: [0, 1], s: [0, -1], a: [-1, 0], d: [1, 0] };

export class Drive {
  /** `person()` returns the driven person; `attempt(action)` wraps actions that may be refused. */
  constructor({ stage, person, commands, attempt }) {
    Object.assign(this, { stage, person, on: false });
    this.held = new Set();
    this.thumb = [0, 0]; // of the stick on the screen: right, forward
    this.sentAt = -Infinity;
    this.driven = null; // the person who has been sent and not stopped
    this.send = attempt((who, goal) => commands.drive(who, goal));
    this.stop = attempt((who) => commands.stop([who]));
    addEventListener("blur", () => this.held.clear()); // the page does not see keys that are released in another window
    addEventListener("keyup", ({ key }) => this.held.delete(key.toLowerCase()));
  }

  /** Whether a key drives; if so, it is held. */
  press(key) {
    if (!this.on || !(key in KEYS)) return false;
    this.held.add(key);
    return true;
  }

  turn(on) {
    this.on = on;
    if (on) return;
    this.held.clear();
    this.thumb = [0, 0];
  }

  /** Called once per picture. `speed`: as the user has chosen, m/s. */
  advance(now, speed) {
    const person = this.on ? this.person() : null;
    const [right, forward] = this.#wish();
    const share = Math.min(1, Math.hypot(right, forward));
    if (!person?.shown || share === 0) {
      if (this.driven) this.stop(this.driven);
      this.driven = null;
      return;
    }
    if (now - this.sentAt < GOAL_SECONDS) return;
    this.sentAt = now;
    this.driven = person;
    const { position } = this.stage.camera, { target } = this.stage.controls;
    const ahead = Math.atan2(target.x - position.x, target.z - position.z);
    const heading = ahead + Math.atan2(-right, forward); // the right hand is towards smaller headings
    const reach = AHEAD * Math.max(1, speed);
    this.send(person, {
      x: person.x + reach * Math.sin(heading), z: person.z + reach * Math.cos(heading), y: person.y, speed: Math.max(0.4, speed * share),
    });
  }

  /** The wanted direction relative to the camera: [right, forward], each −1 to 1. */
  #wish() {
    let [right, forward] = this.thumb;
    for (const key of this.held) {
      right += KEYS[key][0];
      forward += KEYS[key][1];
    }
    for (const pad of globalThis.navigator?.getGamepads?.() ?? []) {
      if (!pad || Math.hypot(pad.axes[0], pad.axes[1]) < DEAD) continue;
      right += pad.axes[0];
      forward -= pad.axes[1];
    }
    return [right, forward];
  }
}
