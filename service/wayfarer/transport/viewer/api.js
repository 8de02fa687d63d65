// The HTTP API as functions. See /docs for its reference.

const ANSWER_SECONDS = 10;
const BAKE_SECONDS = 60; // for what may take the server longer
const PATIENCE_SECONDS = 15; // that a call which is refused for now is sent again
const NOBODY = { token: "", headers: {}, protocols: [] };

/** A refusal of the server, or no answer at all (status 0). */
export class ApiError extends Error {
  /** `problem`: the whole problem document (RFC 9457), as far as there is one. */
  constructor(message, status, problem = {}) {
    super(message);
    this.name = "ApiError";
    this.status = status;
    this.problem = problem;
  }
}

export class Api {
  /**
   * `base` is the server's address without a final slash; "" is the one this page came from. `access`
   * (access.js) shows who calls, and gets another token where the one it has is refused. A call that is
   * refused for now (429) is sent again when the server has said; `pause(seconds, error)` waits until then.
   */
  constructor(base = "", access = NOBODY, fetcher = (...request) => fetch(...request), pause = sleep) {
    this.base = base;
    this.access = access;
    this.fetcher = fetcher;
    this.pause = pause;
  }

  /** A session in a scene, or with "" on a floor without end. */
  createSession(leaseSeconds, scene = "") {
    return this.#call("POST", "/v1/sessions", { basis: "gltf", lease_s: leaseSeconds, ...(scene && { scene }) });
  }

  renewSession(sessionId) {
    return this.#call("POST", `/v1/sessions/${encodeURIComponent(sessionId)}/renew`);
  }

  /** End a session while the page goes away. */
  abandonSession(sessionId) {
    this.fetcher(`${this.base}/v1/sessions/${encodeURIComponent(sessionId)}`, {
      method: "DELETE",
      headers: this.access.headers,
      keepalive: true,
    }).catch(() => {}); // nobody is left to be told
  }

  /** The server's version, limits, bases. */
  info() {
    return this.#call("GET", "/v1/info");
  }

  async bodies() {
    return (await this.#call("GET", "/v1/bodies")).bodies;
  }

  async createAgents(sessionId, agents) {
    const path = `/v1/sessions/${encodeURIComponent(sessionId)}/agents`;
    return (await this.#call("POST", path, { agents })).agents;
  }

  async agents(sessionId) {
    return (await this.#call("GET", `/v1/sessions/${encodeURIComponent(sessionId)}/agents`)).agents;
  }

  deleteAgent(agentId) {
    return this.#call("DELETE", agentPath(agentId));
  }

  /** Send an agent to points of the floor in turn: [{ x, z, speed, heading … }], glTF basis. */
  setPath(agentId, goals) {
    return this.#call("PUT", `${agentPath(agentId)}/path`, { goals: goals.map(onFloor) });
  }

  /** Add points to the end of its path. */
  appendGoals(agentId, goals) {
    return this.#call("POST", `${agentPath(agentId)}/goals`, { goals: goals.map(onFloor) });
  }

  /** Let an agent walk about within `radius` metres of { x, z }. */
  wander(agentId, { x, z }, radius, how) {
    const area = { center: { x, y: 0, z }, radius };
    return this.#call("PUT", `${agentPath(agentId)}/wander`, { area, ...how });
  }

  /** Let an agent walk about all over its scene. */
  roam(agentId, how) {
    return this.#call("PUT", `${agentPath(agentId)}/wander`, how);
  }

  /** Let an agent do something of itself: { patrol } or { follow }, { keep_away }, { queue } … */
  behave(agentId, behaviour) {
    return this.#call("PUT", `${agentPath(agentId)}/behaviour`, behaviour);
  }

  clearGoal(agentId) {
    return this.#call("DELETE", `${agentPath(agentId)}/goal`);
  }

  /** Scenes that come with the server: [{ name, summary }]. */
  async exampleScenes() {
    return (await this.#call("GET", "/v1/scenes/examples")).examples;
  }

  createExampleScene(name) {
    return this.#call("POST", `/v1/scenes/examples/${encodeURIComponent(name)}`, {}, BAKE_SECONDS);
  }

  /** A scene of a mesh file (its bytes): `format` is "glb", "obj" or "ply". */
  createMeshScene(bytes, format, name) {
    const query = new URLSearchParams({ format, name });
    return this.#call("POST", `/v1/scenes/mesh?${query}`, bytes, BAKE_SECONDS);
  }

  async scenes() {
    return (await this.#call("GET", "/v1/scenes")).scenes;
  }

  scene(sceneId) {
    return this.#call("GET", scenePath(sceneId));
  }

  /** What is needed to draw it: see `outlinesOf` in scenes.js. */
  sceneOutlines(sceneId) {
    return this.#call("GET", `${scenePath(sceneId)}/outlines`);
  }

  /** Let an obstacle stand there, or move there: { box } … */
  putObstacle(sceneId, name, obstacle) {
    return this.#call("PUT", `${scenePath(sceneId)}/obstacles/${encodeURIComponent(name)}`, obstacle);
  }

  removeObstacle(sceneId, name) {
    return this.#call("DELETE", `${scenePath(sceneId)}/obstacles/${encodeURIComponent(name)}`);
  }

  /** The way an agent would take between two points { x, y, z }. */
  queryPath(sceneId, start, goal) {
    return this.#call("POST", `${scenePath(sceneId)}/path`, { start, goal });
  }

  /** Let so many people come and walk about in the session's scene. */
  populate(sessionId, count) {
    return this.#call("POST", `/v1/sessions/${encodeURIComponent(sessionId)}/crowd`, { count }, BAKE_SECONDS);
  }

  stats() {
    return this.#call("GET", "/v1/stats");
  }

  /** Where MotionStream connects: `wish` has encoding, fps … as in the query of WS /v1/stream. */
  streamAddress(sessionId, wish = {}, resumeToken = "", location = globalThis.location) {
    const url = new URL(`${this.base}/v1/stream`, location.href);
    url.protocol = url.protocol === "https:" ? "wss:" : "ws:";
    url.searchParams.set("session", sessionId);
    for (const [key, value] of Object.entries(wish)) url.searchParams.set(key, value);
    if (resumeToken) url.searchParams.set("resume_token", resumeToken);
    return { url: url.href, protocols: this.access.protocols };
  }

  async #call(method, path, body, seconds = ANSWER_SECONDS) {
    let patience = PATIENCE_SECONDS;
    for (;;) {
      const { token } = this.access;
      try {
        return await this.#ask(method, path, body, seconds);
      } catch (error) {
        const wait = error.status === 429 ? error.problem.retry_after_s : 0;
        if (wait && wait <= patience) {
          patience -= wait;
          await this.pause(wait, error);
        } else if (error.status === 401 && this.access.renew) {
          await this.access.renew(token, error.message);
        } else {
          throw error;
        }
      }
    }
  }

  async #ask(method, path, body, seconds) {
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
    let response;
    try {
      response = await this.fetcher(this.base + path, request);
    } catch (error) {
      throw new ApiError(`the server does not answer (${error.message})`, 0);
    }
    const text = await response.text();
    if (!response.ok) throw refusal(text, response.status);
    return text ? JSON.parse(text) : null;
  }
}

const sleep = (seconds) => new Promise((done) => setTimeout(done, 1000 * seconds));

function agentPath(agentId) {
  return `/v1/agents/${encodeURIComponent(agentId)}`;
}

function scenePath(sceneId) {
  return `/v1/scenes/${encodeURIComponent(sceneId)}`;
}

/** A goal { x, y, z, speed … } as the API has it. `y` says which storey is meant, in a scene. */
export function onFloor({ x, y = 0, z, ...how }) {
  return { position: { x, y, z }, ...how };
}

/** What an RFC 9457 problem document says, fields named; or the bare status. */
function refusal(text, status) {
  let problem;
  try {
    problem = JSON.parse(text);
  } catch {
    return new ApiError(`HTTP ${status}`, status); // not JSON: a proxy's page
  }
  const fields = (problem.errors ?? []).map(({ field, detail }) => `${field}: ${detail}`);
  const said = fields.length ? fields.join("; ") : (problem.detail ?? problem.title ?? `HTTP ${status}`);
  return new ApiError(said, status, problem);
}
