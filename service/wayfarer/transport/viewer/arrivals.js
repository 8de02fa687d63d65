// People who come: whom to create, where, and what they do first.

import { randomAgents } from "./choices.js";

const SOON = 50; // ms between two looks whether somebody has come

export class Arrivals {
  /** `place`: the scene panel; `met(person)`: somebody who was waited for is there; `detail`: of all bodies, if it is given. */
  constructor({ api, stage, place, crowd, session, errands, met, detail }) {
    Object.assign(this, { api, stage, place, crowd, session, errands, met, detail });
    this.bodies = new Map(); // gender → body
  }

  /** Where somebody's body is, and what it is asked for with: [URL, headers]. `detail`: "low" or "high". */
  mesh(agent, detail) {
    const url = new URL(this.api.homes.entry + this.bodies.get(agent.gender).glb_path);
    url.searchParams.set("betas", agent.betas.map((beta) => beta.toFixed(4)).join(","));
    url.searchParams.set("style", agent.seed);
    if (agent.outfit) url.searchParams.set("outfit", agent.outfit);
    url.searchParams.set("detail", this.detail ?? detail);
    return [url.href, this.api.access.headers];
  }

  /** Let the browser have a body before the stream tells of the person. */
  #fetchBody(agent) {
    const [url, headers] = this.mesh(agent, "low");
    fetch(url, { headers }).then((answer) => answer.arrayBuffer()).catch(() => {}); // who is seen asks again, and tells
  }

  /** Create people on free places near what is looked at, or `near` a place; `how`: what all of them have. As the API describes them. */
  async create(count, how = {}, near = null) {
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
    return this.api.createAgents(session.id, people);
  }

  /** People who come and walk about: all over the scene, or `near` a place. */
  async roamers(count, near) {
    const made = await this.create(count, {}, near);
    const told = made.map(({ agent_id: id }) => this.errands.roamAgent(id, near));
    for (const agent of made) this.#fetchBody(agent); // after what they are told: a browser asks for six things at a time
    await Promise.all(told);
  }

  /** People who walk about in a scene that opens, before the camera. */
  async welcome() {
    const { count, area } = this.stage.approach(this.place.level);
    await this.roamers(count, area);
  }

  /** An agent of a shape { gender, betas } or { phenotype }, with a name; its id. */
  async enlist(shape) {
    const [made] = await this.create(1, shape);
    return made.agent_id;
  }

  /** Let somebody who has just been created walk about, once it is seen. */
  async setOff(id) {
    const current = this.session.id;
    while (this.session.id === current) {
      const person = this.crowd.people.find(({ agent, shown }) => agent.id === id && shown);
      if (person) {
        this.met(person);
        return this.errands.roam([person]);
      }
      await new Promise((go) => setTimeout(go, SOON));
    }
  }
}
