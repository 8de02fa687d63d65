// The people of this session, on the stage.

import { FLAG } from "./client/index.js";
import { Bodies } from "./bodies.js";
import { Names } from "./names.js";
import { Person } from "./people.js";
import { Trails } from "./trails.js";

const NEAR_SHARE = 2 / 3; // of the people who may have a fine body: people who only pass get none
const SWAP_SECONDS = 2; // between two people who give up their fine bodies: reading another takes as long as some frames
const STRAIN_SECONDS = 3; // for which reduced and held motion counts as present

/** The people shown; `changed()` is called when people have come or gone, once for all that one message of the stream names. */
export class Crowd {
  /** `heightAt(x, z, y)`: of the ground at a place. */
  constructor(stage, heightAt, mesh, changed, failed) {
    this.stage = stage;
    this.bodies = new Bodies();
    this.trails = new Trails();
    this.names = new Names();
    this.heightAt = heightAt;
    stage.add(this.bodies.group);
    stage.add(this.trails.lines);
    stage.add(this.names.mesh);
    this.mesh = mesh; // agent, detail → [URL of its GLB, headers to ask for it with]
    this.refining = false;
    this.swapped = -Infinity; // local time when somebody gave up his fine body
    this.changed = changed;
    this.reported = true; // whether `changed` knows who is here
    this.failed = failed;
    this.members = new Map(); // alias → Person
    this.looks = new Map(); // id of an agent → CharacterFile, for agents that have one
    this.boneNames = [];
    this.marks = { trails: false, labels: false };
    this.strained = -Infinity; // local time of the last chunk with reduced or held motion
  }

  get people() {
    return [...this.members.values()];
  }

  /** The shown person nearest to a place on the ground; or null. */
  nearestTo({ x, z }) {
    const gap = (person) => Math.hypot(person.x - x, person.z - z);
    return this.people.filter(({ shown }) => shown).sort((a, b) => gap(a) - gap(b))[0] ?? null;
  }

  /** A stream begins. */
  begin({ bones, skeleton }) {
    this.boneNames = bones.map((bone) => skeleton[bone].name);
  }

  /** The callbacks of a session's player (`SessionOptions.on`); `now()` is a local clock in seconds. */
  handlers(now) {
    return {
      added: (played) => this.#add(played),
      removed: ({ agent }) => this.#remove(agent.alias),
      chunk: ({ agent }, chunk) => this.#chunk(this.members.get(agent.alias), chunk, now()),
    };
  }

  mark(name, visible) {
    this.marks[name] = visible;
    if (name === "trails") this.trails.show(visible);
    else if (!visible) this.names.hide();
  }

  /** Shows everybody as the session's player has them; or, with `before` { history, moment }, as they were then. */
  play(before = null) {
    for (const person of this.members.values()) {
      if (!person.played.shown) continue;
      if (!before) person.pose(person.played.frame);
      else if (before.history.sample(person.agent.alias, before.moment, this.#frame(person))) person.pose(this.frame, false);
      else person.hide();
    }
  }

  #frame({ played }) {
    if (this.frame?.length !== played.frame.length) this.frame = new Float32Array(played.frame.length);
    return this.frame;
  }

  /** Shows the names, if they are wanted, in a picture of this size in pixels. */
  showNames(width, height) {
    if (this.marks.labels) this.names.show(this.members.values(), this.stage, width, height);
  }

  /** Whether the server has been short of time recently: then motion is simpler, or standing people are not moved. */
  busy(now) {
    return now - this.strained < STRAIN_SECONDS;
  }

  #add(played) {
    const { agent } = played;
    const person = new Person(played, this);
    this.members.set(agent.alias, person);
    const look = this.looks.get(agent.id);
    if (look) person.wear(look.body(agent.restOffsets));
    else person.load(() => this.mesh(agent, "low"), this.boneNames).catch((error) => this.failed(`body not loaded: ${error.message}`));
    this.#report();
  }

  #report() {
    if (this.reported) setTimeout(() => { // a task of its own: listing hundreds takes as long as adding them
      this.reported = true;
      this.changed();
    });
    this.reported = false;
  }

  /** Makes an agent look like a character (`CharacterFile`), now or when it comes. */
  dress(agentId, look) {
    this.looks.set(agentId, look);
    const person = this.people.find(({ agent }) => agent.id === agentId);
    person?.wear(look.body(person.agent.restOffsets));
  }

  /** Gives a person near the camera a fine body. If `most` people have one, the farthest gives its own up. */
  async refine({ position }, most, now) {
    if (this.refining || this.people.some(({ shown }) => !shown)) return;
    const gap = ({ x, z }) => Math.hypot(x - position.x, z - position.z);
    const sorted = this.people.sort((a, b) => gap(a) - gap(b));
    const person = sorted.slice(0, most * NEAR_SHARE).find(({ fine, body }) => !fine && !body.object);
    if (!person) return;
    const refined = sorted.filter(({ light }) => light);
    if (refined.length >= most) {
      if (now < this.swapped + SWAP_SECONDS) return;
      this.swapped = now;
      refined.at(-1).coarsen();
    }
    this.refining = true;
    person.fine = true; // it is not requested again even if it fails to load
    try {
      const body = await this.bodies.load(() => this.mesh(person.agent, "high"), this.boneNames, person.colour);
      if (person.gone || person.body.object) body.remove();
      else person.refine(body);
    } finally {
      this.refining = false;
    }
  }

  #remove(alias) {
    const person = this.members.get(alias);
    person?.dispose();
    if (person) this.looks.delete(person.agent.id);
    if (this.members.delete(alias)) this.#report();
  }

  #chunk(person, { flags, goalRevision, waypoint }, now) {
    if (flags & (FLAG.REDUCED | FLAG.HELD)) this.strained = now;
    if (flags & FLAG.ARRIVED) person.reach(goalRevision, waypoint);
  }
}
