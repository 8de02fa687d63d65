// The HTTP API as functions. See /docs for its reference.

const ANSWER_SECONDS = 10;

/** A refusal of the server, or no answer at all (status 0). */
export class ApiError extends Error {
  constructor(message, status) {
    super(message);
    this.name = "ApiError";
    this.status = status;
  }
}

export class Api {
  /** `base` is the server's address without a final slash; "" is the one this page came from. */
  constructor(base = "", fetcher = (...request) => fetch(...request)) {
    this.base = base;
    this.fetcher = fetcher;
  }

  createSession() {
    return this.#call("POST", "/v1/sessions", { basis: "gltf" });
  }

  /** End a session while the page goes away. */
  abandonSession(sessionId) {
    this.fetcher(`${this.base}/v1/sessions/${encodeURIComponent(sessionId)}`, {
      method: "DELETE",
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

  deleteAgent(agentId) {
    return this.#call("DELETE", `/v1/agents/${encodeURIComponent(agentId)}`);
  }

  /** Send an agent to points of the floor in turn: [{ x, z, speed, heading … }], glTF basis. */
  setPath(agentId, goals) {
    const path = goals.map(({ x, z, ...how }) => ({ position: { x, y: 0, z }, ...how }));
    return this.#call("PUT", `/v1/agents/${encodeURIComponent(agentId)}/path`, { goals: path });
  }

  clearGoal(agentId) {
    return this.#call("DELETE", `/v1/agents/${encodeURIComponent(agentId)}/goal`);
  }

  stats() {
    return this.#call("GET", "/v1/stats");
  }

  streamUrl(sessionId, location = globalThis.location) {
    const url = new URL(`${this.base}/v1/stream`, location.href);
    url.protocol = url.protocol === "https:" ? "wss:" : "ws:";
    url.searchParams.set("session", sessionId);
    return url.href;
  }

  async #call(method, path, body) {
    const request = {
      method,
      headers: { accept: "application/json" },
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
