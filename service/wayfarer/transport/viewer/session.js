// This page's session: opened, kept alive, streamed, and opened anew when it ended.

import { showConnection, tell } from "./hud.js";
import { keepAlive } from "./lease.js";
import { MotionStream } from "./stream.js";

const LEASE_SECONDS = 60;
const STATES = { connecting: "connecting", open: "connected", lost: "connection lost, reconnecting" };

export class PageSession {
  /** `wish`: encoding, fps … of the stream; `on.event(event)`, `on.ended()` when a new one is needed. */
  constructor(api, access, crowd, wish, clock, on) {
    Object.assign(this, { api, access, crowd, wish, clock, on });
    this.id = null;
    this.scene = "";
    this.stream = null;
    this.stopRenewing = () => {};
    addEventListener("pagehide", () => this.id && api.abandonSession(this.id));
  }

  /** A new one in a scene, or with "" on a floor without end; the one before ends. Throws ApiError. */
  async open(scene = "") {
    const { session_id: id } = await this.api.createSession(LEASE_SECONDS, scene);
    this.close();
    this.id = id;
    this.scene = scene;
    this.stopRenewing = keepAlive(this.api, id, LEASE_SECONDS);
    this.stream = new MotionStream((resumeToken) => this.api.streamAddress(id, this.wish, resumeToken), {
      ...this.crowd.handlers(this.clock),
      header: (header, again, sentAt) => this.#header(header, again, sentAt),
      event: this.on.event,
      refused: async (reason) => {
        await this.access.renew(this.access.token, reason);
        this.stream.open();
      },
      status: (state, detail) => showConnection(state, detail ? `${STATES[state]} (${detail})` : STATES[state]),
      failed: (reason) => tell(`${reason}. Reload the page to begin anew.`),
      ended: (reason) => {
        tell(`The session is no more (${reason}). A new one begins.`);
        this.on.ended();
      },
    });
  }

  close() {
    this.stopRenewing();
    this.stream?.close();
    if (this.id) this.api.abandonSession(this.id);
    this.id = null;
    this.crowd.clear();
  }

  #header({ bones, skeleton }, again, sentAt) {
    this.crowd.boneNames = bones.map((bone) => skeleton[bone].name);
    if (!again) return;
    this.crowd.caughtUpAt = sentAt;
    this.#catchUp();
  }

  /** Who has gone while the connection was lost. */
  async #catchUp() {
    try {
      this.crowd.keepOnly(new Set((await this.api.agents(this.id)).map((agent) => agent.agent_id)));
    } catch (error) {
      if (error.status !== 404) tell(error.message); // the stream tells of the session's end
    }
  }
}
