// The contents of a link: first the last seconds as another user saw them, then a script, played in separate lock-step sessions:
// without other people, and with no clock but the steps, so that it is the same each time. If it is played twice, the second time
// with a difference, the two are shown over each other.

import { ENCODING, PlayedAgent, frameBytes, onFloor, unpackPoses } from "./client/index.js";
import { FPS as PAST_FPS } from "./packed_past.js";
import { prismOf } from "./scenes.js";

const LEASE = 60; // seconds
const STEP_SECONDS = 0.2;
const STEPS = 5; // requested at a time
const FPS = 40;
const TOGETHER = 64; // people made in one call
const AHEAD = 5; // seconds of motion that are made before they are shown: a track keeps 10
const WAIT = 200; // ms
const FLOOR = { area: { center: { x: 0, y: 0, z: 0 }, radius: 9 } }; // where people roam without a scene
const BONES = 22;
const CODING = ENCODING.F32_LE;
const OTHERS = 4096; // added to the aliases of the second play
const SEAM = 0.4; // seconds in which people blend from the past to the pose in which the script begins
const MODEL = "model:";
const OTHERWISE = { // by name, as in an address: texts about the people, and how they are made
  seeds: { title: "other seed", plain: "their seeds", made: (spec) => ({ ...spec, seed: (spec.seed + 1) % 2 ** 32 }) },
  poses: { title: "without foot lock", plain: "with foot lock", made: (spec) => ({ ...spec, foot_lock: false }) },
};

/** How people are compared with themselves: "seeds", "poses" or "model:" and a loaded model's name; null: not. */
function comparison(name) {
  if (Object.hasOwn(OTHERWISE, name)) return OTHERWISE[name];
  if (!name.startsWith(MODEL) || name === MODEL) return null;
  const model = name.slice(MODEL.length);
  return { title: `model ${model}`, plain: null, made: (spec) => ({ ...spec, model }) }; // plain: the default model
}

export class Replay {
  /**
   * `on`: as for a session's player. `beside`: the second play, see `comparison`. `past`: the seconds before (`decodePast`). `at`:
   * seconds where it begins, by default with the past, or where a comparison begins.
   */
  constructor(api, script, on, { beside = "", past = null, at = null } = {}) {
    const otherwise = comparison(beside);
    this.begins = past ? (past.count - 1) / PAST_FPS + SEAM : 0; // seconds where the script begins
    this.ends = this.begins + script.seconds;
    Object.assign(this, { script, on, past });
    this.at = Math.min(at ?? (otherwise ? this.begins : 0), this.ends - STEP_SECONDS);
    this.calls = (...call) => api.call(...call);
    this.own = true;
    this.scene = "";
    this.player = new ReplayPlayer(on, this.at, this.begins);
    this.takes = [null, ...(otherwise ? [otherwise] : [])].map((other, k) => ({ otherwise: other, first: k * OTHERS, id: null, people: [] }));
    this.legend = null; // texts about the people, and about those over them
    this.given = 0; // frames of the past that have been given to the player
    this.closed = false;
  }

  get id() {
    return this.takes[0].id;
  }

  /** Makes scenes, sessions and people, and begins. Resolves when the first motion has come. */
  async open() {
    const { calls } = this;
    const { bones } = await calls("GET", "/v1/skeleton");
    this.on.header({ bones: bones.slice(0, BONES).map((_, k) => k), skeleton: bones }, false);
    for (const take of this.takes) {
      const scene = await this.#place();
      this.scene ||= scene;
      const session = await calls("POST", "/v1/sessions", { basis: "gltf", lease_s: LEASE, lock_step: true, seed: 0, ...(scene && { scene }) });
      take.id = session.session_id;
      const title = take.otherwise ? `, ${take.otherwise.title}` : "";
      const agents = await this.#people(take);
      if (take.otherwise) this.legend = [take.otherwise.plain ?? `model ${this.takes[0].people[0]?.agent.model}`, take.otherwise.title];
      for (const [k, agent] of agents.entries()) {
        const seen = take.otherwise ? [] : this.past?.people[k]?.frames ?? [];
        const since = this.past && seen.length ? (this.past.count - seen.length) / PAST_FPS : this.begins;
        const told = { ...agent, alias: agent.alias + take.first, name: agent.name + title, beside: title !== "" };
        take.people.push(this.player.add(told, since));
      }
    }
    do await this.#step(); while (this.player.made <= this.at + STEP_SECONDS);
    this.#steps();
  }

  /** A scene for each play, since people in one scene avoid each other; its id, or "". */
  async #place() {
    const { calls, script } = this;
    if (!script.scene) return "";
    const { scene_id: id } = await calls("POST", `/v1/scenes/examples/${encodeURIComponent(script.scene)}`, {});
    for (const [name, top, bottom] of script.crates) {
      await calls("PUT", `/v1/scenes/${id}/obstacles/${encodeURIComponent(name)}`, prismOf({ top, bottom }));
    }
    return id;
  }

  async #people({ id, otherwise }) {
    const { calls, script: { people } } = this;
    const made = otherwise?.made ?? ((spec) => spec);
    const specs = people.map(({ name, gender, betas, seed, place: [x, y, z], heading }) => (
      made({ name, gender, betas, seed, heading, position: { x, y, z } })
    ));
    const agents = [];
    while (agents.length < specs.length) {
      const some = specs.slice(agents.length, agents.length + TOGETHER);
      agents.push(...(await calls("POST", `/v1/sessions/${id}/agents`, { agents: some })).agents);
    }
    // one after the other: their order is part of the replay
    for (const [k, { goals }] of people.entries()) {
      const path = `/v1/agents/${agents[k].agent_id}`;
      if (goals === "roam") await calls("PUT", `${path}/wander`, this.script.scene ? {} : FLOOR);
      else if (goals.length) await calls("PUT", `${path}/path`, { goals: goals.map(onFloor) });
    }
    return agents;
  }

  async #steps() {
    try {
      while (!this.closed && this.player.made < this.ends) {
        if (this.player.made - (this.player.moment || 0) < AHEAD) await this.#step();
        else await new Promise((go) => setTimeout(go, WAIT));
      }
    } catch (error) {
      if (!this.closed) this.on.failed(error.message);
    }
  }

  async #step() {
    if (this.past && this.given < this.past.count) return this.#remember(PAST_FPS);
    const made = await Promise.all(this.takes.map(({ id }) => this.calls("POST", `/v1/sessions/${id}/step`, { steps: STEPS })));
    made.forEach(({ batches, events }, k) => {
      const { first } = this.takes[k];
      for (const { chunks } of batches) if (chunks) this.player.take(chunks, first);
      for (const event of events) this.on.event?.({ ...event, alias: event.alias + first });
    });
    this.player.made = Math.max(this.player.made, this.begins) + made[0].batches.length * STEP_SECONDS;
  }

  /** Gives the player some more frames of the past. */
  #remember(frames) {
    const { people, count } = this.past;
    const to = Math.min(count, this.given + frames);
    people.forEach(({ frames: seen, contacts }, number) => {
      const came = count - seen.length, { track } = this.takes[0].people[number];
      for (let k = Math.max(this.given, came); k < to; k += 1) track.push(k / PAST_FPS, PAST_FPS, seen[k - came], 1, contacts, k - came);
    });
    this.given = to;
    this.player.made = (to - 1) / PAST_FPS;
  }

  close() {
    this.closed = true;
    for (const { id } of this.takes) if (id) this.calls("DELETE", `/v1/sessions/${id}`).catch(() => {}); // its lease ends it
    this.player.clear();
  }
}

/** The player of a replay: like MotionPlayer, with steps instead of a stream. Times are seconds from its beginning. */
class ReplayPlayer {
  /** `at` is the second that it shows first, `begins` the second of the first chunk. */
  constructor(on, at, begins) {
    Object.assign(this, { on, at, begins });
    this.agents = new Map();
    this.moment = NaN;
    this.made = 0; // seconds of motion that exist
    this.start = null;
    this.header = null;
    this.underruns = 0;
    this.buffered = Infinity;
    this.clock = { delay: () => 0, advance: (now) => this.#at(now) };
    this.room = new Float32Array((3 + 4 * BONES) * 64);
    this.epoch = null;
  }

  /** A person present from `since` on. */
  add({ agent_id: id, alias, name, gender, betas, seed, outfit, rest_offsets: restOffsets, model, beside }, since) {
    const played = new PlayedAgent({ id, alias, name, gender, betas, seed, outfit, restOffsets, model, beside }, 3 + 4 * BONES);
    played.since = since;
    this.agents.set(alias, played);
    this.on.added(played);
    return played;
  }

  /** Chunks of a step, as columns; `first` is added to their aliases. */
  take({ aliases, scheduled_at_us: times, states, flags, poses, contacts, goal_revisions: revisions, waypoints }, first) {
    const bytes = bytesOf(poses), stood = bytesOf(contacts);
    const view = new DataView(bytes.buffer);
    const size = frameBytes(CODING, BONES);
    const frames = stood.length / aliases.length;
    this.epoch ??= times[0] / 1e6;
    aliases.forEach((alias, k) => {
      const played = this.agents.get(alias + first);
      unpackPoses(view, k * frames * size, frames, CODING, BONES, this.room);
      played.track.push(this.begins + times[k] / 1e6 - this.epoch, FPS, this.room, frames, stood, k * frames);
      played.state = states[k];
      this.on.chunk(played, { flags: flags[k], goalRevision: revisions[k], waypoint: waypoints[k] });
    });
  }

  /** Shows all people at local time `now`; it waits if there is no motion yet, and stops at the end. */
  advance(now) {
    this.moment = this.#at(now);
    for (const played of this.agents.values()) played.shown = this.moment >= played.since && played.track.sample(this.moment, played.frame);
    return this.moment;
  }

  #at(now) {
    this.start ??= now - this.at;
    const there = Math.max(0, this.made - STEP_SECONDS);
    if (now - this.start > there) this.start = now - there;
    return now - this.start;
  }

  remove(alias) {
    const played = this.agents.get(alias);
    this.agents.delete(alias);
    if (played) this.on.removed(played);
  }

  clear() {
    for (const alias of [...this.agents.keys()]) this.remove(alias);
  }
}

function bytesOf(base64) {
  return Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
}
