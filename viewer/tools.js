// Tools for clicks on the stage: send people, put crates, choose a leader.

import { byId, tell } from "./hud.js";
import { dragHeading, pick } from "./choices.js";
import { planePoint } from "./ground.js";
import { floorRing } from "./people.js";

const HINTS = {
  send: "Click the ground to send people there · Shift-click adds a waypoint, Shift-drag one with a heading · drag a goal to move it, with Shift to turn it · click a person to select, Ctrl-drag around several · drag to orbit",
  crate: "Click puts a crate there · drag a crate to move it · Delete takes the chosen one away · Esc ends",
  patrol: "Click two or more places, then Patrol again or Enter to start · Esc ends",
  follow: "Click the person to be followed · Esc ends",
  avoid: "Click the person to keep away from · Esc ends",
  queue: "Click where the queue begins · Esc ends",
  box: "Drag a box around people, or click one after the other · Esc ends",
};

export class Tools {
  /** `attempt(action)` wraps actions that may be refused; `selection` has the selected people. */
  constructor({ stage, level, book, crowd, commands, selection, attempt }) {
    Object.assign(this, { stage, level, book, crowd, commands, selection });
    this.name = "send";
    this.points = []; // of a patrol that is being drawn
    this.marks = [];
    for (const act of ["send", "addCrate", "patrol", "follow", "keepAway", "queue", "removeCrate", "changeGoal"]) {
      this[act] = attempt(this[act].bind(this));
    }
    for (const button of document.querySelectorAll("[data-tool]")) {
      button.onclick = () => this.use(button.dataset.tool);
    }
  }

  /** Takes up a tool; the same one again ends it. */
  use(name) {
    if (name === "patrol" && this.name === "patrol" && this.points.length > 1) this.patrol(this.points);
    this.points = [];
    for (const mark of this.marks.splice(0)) this.stage.remove(mark);
    this.name = name === this.name ? "send" : name;
    if (this.name !== "crate") this.level.choose(null);
    this.hint();
    for (const button of document.querySelectorAll("[data-tool]")) {
      button.setAttribute("aria-pressed", String(button.dataset.tool === this.name));
    }
    this.stage.canvas.style.cursor = this.name === "send" ? "" : "crosshair";
  }

  /** The text on how people are sent and selected. */
  get help() {
    return HINTS.send;
  }

  /** Shows how the tool is used, next to the tools. */
  hint() {
    byId("hint").textContent = byId("rest").hidden ? "" : HINTS[this.name];
  }

  /** The object that a drag from this point moves; null: the camera. */
  press(event) {
    if (this.name === "box" || (this.name === "send" && (event.ctrlKey || event.metaKey))) return this.#dragBox(event);
    const hit = this.level.meets(this.stage.ray(event));
    if (this.name === "crate" && hit?.obstacle) return this.#dragCrate(hit.obstacle, hit.at);
    const goal = this.name === "send" && hit ? this.commands.goalAt(hit.point) : null;
    if (goal) return this.#dragGoal(goal, event.shiftKey);
    return event.shiftKey && this.name === "send" && hit ? this.#dragHeading(hit.point) : null;
  }

  click(event) {
    const ray = this.stage.ray(event);
    const person = this.personAt(ray);
    const hit = this.level.meets(ray);
    if (person && this.name === "follow") this.follow(person);
    else if (person && this.name === "avoid") this.keepAway(person);
    else if (person && this.name === "send") this.selection.choose([person]);
    else if (hit) this.act(hit.point, hit.obstacle);
  }

  /** The person that a ray through the picture meets; or null. */
  personAt(ray) {
    return pick(this.crowd.people, ray);
  }

  /** Handles a click on the ground. */
  act(point, obstacle = null) {
    if (this.name === "send") this.send(point);
    else if (this.name === "crate") this.#crate(point, obstacle);
    else if (this.name === "patrol") this.#addPoint(point);
    else if (this.name === "queue") this.queue(point);
    else tell("Click a person", true);
  }

  /** Deletes the chosen crate, if there is one. */
  deleteChosen() {
    const { chosen } = this.level;
    if (chosen !== null) this.removeCrate(chosen);
    return chosen !== null;
  }

  send(point, how, further) {
    return this.commands.send(point, how, further);
  }

  async addCrate(point) {
    const name = await this.book.addCrate(point);
    this.level.choose(name);
  }

  removeCrate(name) {
    return this.book.remove(name);
  }

  changeGoal(person, number, change) {
    return this.commands.changeGoal(person, number, change);
  }

  patrol(points) {
    return this.commands.patrol(points);
  }

  async follow(person) {
    await this.commands.follow(person);
    this.use("send");
  }

  async keepAway(person) {
    await this.commands.keepAway(person);
    this.use("send");
  }

  async queue(point) {
    await this.commands.queue(point);
    this.use("send");
  }

  #crate(point, obstacle) {
    if (obstacle) this.level.choose(obstacle);
    else if (this.book.id) this.addCrate(point);
    else tell("Choose a scene first: there is nothing to put a crate into", true);
  }

  #addPoint(point) {
    this.points.push(point);
    const mark = floorRing(0.12, 0.2, "#b02a37");
    mark.position.set(point.x, point.y + mark.position.y, point.z);
    this.marks.push(mark);
    this.stage.add(mark);
  }

  /** Selects the people in the box; with Shift, in addition to the selected ones. A press without a move adds or removes one. */
  #dragBox(from) {
    const box = byId("box");
    const sides = (to) => ({
      left: Math.min(from.clientX, to.clientX), right: Math.max(from.clientX, to.clientX),
      top: Math.min(from.clientY, to.clientY), bottom: Math.max(from.clientY, to.clientY),
    });
    return {
      always: true,
      move: (event) => {
        const { left, right, top, bottom } = sides(event);
        box.hidden = false;
        Object.assign(box.style, { left: `${left}px`, top: `${top}px`, width: `${right - left}px`, height: `${bottom - top}px` });
      },
      drop: (event) => {
        const drawn = !box.hidden;
        box.hidden = true;
        if (!drawn) {
          const person = this.personAt(this.stage.ray(event));
          if (person) this.selection.toggle(person);
          return;
        }
        const inside = this.#inside(sides(event));
        this.selection.choose(event.shiftKey ? [...this.selection.people, ...inside] : inside);
        if (this.name === "box") this.use("send"); // and now they can be sent
      },
      cancel: () => { box.hidden = true; },
    };
  }

  /** The people whose middle appears within these sides. */
  #inside({ left, right, top, bottom }) {
    return this.crowd.people.filter((person) => {
      const at = person.shown && this.stage.seenAt({ x: person.x, y: person.y + person.height / 2, z: person.z });
      return at && at.x >= left && at.x <= right && at.y >= top && at.y <= bottom;
    });
  }

  /** Drags a crate along the level plane through the point where it was seized. */
  #dragCrate(name, seized) {
    this.level.choose(name);
    const block = this.book.obstacles.get(name);
    return {
      move: (event) => {
        const to = planePoint(this.stage.ray(event), seized.y);
        if (to) this.book.move(name, this.level.shifted(block, to.x - seized.x, to.z - seized.z));
      },
      drop: () => {}, // it stands where it was last moved to
    };
  }

  /** Drags a goal to another place; with Shift, sets the heading there. */
  #dragGoal({ person, number }, turning) {
    const goal = person.ahead[number];
    const changed = (event) => {
      const to = this.level.meets(this.stage.ray(event))?.point;
      if (!to) return null;
      const heading = turning ? dragHeading(goal, to) : null;
      return turning ? heading !== null && { heading, stop: true } : { x: to.x, y: to.y, z: to.z };
    };
    return {
      move: (event) => {
        const change = changed(event);
        if (change && !turning) person.path.children[number]?.position.set(change.x, change.y, change.z);
      },
      drop: (event) => {
        const change = changed(event);
        if (change) this.changeGoal(person, number, change);
      },
    };
  }

  #dragHeading(from) {
    return {
      always: true, // without a move it is a waypoint
      drop: (event) => {
        const end = this.level.meets(this.stage.ray(event))?.point;
        const heading = end ? dragHeading(from, end) : null;
        this.send(from, heading === null ? {} : { heading }, true);
      },
    };
  }
}
