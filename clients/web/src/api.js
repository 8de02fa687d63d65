// The HTTP API as functions: basis glTF, metres. A server's /docs is its reference.

import { Access } from "./access.js";
import { Homes } from "./core/homes.js";

const ANSWER_SECONDS = 10;
const BAKE_SECONDS = 60; // for calls that may take the server longer
const PATIENCE_SECONDS = 15; // for which a call that is refused temporarily is repeated

/** @typedef {{ x: number, y: number, z: number }} Place */
/**
 * A place to go to, in metres. `y` selects the storey in a scene; `heading` is the direction to face there, in radians.
 * Other fields of a goal of the API pass as they are.
 * @typedef {{ x: number, y?: number, z: number, speed?: number, heading?: number, radius?: number, stop?: boolean, dwell?: number, strafe?: boolean, [field: string]: any }} Goal
 */

/** A refusal of the server, or no answer at all (status 0). */
export class ApiError extends Error {
  /**
   * `problem`: the whole problem document (RFC 9457), if there is one.
   * @param {string} message @param {number} status @param {Record<string, any>} [problem]
   */
  constructor(message, status, problem = {}) {
    super(message);
    this.name = "ApiError";
    this.status = status;
    this.problem = problem;
  }
}

export class Api {
  /**
   * `base` is the server's address without a final slash; "" is the one this page came from. `access` holds the
   * credentials, and gets another token when one is refused. A call that is refused temporarily (429) is sent again
   * after the server's waiting time; `pause(seconds, error)` waits until then.
   * @param {string} [base]
   * @param {{ access?: Access, fetcher?: typeof fetch, pause?: (seconds: number, error: ApiError) => Promise<unknown> }} [options]
   */
  constructor(base = "", { access = new Access(), fetcher = (...request) => fetch(...request), pause = sleep } = {}) {
    this.base = base;
    this.homes = new Homes(base || (globalThis.location?.origin ?? ""));
    this.access = access;
    this.fetcher = fetcher;
    this.pause = pause;
  }

  /** A session in a scene, or with "" on an endless floor. @param {number} leaseSeconds @param {string} [scene] */
  createSession(leaseSeconds, scene = "") {
    return this.#call("POST", "/v1/sessions", { basis: "gltf", lease_s: leaseSeconds, ...(scene && { scene }) });
  }

  /** `basis`, `scene`, `agent_ids` … of a session. @param {string} sessionId */
  session(sessionId) {
    return this.#call("GET", `/v1/sessions/${encodeURIComponent(sessionId)}`);
  }

  /** @param {string} sessionId */
  renewSession(sessionId) {
    return this.#call("POST", `/v1/sessions/${encodeURIComponent(sessionId)}/renew`);
  }

  /** Ends a session while the page is closed. @param {string} sessionId */
  abandonSession(sessionId) {
    this.fetcher(`${this.homeOf(sessionId)}/v1/sessions/${encodeURIComponent(sessionId)}`, {
      method: "DELETE",
      headers: this.access.headers,
      keepalive: true,
    }).catch(() => {}); // there is no one left to report it to
  }

  /** The server's version, limits, bases. */
  info() {
    return this.#call("GET", "/v1/info");
  }

  async bodies() {
    return (await this.#call("GET", "/v1/bodies")).bodies;
  }

  /**
   * The body with the proportions of a character: `gender` and `betas` for an agent. The character's joints at rest are
   * [{ bone, position }]. `floor`: height of the ground under its soles.
   * @param {{ bone: string, position: Place }[]} joints @param {number} [floor]
   */
  fitBody(joints, floor) {
    return this.#call("POST", "/v1/bodies:fit", { joints, ...(floor !== undefined && { floor }) });
  }

  /**
   * Creates agents, all or none. `patience`: seconds that they are asked for again while there is no room.
   * @param {string} sessionId @param {object[]} agents @param {number} [patience] @returns {Promise<any[]>}
   */
  async createAgents(sessionId, agents, patience) {
    const path = `/v1/sessions/${encodeURIComponent(sessionId)}/agents`;
    return (await this.#call("POST", path, { agents }, ANSWER_SECONDS, patience)).agents;
  }

  /** @param {string} sessionId @returns {Promise<any[]>} */
  async agents(sessionId) {
    return (await this.#call("GET", `/v1/sessions/${encodeURIComponent(sessionId)}/agents`)).agents;
  }

  /** @param {string} agentId */
  deleteAgent(agentId) {
    return this.#call("DELETE", agentPath(agentId));
  }

  /**
   * Sends an agent to points of the floor in turn: [{ x, z, speed, heading … }], glTF basis.
   * @param {string} agentId @param {Goal[]} goals
   */
  setPath(agentId, goals) {
    return this.#call("PUT", `${agentPath(agentId)}/path`, { goals: goals.map(onFloor) });
  }

  /** Adds points to the end of its path. @param {string} agentId @param {Goal[]} goals */
  appendGoals(agentId, goals) {
    return this.#call("POST", `${agentPath(agentId)}/goals`, { goals: goals.map(onFloor) });
  }

  /**
   * Makes an agent wander within `radius` metres of { x, z }.
   * @param {string} agentId @param {{ x: number, z: number }} middle @param {number} radius @param {object} [how]
   */
  wander(agentId, { x, z }, radius, how) {
    const area = { center: { x, y: 0, z }, radius };
    return this.#call("PUT", `${agentPath(agentId)}/wander`, { area, ...how });
  }

  /** Makes an agent wander all over its scene. @param {string} agentId @param {object} [how] */
  roam(agentId, how) {
    return this.#call("PUT", `${agentPath(agentId)}/wander`, how);
  }

  /**
   * Gives an agent a behaviour: { patrol }, { follow }, { keep_away }, { queue } …
   * @param {string} agentId @param {object} behaviour
   */
  behave(agentId, behaviour) {
    return this.#call("PUT", `${agentPath(agentId)}/behaviour`, behaviour);
  }

  /** @param {string} agentId */
  clearGoal(agentId) {
    return this.#call("DELETE", `${agentPath(agentId)}/goal`);
  }

  /** Scenes that come with the server: [{ name, summary }]. */
  async exampleScenes() {
    return (await this.#call("GET", "/v1/scenes/examples")).examples;
  }

  /** @param {string} name */
  createExampleScene(name) {
    return this.#call("POST", `/v1/scenes/examples/${encodeURIComponent(name)}`, {}, BAKE_SECONDS);
  }

  /**
   * A scene of a mesh file (its bytes): `format` is "glb", "obj" or "ply".
   * @param {ArrayBuffer} bytes @param {string} format @param {string} name
   */
  createMeshScene(bytes, format, name) {
    const query = new URLSearchParams({ format, name });
    return this.#call("POST", `/v1/scenes/mesh?${query}`, bytes, BAKE_SECONDS);
  }

  async scenes() {
    return (await this.#call("GET", "/v1/scenes")).scenes;
  }

  /** @param {string} sceneId */
  scene(sceneId) {
    return this.#call("GET", scenePath(sceneId));
  }

  /** The outlines to draw it; see `outlinesOf` in scenes.js. @param {string} sceneId */
  sceneOutlines(sceneId) {
    return this.#call("GET", `${scenePath(sceneId)}/outlines`);
  }

  /**
   * Places or moves an obstacle: { box } …
   * @param {string} sceneId @param {string} name @param {object} obstacle
   */
  putObstacle(sceneId, name, obstacle) {
    return this.#call("PUT", `${scenePath(sceneId)}/obstacles/${encodeURIComponent(name)}`, obstacle);
  }

  /** @param {string} sceneId @param {string} name */
  removeObstacle(sceneId, name) {
    return this.#call("DELETE", `${scenePath(sceneId)}/obstacles/${encodeURIComponent(name)}`);
  }

  /**
   * The way an agent would take between two points { x, y, z }.
   * @param {string} sceneId @param {Place} start @param {Place} goal
   */
  queryPath(sceneId, start, goal) {
    return this.#call("POST", `${scenePath(sceneId)}/path`, { start, goal });
  }

  /** Populates the session's scene with `count` walking people. @param {string} sessionId @param {number} count */
  populate(sessionId, count) {
    return this.#call("POST", `/v1/sessions/${encodeURIComponent(sessionId)}/crowd`, { count }, BAKE_SECONDS);
  }

  stats() {
    return this.#call("GET", "/v1/stats");
  }

  /**
   * Where MotionStream connects: `query` has encoding, fps … as in the query of WS /v1/stream.
   * @param {string} sessionId @param {Record<string, string | number>} [query] @param {string} [resumeToken]
   * @param {{ href: string }} [location]
   */
  streamAddress(sessionId, query = {}, resumeToken = "", location = globalThis.location) {
    const url = new URL(`${this.homeOf(sessionId)}/v1/stream`, location?.href);
    url.protocol = url.protocol === "https:" ? "wss:" : "ws:";
    url.searchParams.set("session", sessionId);
    for (const [key, value] of Object.entries(query)) url.searchParams.set(key, String(value));
    if (resumeToken) url.searchParams.set("resume_token", resumeToken);
    return { url: url.href, protocols: this.access.protocols };
  }

  /**
   * The known address for calls of a session, scene or agent: `base`, or its node in a cluster.
   * @param {string} text its id, or a path with it
   */
  homeOf(text) {
    return this.homes.home(text);
  }

  /**
   * Any call of the HTTP API, with this class's retries and routing; returns the answer's JSON.
   * @param {string} method @param {string} path @param {unknown} [body] @param {number} [seconds] @returns {Promise<any>}
   */
  call(method, path, body, seconds) {
    return this.#call(method, path, body, seconds);
  }

  /** @param {string} method @param {string} path @param {unknown} [body] @param {number} [seconds] @param {number} [patience] @returns {Promise<any>} */
  async #call(method, path, body, seconds = ANSWER_SECONDS, patience = PATIENCE_SECONDS) {
    const route = this.homes.route(path);
    for (;;) {
      const { token } = this.access;
      try {
        const answer = await this.#ask(route.address, method, path, body, seconds);
        route.answered(answer?.session_id ?? answer?.scene_id);
        return answer;
      } catch (error) {
        if (!(error instanceof ApiError)) throw error;
        if (route.refused(error.status, error.problem.endpoint)) continue;
        const wait = error.status === 429 ? error.problem.retry_after_s : 0;
        if (wait && wait <= patience) {
          patience -= wait;
          await this.pause(wait, error);
        } else if (error.status !== 401 || !(await this.access.renew(token, error.message))) {
          throw error;
        }
      }
    }
  }

  /** @param {string} base @param {string} method @param {string} path @param {unknown} body @param {number} seconds @returns {Promise<any>} */
  async #ask(base, method, path, body, seconds) {
    /** @type {RequestInit & { headers: Record<string, string> }} */
    const request = {
      method,
      headers: { accept: "application/json", ...this.access.headers },
      signal: AbortSignal.timeout(seconds * 1000),
    };
    if (body instanceof ArrayBuffer) {
      request.headers["content-type"] = "application/octet-stream";
      request.body = body;
    } else if (body !== undefined) {
      request.headers["content-type"] = "application/json";
      request.body = JSON.stringify(body);
    }
    let response, text;
    try {
      response = await this.fetcher(base + path, request);
      text = await response.text(); // it can be cut off, or the time be over, after the status has come
    } catch (error) {
      const { message, cause } = /** @type {Error & { cause?: { code?: string, message: string } }} */ (error);
      // Node repeats a request answered with 421 by itself, sometimes without the body; the server took nothing
      if (cause?.code === "UND_ERR_REQ_CONTENT_LENGTH_MISMATCH") return this.#ask(base, method, path, body, seconds);
      const page = globalThis.location?.origin; // a browser does not report that the server forbade it
      const elsewhere = page && new URL(base, page).origin !== page ? `, or its cors_origins do not list ${page}` : "";
      throw new ApiError(`the server does not answer${elsewhere} (${cause?.message ?? message})`, 0); // Node says "fetch failed" only
    }
    if (!response.ok) throw refusal(text, response.status);
    return text ? JSON.parse(text) : null;
  }
}

const sleep = (/** @type {number} */ seconds) => new Promise((done) => setTimeout(done, 1000 * seconds));

/** @param {string} agentId */
function agentPath(agentId) {
  return `/v1/agents/${encodeURIComponent(agentId)}`;
}

/** @param {string} sceneId */
function scenePath(sceneId) {
  return `/v1/scenes/${encodeURIComponent(sceneId)}`;
}

/** A goal in the form of the API. @param {Goal} goal */
export function onFloor({ x, y = 0, z, ...how }) {
  return { position: { x, y, z }, ...how };
}

/** The text of an RFC 9457 problem document with its fields, or the bare status. @param {string} text @param {number} status */
function refusal(text, status) {
  let problem;
  try {
    problem = JSON.parse(text);
  } catch {
    return new ApiError(`HTTP ${status}`, status); // not JSON: a proxy's page
  }
  const fields = (problem.errors ?? []).map((/** @type {any} */ { field, detail }) => `${field}: ${detail}`);
  const said = fields.length ? fields.join("; ") : (problem.detail ?? problem.title ?? `HTTP ${status}`);
  return new ApiError(said, status, problem);
}
