// The HTTP API as functions. See /docs for its reference.

const ANSWER_SECONDS = 10;
const NOBODY = { token: "", headers: {}, protocols: [] };

/** A refusal of the server, or no answer at all (status 0). */
export class ApiError extends Error {
  constructor(message, status) {
    super(message);
    this.name = "ApiError";
    this.status = status;
  }
}

export class Api {
  /**
   * `base` is the server's address without a final slash; "" is the one this page came from. `access`
   * (access.js) shows who calls, and gets another token where the one it has is refused.
   */
  constructor(base = "", access = NOBODY, fetcher = (...request) => fetch(...request)) {
    this.base = base;
    this.access = access;
    this.fetcher = fetcher;
  }

  createSession(leaseSeconds) {
    return this.#call("POST", "/v1/sessions", { basis: "gltf", lease_s: leaseSeconds });
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

  clearGoal(agentId) {
    return this.#call("DELETE", `${agentPath(agentId)}/goal`);
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

  async #call(method, path, body) {
    const { token } = this.access;
    try {
      return await this.#ask(method, path, body);
    } catch (error) {
      if (error.status !== 401 || !this.access.renew) throw error;
      await this.access.renew(token, error.message);
      return this.#call(method, path, body);
    }
  }

  async #ask(method, path, body) {
    const request = {
      method,
      headers: { accept: "application/json", ...this.access.headers },
      signal: AbortSignal.timeout(ANSWER_SECONDS * 1000),
    };
    if (body !== undefined) {
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
    if (!response.ok) throw new ApiError(reason(text, response.status), response.status);
    return text ? JSON.parse(text) : null;
  }
}

function agentPath(agentId) {
  return `/v1/agents/${encodeURIComponent(agentId)}`;
}

function onFloor({ x, z, ...how }) {
  return { position: { x, y: 0, z }, ...how };
}

/** What an RFC 9457 problem document says, fields named; or the bare status. */
function reason(text, status) {
  try {
    const problem = JSON.parse(text);
    const fields = (problem.errors ?? []).map(({ field, detail }) => `${field}: ${detail}`);
    return fields.length ? fields.join("; ") : (problem.detail ?? problem.title ?? `HTTP ${status}`);
  } catch {
    return `HTTP ${status}`; // not JSON: a proxy's page
  }
}
