// This page's session: opened, and opened anew when it ended.

import { Session } from "./client/index.js";
import { showConnection, tell } from "./hud.js";

const STATES = { connecting: "connecting", open: "connected", lost: "connection lost, reconnecting" };

export class PageSession {
  /** `query`: encoding, fps … of the stream; `on.event(event)`, `on.ended()` when a new one is needed. */
  constructor(api, crowd, query, clock, on) {
    Object.assign(this, { api, crowd, query, clock, on });
    this.current = null;
    this.scene = "";
    addEventListener("pagehide", () => this.current?.own && api.abandonSession(this.current.id));
  }

  get id() {
    return this.current?.id ?? null;
  }

  get player() {
    return this.current?.player ?? null;
  }

  /** A new one in a scene, or with "" on a floor without end; the one before ends. Throws ApiError. */
  async open(scene = "") {
    this.#enter(await Session.open(this.api, this.#options(scene)));
  }

  /** Somebody else's, to watch it and give goals in it; the one before ends. */
  join(id, scene) {
    this.#enter(Session.join(this.api, id, this.#options(scene)));
  }

  /** End it, or leave it if it is somebody else's. */
  leave() {
    this.current?.close();
    this.current = null;
  }

  #enter(session) {
    this.current?.close();
    this.current = session;
    this.scene = session.scene;
  }

  #options(scene) {
    return {
      scene,
      query: this.query,
      stream: { now: this.clock },
      on: {
        ...this.crowd.handlers(this.clock),
        event: this.on.event,
        status: (state, detail) => showConnection(state, detail ? `${STATES[state]} (${detail})` : STATES[state]),
        failed: (reason) => tell(`${reason}. Reload the page to begin anew.`),
        ended: (reason) => {
          tell(`The session has ended (${reason}). A new one begins.`);
          this.on.ended();
        },
      },
    };
  }
}
