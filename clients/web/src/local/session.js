// A session without a server: the same calls and callbacks as `Session`, with people computed on this machine.

import { ApiError } from "../api.js";
import { PlayedAgent } from "../core/player.js";
import { sharedClock } from "./host.js";

const FPS = 40, FRAMES = 8, WIDTH = 3 + 4 * 22;
const DELAY = 0.12; // seconds by which people are shown late, so that chunks come in time
const BETAS = 10;
/** @type {Record<string, [number, number]>} */
const RANGES = { radius: [0.05, 10], speed: [0.2, 4], dwell: [0, 3600], heading: [-6.2832, 6.2832] };
const FARTHEST = 10_000; // metres

/** @typedef {import("../api.js").Goal} Goal */
/**
 * `model`: address of a folder written by `wayfarer export --for web`, with a final slash. `runtime`: address of
 * `ort.wasm.min.mjs` of the package onnxruntime-web, with its .wasm in the same folder. `scene`: address of a folder written by
 * `wayfarer export --for web --scene`, with a final slash: people walk around its obstacles. Without it the floor is
 * endless. `avoid`: false lets them walk through each other. `on`: callbacks of a stream's player, `loaded(bytes)`
 * while files come, and `failed(reason)` when people can no longer be moved.
 * @typedef {object} LocalOptions
 * @property {string | URL} model @property {string | URL} runtime @property {string | URL} [scene] @property {boolean} [avoid]
 * @property {import("../core/player.js").PlayerEvents & { loaded?: (bytes: number) => void, failed?: (reason: string) => void }} [on]
 */
/**
 * A person to create, like an agent of the HTTP API: glTF basis, metres.
 * @typedef {object} LocalAgent
 * @property {string} [name] @property {"female" | "male"} [gender] @property {number[]} [betas]
 * @property {{ x: number, z: number }} [position] @property {number} [heading] radians; 0 faces +Z
 * @property {number | bigint} [seed] determines the person's motion @property {boolean} [foot_lock]
 */

/** People that walk in this page, without a server. */
export class LocalSession {
  /** @type {Map<number, { done: (value: any) => void, failed: (error: Error) => void }>} */
  #calls = new Map();
  #lastCall = 0;
  #worker;

  /**
   * Loads the model and gets ready. Rejects with an Error that names the file that could not be loaded.
   * @param {LocalOptions} options @returns {Promise<LocalSession>}
   */
  static async open(options) {
    const session = new LocalSession(new Worker(new URL("./worker.js", import.meta.url), { type: "module" }), options);
    const absolute = (/** @type {string | URL} */ address) => new URL(address, globalThis.location?.href).href;
    try {
      const { model, runtime, scene, avoid } = options;
      await session.#call("open", { model: absolute(model), runtime: absolute(runtime), ...(scene && { scene: absolute(scene) }), avoid });
    } catch (error) {
      session.close();
      throw error;
    }
    return session;
  }

  /** @param {Worker} worker @param {LocalOptions} options */
  constructor(worker, { on = {} }) {
    this.on = on;
    this.now = sharedClock;
    /** All agents as shown, by alias. @type {Map<number, PlayedAgent>} */
    this.agents = new Map();
    /** The calls of `Api` that a local session has. */
    this.api = new LocalApi(this, (call, ...values) => this.#call(call, ...values));
    this.#worker = worker;
    worker.addEventListener("message", ({ data }) => this.#take(data));
    worker.addEventListener("error", (event) => this.#died(event.message || "the worker could not be loaded"));
  }

  /** How often an agent's frames ran out: the machine is too slow for this many people. */
  get underruns() {
    let sum = 0;
    for (const { track } of this.agents.values()) sum += track.underruns;
    return sum;
  }

  /** Creates people. @param {LocalAgent[]} specs @returns {Promise<{ agent_id: string, alias: number }[]>} */
  async createAgents(specs) {
    const made = specs.map((spec, k) => checked(spec, `agents[${k}]`)); // all are valid, or none is created
    return Promise.all(made.map((spec, k) => this.#create(spec, specs[k])));
  }

  /** Shows all agents as at this moment, and fills their `frame`s. Call it once per picture. */
  update() {
    const moment = this.now() - DELAY;
    for (const played of this.agents.values()) played.shown = played.track.sample(moment, played.frame);
    return moment;
  }

  /** Milliseconds in the graph (`graphMs`) and around it (`otherMs`), steps of people (`rows`), `calls`, `waited`. */
  figures() {
    return this.#call("figures");
  }

  /** Ends the session and its agents. */
  close() {
    this.#worker.terminate();
    for (const alias of [...this.agents.keys()]) this.forget(alias);
    this.#died("the session is closed", false);
  }

  /** @param {number} alias */
  forget(alias) {
    const played = this.agents.get(alias);
    this.agents.delete(alias);
    if (played) this.on.removed?.(played);
  }

  /** @param {ReturnType<typeof checked>} spec @param {LocalAgent} asked */
  async #create(spec, asked) {
    const { alias, bones } = await this.#call("add", spec);
    const restOffsets = [];
    for (let k = 0; k < bones.length; k += 3) restOffsets.push(-bones[k], bones[k + 2], bones[k + 1]);
    const id = String(alias), { gender, betas } = spec;
    const played = new PlayedAgent({ id, alias, name: asked.name ?? "", body: "anny52", gender, betas, seed: Number(spec.seed), outfit: "", restOffsets }, WIDTH);
    this.agents.set(alias, played);
    this.on.added?.(played);
    return { agent_id: id, alias };
  }

  /** @param {string} call @param {...any} values @returns {Promise<any>} */
  #call(call, ...values) {
    const id = (this.#lastCall += 1);
    return new Promise((done, failed) => {
      this.#calls.set(id, { done, failed });
      this.#worker.postMessage({ id, call, values });
    });
  }

  /** @param {any} message */
  #take(message) {
    if (message.kind === "chunk") this.#chunk(message);
    else if (message.kind === "event") this.on.event?.(message.event);
    else if (message.kind === "loaded") this.on.loaded?.(message.bytes);
    else if (message.kind === "failed") this.#died(message.reason);
    else {
      const call = this.#calls.get(message.id);
      this.#calls.delete(message.id);
      if (message.error) call?.failed(new Error(message.error));
      else call?.done(message.result);
    }
  }

  /** @param {import("./host.js").ChunkMessage} message */
  #chunk({ alias, seq, at, goalRevision, state, flags, waypoint, frames, contacts }) {
    const played = this.agents.get(alias);
    if (!played) return; // removed, its last chunks still on the way
    played.track.push(at, FPS, frames, FRAMES, contacts);
    played.state = state;
    this.on.chunk?.(played, {
      alias, seq, firstFrame: FRAMES * seq, scheduledAt: at, goalRevision, state, flags, waypoint, candidates: 1,
      frames: FRAMES, poses: 0, contacts: 0,
    });
  }

  /** @param {string} reason @param {boolean} [unexpected] */
  #died(reason, unexpected = true) {
    for (const { failed } of this.#calls.values()) failed(new Error(reason));
    this.#calls.clear();
    if (unexpected) this.on.failed?.(reason);
  }
}

/** The calls of `Api` that a local session has: agents by id, glTF basis, metres. */
class LocalApi {
  /** @param {LocalSession} session @param {(call: string, ...values: any[]) => Promise<any>} call */
  constructor(session, call) {
    this.session = session;
    this.call = call;
  }

  /** Sends an agent to points of the floor in turn. @param {string} agentId @param {Goal[]} goals */
  async setPath(agentId, goals) {
    await this.call("give", this.#alias(agentId), path(goals));
  }

  /** Adds points to the end of its path. @param {string} agentId @param {Goal[]} goals */
  async appendGoals(agentId, goals) {
    await this.call("append", this.#alias(agentId), path(goals));
  }

  /** Stops where it is. @param {string} agentId */
  async clearGoal(agentId) {
    await this.call("give", this.#alias(agentId), []);
  }

  /**
   * Makes an agent wander within `radius` metres of { x, z }. A server would draw other points.
   * @param {string} agentId @param {{ x: number, z: number }} middle @param {number} radius @param {{ speed?: number }} [how]
   */
  async wander(agentId, { x, z }, radius, { speed } = {}) {
    inRange("area.radius", radius, 0.5, 1000);
    if (speed !== undefined) inRange("speed", speed, ...RANGES.speed);
    const [goal] = path([{ x, z }]);
    await this.call("wander", this.#alias(agentId), { x: goal.x, y: goal.y, radius, ...(speed !== undefined && { speed }) });
  }

  /** @param {string} agentId */
  async deleteAgent(agentId) {
    const alias = this.#alias(agentId);
    await this.call("remove", alias);
    this.session.forget(alias);
  }

  /** @param {string} agentId */
  #alias(agentId) {
    const alias = Number(agentId);
    if (!this.session.agents.has(alias)) throw new ApiError(`there is no agent "${agentId}" in this session`, 404);
    return alias;
  }
}

/** Goals in the core's frame. Throws ApiError (422) that names the field. @param {Goal[]} goals */
function path(goals) {
  if (!goals.length || goals.length > 256) throw new ApiError(`goals: ${goals.length} goals; allowed: 1 to 256`, 422);
  return goals.map(({ x, z, ...how }, k) => {
    const where = `goals[${k}]`;
    inRange(`${where}.x`, x, -FARTHEST, FARTHEST);
    inRange(`${where}.z`, z, -FARTHEST, FARTHEST);
    for (const [name, [low, high]] of Object.entries(RANGES)) {
      const value = /** @type {any} */ (how)[name];
      if (value !== undefined) inRange(`${where}.${name}`, value, low, high);
    }
    const { radius, speed, heading, stop, strafe, dwell } = how;
    if (strafe && heading === undefined) throw new ApiError(`${where}.strafe: strafe needs a heading to hold on the way`, 422);
    if (dwell && stop === false) throw new ApiError(`${where}.dwell: an agent does not dwell where it does not stop`, 422);
    return { x: -x, y: z, radius, speed, heading, stop, strafe, dwell };
  });
}

/** @param {LocalAgent} spec @param {string} where */
function checked({ gender = "female", betas = [], position = { x: 0, z: 0 }, heading = 0, seed, foot_lock: footLock = true }, where) {
  if (gender !== "female" && gender !== "male") throw new ApiError(`${where}.gender: "${gender}"; allowed: female, male`, 422);
  if (betas.length > BETAS) throw new ApiError(`${where}.betas: ${betas.length} numbers; allowed: 0 to ${BETAS}`, 422);
  betas.forEach((beta, k) => inRange(`${where}.betas[${k}]`, beta, -5, 5));
  inRange(`${where}.position.x`, position.x, -FARTHEST, FARTHEST);
  inRange(`${where}.position.z`, position.z, -FARTHEST, FARTHEST);
  inRange(`${where}.heading`, heading, ...RANGES.heading);
  const drawn = seed ?? Math.floor(Math.random() * 2 ** 31);
  if (typeof drawn === "number" && !(Number.isSafeInteger(drawn) && drawn >= 0)) throw new ApiError(`${where}.seed: ${drawn}; allowed: a whole number from 0 on`, 422);
  const whole = Array.from({ length: BETAS }, (_, k) => betas[k] ?? 0);
  return { gender, betas: whole, x: -position.x, y: position.z, heading, seed: BigInt(drawn), footLock };
}

/** @param {string} field @param {unknown} value @param {number} low @param {number} high */
function inRange(field, value, low, high) {
  if (typeof value === "number" && value >= low && value <= high) return;
  throw new ApiError(`${field}: ${value}; allowed: ${low} to ${high}`, 422);
}
