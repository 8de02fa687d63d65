// Commands to people: where to go, whom to follow. Throws the server's refusals.

import { onFloor } from "./client/index.js";
import { arranged, dragHeading, escort, othersThan, recipients } from "./choices.js";
import { mention, tell } from "./hud.js";

const PLAIN = { x: 0, z: 0, radius: 9 }; // where people walk about without a scene, metres
const WAYS = 8; // maximum number of people whose ways are requested and drawn at a time
const MARK = 0.4; // metres around a goal that belong to its mark
const NEAR = 0.05; // metres that the server may move a goal without a message

export class Commands {
  /**
   * `ask()` returns { mode, selected, speed, formation }: which people a click means, how fast they go, and in which formation
   * (`arranged`). `heightAt(x, z, y)` returns the ground's height, and `scene()` the scene's id, or "". `nobody()` returns the
   * reason why nobody can be sent.
   */
  constructor(api, crowd, { ask, heightAt, scene, nobody }) {
    Object.assign(this, { api, crowd, ask, heightAt, scene, nobody });
    this.wandering = false;
    this.roaming = new Set(); // people who walk about because of it
    this.abroad = new Set(); // ids of agents that walk about and have not been seen yet
    this.expected = new Map(); // goals of agents, by id, that have not been seen yet
    this.told = new WeakSet(); // goals that were reported to lie off the ground
    this.lastSent = []; // people whose path a further waypoint extends
  }

  /** Sends people to a point; with `further`, after the goals that they have. */
  async send(point, how = {}, further = false) {
    const { speed, formation } = this.ask();
    const present = this.lastSent.filter((person) => this.crowd.people.includes(person));
    const onward = further && present.length > 0;
    this.lastSent = onward ? present : this.#meant(point);
    const places = arranged(point, this.lastSent, formation);
    await Promise.all(this.lastSent.map((person, k) => {
      const y = this.heightAt(places[k].x, places[k].z, point.y ?? 0);
      const goal = { ...places[k], y, ...how, speed };
      return onward && person.ahead.length ? this.#walkOn(person, goal) : this.#walk(person, goal);
    }));
    await this.showWays(this.lastSent);
  }

  /** The goal whose mark is at a point on the ground: { person, number }; or null. */
  goalAt({ x, z }) {
    const gap = (goal) => Math.hypot(goal.x - x, goal.z - z);
    const all = this.crowd.people.flatMap((person) => person.ahead.map((goal, number) => ({ person, number, away: gap(goal) })));
    const [nearest] = all.sort((a, b) => a.away - b.away);
    return nearest?.away < MARK ? nearest : null;
  }

  /** Replaces a goal in a person's path. */
  async changeGoal(person, number, change) {
    this.ask(); // throws if nobody may be sent
    const path = person.ahead.map((goal, k) => (k === number ? { ...goal, ...change } : goal));
    person.showPath(path);
    person.revision = (await this.api.setPath(person.agent.id, path)).revision;
    await this.showWays([person]);
  }

  /** Sends a person to a place a little ahead, repeatedly; no way is drawn. */
  async drive(person, goal) {
    person.wanders = false;
    if (person.ahead.length) person.showPath([]);
    try {
      await this.api.setPath(person.agent.id, [goal]);
    } catch (error) {
      if (!isUnreachable(error)) throw error; // against a wall
    }
  }

  async stop(people) {
    for (const person of people) {
      person.wanders = false;
      person.showPath([]);
    }
    await Promise.all(people.map((person) => this.api.clearGoal(person.agent.id)));
  }

  /** Makes everybody without a goal walk about; called regularly while that is on. */
  async wander() {
    if (!this.wandering) return;
    const idle = this.crowd.people.filter((person) => !person.wanders && !person.ahead.length);
    for (const person of idle) this.roaming.add(person);
    await this.roam(idle);
  }

  /** Makes people wander until they are sent somewhere or stopped. */
  async roam(people) {
    await Promise.all(people.map(({ agent }) => this.roamAgent(agent.id)));
  }

  /** Like `roam`, for an agent that may not have been seen yet; it stays within `near` { x, z, radius }. */
  roamAgent(id, near = this.scene() ? null : PLAIN) {
    const how = { speed: this.ask().speed };
    this.abroad.add(id);
    this.notice();
    return near ? this.api.wander(id, near, near.radius, how) : this.api.roam(id, how);
  }

  /** Sends an agent that may not have been seen yet to goals in turn. */
  sendAgent(id, goals) {
    this.expected.set(id, goals);
    this.notice();
    return this.api.setPath(id, goals);
  }

  /** Commands expected agents that have come. */
  notice() {
    for (const person of this.crowd.people) {
      const { id } = person.agent;
      if (this.abroad.delete(id)) person.wanders = true;
      if (this.expected.has(id)) person.showPath(this.expected.get(id));
      this.expected.delete(id);
    }
  }

  async endWandering() {
    this.wandering = false;
    const roaming = this.crowd.people.filter((person) => person.wanders && this.roaming.has(person));
    this.roaming.clear();
    await this.stop(roaming);
  }

  /** Makes people patrol between points. */
  async patrol(points) {
    const { speed } = this.ask();
    const people = this.#meant(points[0]);
    const goals = points.map((point) => onFloor({ ...point, speed }));
    await this.#busy(people, "patrol", () => ({ patrol: { goals, to_and_fro: true } }));
  }

  async follow(leader) {
    const followers = this.#others(leader);
    const said = followers.length > 1 ? "follow" : "follows";
    await this.#busy(followers, `${said} ${leader.agent.name}`, (k) => ({ follow: { agent_id: leader.agent.id, ...escort(k) } }));
  }

  async keepAway(from) {
    const shy = this.#others(from);
    const said = shy.length > 1 ? "keep" : "keeps";
    await this.#busy(shy, `${said} away from ${from.agent.name}`, () => ({ keep_away: { agent_id: from.agent.id } }));
  }

  /** Makes people queue, the first at a point and facing it. */
  async queue(point) {
    const { speed } = this.ask();
    const people = this.#meant(point);
    const mean = (axis) => people.reduce((sum, person) => sum + person[axis], 0) / people.length;
    const heading = dragHeading({ x: mean("x"), z: mean("z") }, point) ?? 0;
    const name = `at ${point.x.toFixed(1)}, ${point.z.toFixed(1)}`;
    await this.#busy(people, "queue up", () => ({ queue: { name, head: point, heading, speed } }));
  }

  /** Draws the ways again after a change of the scene. */
  replan() {
    return this.showWays(this.lastSent.filter((person) => this.crowd.people.includes(person)));
  }

  /** Draws the ways of people to their next goals, and reports goals that cannot be reached. */
  async showWays(people) {
    const scene = this.scene();
    if (!scene) return;
    await Promise.all(people.filter(({ ahead }) => ahead.length).slice(0, WAYS).map(async (person) => {
      const [goal] = person.ahead;
      try {
        const { x, y, z } = person;
        const way = await this.api.queryPath(scene, { x, y, z }, { x: goal.x, y: goal.y ?? 0, z: goal.z });
        if (person.ahead[0] !== goal) return; // sent elsewhere meanwhile
        person.showWay(way.points);
        if (way.goal_moved > NEAR && !this.told.has(goal)) {
          this.told.add(goal);
          mention(`${person.agent.name} goes to the nearest free place, ${way.goal_moved.toFixed(1)} m from there`);
        }
      } catch (error) {
        person.showWay([]);
        if (!isUnreachable(error)) throw error; // an event reports it, and the agent waits
      }
    }));
  }

  async #walk(person, goal) {
    person.wanders = false;
    person.showPath([goal]);
    try {
      person.revision = (await this.api.setPath(person.agent.id, [goal])).revision;
    } catch (error) {
      person.showPath([]);
      if (!isUnreachable(error)) throw error;
      tell(`${person.agent.name} stays: no way leads there`, true);
    }
  }

  /** Adds a goal; without a heading the person passes through it. */
  async #walkOn(person, goal) {
    const further = "heading" in goal ? goal : { ...goal, stop: false };
    person.extendPath([further]);
    await this.api.appendGoals(person.agent.id, [further]);
  }

  /** Gives people a behaviour: person `k` does `behaviour(k)`. */
  async #busy(people, said, behaviour) {
    for (const person of people) {
      person.showPath([]);
      person.wanders = true;
      this.roaming.delete(person);
    }
    this.lastSent = [];
    await Promise.all(people.map(({ agent }, k) => this.api.behave(agent.id, behaviour(k))));
    if (people.length) mention(`${people.length > 1 ? `${people.length} people` : people[0].agent.name} ${said}`);
  }

  #meant(point) {
    const { mode, selected } = this.ask();
    return this.#some(recipients(mode, this.crowd.people, selected, point), "Select a person first, or send the nearest or all");
  }

  #others(person) {
    const { mode, selected } = this.ask();
    return this.#some(othersThan(person, mode, this.crowd.people, selected), "There is no one else to send: select people first, or choose all");
  }

  #some(people, hint) {
    if (!people.length) tell(this.crowd.people.length ? hint : this.nobody(), true);
    return people;
  }
}

/** Whether the server refused because no way leads there. */
export function isUnreachable(error) {
  return error.problem?.type === "urn:wayfarer:unreachable";
}
