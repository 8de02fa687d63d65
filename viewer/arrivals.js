// New people: which are created, where, and what they do first.

import { comeText, randomAgents } from "./choices.js";
import { mention } from "./hud.js";

const SOON = 50; // ms between two checks for arrivals
const AGAIN = 4000; // ms until people who found no room are requested again
const AGAINS = 30; // maximum number of such requests
const SLOW = 3000; // ms after which a server that has shown nobody is busy

export class Arrivals {
  /** `place` is the scene panel. `met(person)` is called when an expected person has come. `detail`: of all bodies, if given. */
  constructor({ api, stage, place, crowd, session, commands, met, detail }) {
    Object.assign(this, { api, stage, place, crowd, session, commands, met, detail });
    this.bodies = new Map(); // gender → body
    this.since = Infinity; // time in ms at which people were requested, of whom none has been seen
    this.refused = false; // whether there was no room for all at the last request
  }

  /** URL and headers of a person's body. `detail`: "low" or "high". */
  mesh(agent, detail) {
    const url = new URL(this.api.homes.entry + this.bodies.get(agent.gender).glb_path);
    url.searchParams.set("betas", agent.betas.map((beta) => beta.toFixed(4)).join(","));
    url.searchParams.set("style", agent.seed);
    if (agent.outfit) url.searchParams.set("outfit", agent.outfit);
    url.searchParams.set("detail", this.detail ?? detail);
    return [url.href, this.api.access.headers];
  }

  /** Loads a body before the stream introduces the person. */
  #fetchBody(agent) {
    const [url, headers] = this.mesh(agent, "low");
    fetch(url, { headers }).then((answer) => answer.arrayBuffer()).catch(() => {}); // it is fetched again, with its errors, when the person is seen
  }

  /** The reason why nobody can be sent. */
  get nobody() {
    const coming = this.since < Infinity || this.crowd.people.length || this.place.book.opening;
    return coming ? "People are coming" : "Add people first";
  }

  /** Whether the server has no room for all who were requested, or is slow to show the first of them. */
  get busy() {
    return this.refused || performance.now() - this.since > SLOW;
  }

  /** People have been requested whom nobody has seen. */
  expect() {
    this.since = Math.min(this.since, performance.now());
  }

  /** Nobody is expected any more. */
  forget() {
    this.since = Infinity;
    this.refused = false;
  }

  /**
   * Creates people on free places near the camera's target, or `near` a place. `how`: what they have in common. `patience`: seconds to
   * wait for room, as the API describes.
   */
  async create(count, how = {}, near = null, patience = undefined) {
    const { place, session, stage, crowd } = this;
    await place.settled;
    if (!session.id) throw new Error("not connected yet");
    if (session.watchOnly) throw new Error("This is a replay: nobody can be added to it");
    const heights = Object.fromEntries(
      [...this.bodies].map(([gender, body]) => [gender, [body.min_height_m, body.max_height_m]]),
    );
    const { ground } = place.level;
    const where = ground
      ? { middle: near ?? stage.controls.target, heightAt: (x, z) => ground.heightAt(x, z, stage.controls.target.y) }
      : {};
    const people = randomAgents(count, heights, crowd.people, where).map((person) => ({ ...person, ...how }));
    if ("betas" in how) for (const person of people) delete person.phenotype;
    return this.api.createAgents(session.id, people, patience);
  }

  /**
   * Makes people come and walk about, in the whole scene or `near` a place: as many as there is room for now, the others later.
   * `sent()` is called when the first of them have their commands and their bodies are requested.
   */
  async roamers(count, near, sent) {
    this.expect();
    const came = await this.#roam(count, near, sent).catch((error) => {
      this.forget();
      throw error;
    });
    if (came === count) return;
    mention(comeText(came, count), "come");
    this.#roamLater(count - came, near).catch(() => {}); // errors are not shown
  }

  /** Creates as many of them as there is room for; returns their number. */
  async #roam(count, near, sent) {
    let came = 0;
    for (let some = count; some > 0; some = Math.min(some, count - came)) {
      try {
        const made = await this.create(some, {}, near, 0);
        came += some;
        const told = made.map((agent) => {
          const sent = this.commands.roamAgent(agent.agent_id, near);
          this.#fetchBody(agent); // in turn with the commands, since a browser sends six requests at a time
          return sent;
        });
        sent?.();
        await Promise.all(told);
      } catch (error) {
        if (error.status === 503) break; // too busy even to refuse some of them
        if (error.status !== 429) throw error;
        some = Math.floor(some / 2);
      }
    }
    this.refused = came < count;
    return came;
  }

  async #roamLater(count, near) {
    const { id } = this.session;
    try {
      for (let left = count, k = 0; left > 0 && k < AGAINS; k += 1) {
        await new Promise((go) => setTimeout(go, AGAIN));
        if (this.session.id !== id) return;
        left -= await this.#roam(left, near);
      }
    } finally {
      if (this.session.id === id && this.refused) this.forget();
    }
  }

  /** Makes people walk before the camera in a scene that opens. */
  async welcome(sent) {
    const { count, area } = this.stage.approach(this.place.level);
    await this.roamers(count, area, sent);
  }

  /** Creates an agent with a shape { gender, betas } or { phenotype } and a name; returns its id. */
  async enlist(shape) {
    const [made] = await this.create(1, shape);
    return made.agent_id;
  }

  /** Makes a new person wander once it is seen. */
  async setOff(id) {
    const current = this.session.id;
    while (this.session.id === current) {
      const person = this.crowd.people.find(({ agent, shown }) => agent.id === id && shown);
      if (person) {
        this.met(person);
        return this.commands.roam([person]);
      }
      await new Promise((go) => setTimeout(go, SOON));
    }
  }
}
