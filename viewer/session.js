// This page's session: opened, joined, left; it also shows the state of its connection.

import { Session } from "./client/index.js";
import { LOST, mention, showConnection, showLegend, tell } from "./hud.js";
import { Replay } from "./replay.js";
import { RINGS } from "./sight.js";

const STATES = { connecting: "connecting", open: "connected", lost: "reconnecting" };

export class PageSession {
  /**
   * `query`: encoding, fps … of the stream, which then has no levels of detail. `on.event(event)`; `on.ended(reason)` is called when
   * a new session is needed.
   */
  constructor(api, crowd, query, clock, on) {
    Object.assign(this, { api, crowd, query, clock, on });
    this.current = null;
    this.views = [{ position: { x: 0, y: 0, z: 0 } }]; // of the camera
    this.scene = "";
    this.latest = "";
    this.state = ""; // of the connection, unless it is being made
    addEventListener("pagehide", () => this.current?.own && api.abandonSession(this.current.id));
  }

  get id() {
    return this.current?.id ?? null;
  }

  get player() {
    return this.current?.player ?? null;
  }

  /** Opens a new session in a scene, or with "" on an endless floor; the one before ends. Throws ApiError. */
  async open(scene = "") {
    this.#enter(await Session.open(this.api, this.#options(scene)));
  }

  /** Joins another user's session, to watch it and set goals; the one before ends. */
  join(id, scene) {
    this.#enter(Session.join(this.api, id, this.#options(scene)));
  }

  /** Plays a script in separate lock-step sessions (`how`: see replay.js); the one before ends. Throws ApiError. */
  async replay(script, how) {
    const replay = new Replay(this.api, script, this.#options("").on, how);
    this.#enter(replay);
    showConnection("connecting", "making the replay");
    await replay.open();
    this.scene = replay.scene;
    const seen = replay.begins ? `${replay.begins.toFixed(0)} s as they were seen, then ` : "";
    showConnection("open", `replay: ${seen}${script.seconds} s made again`);
    showLegend(replay.legend);
    document.body.classList.add("replay");
    return replay;
  }

  /** Shows people from these viewpoints (sight.js); they are sent to the server when they have moved. */
  look(views) {
    this.views = views;
    if (this.current?.interest) this.current.look(views);
  }

  /** Ends the wait for the next attempt to connect, since the server answers. */
  hurry() {
    if (this.latest === "lost") this.current?.stream?.reconnect();
  }

  /** Handles that the page has slept (asleep.js). */
  wake() {
    this.current?.stream?.wake();
  }

  /** Whether it is a replay, in which nobody can be sent. */
  get watchOnly() {
    return this.current instanceof Replay;
  }

  /** Ends it, or leaves it if it is another user's. */
  leave() {
    this.current?.close();
    this.current = null;
  }

  #enter(session) {
    showLegend(null);
    document.body.classList.remove("replay");
    this.current?.close();
    this.current = session;
    this.scene = session.scene;
  }

  /** After a restart of the server, removes the people that it no longer has. */
  async #align() {
    const { id, player } = this;
    try {
      const there = new Set((await this.api.agents(id)).map((agent) => agent.agent_id));
      if (id !== this.id) return;
      for (const { agent } of [...player.agents.values()]) if (!there.has(agent.id)) player.remove(agent.alias);
    } catch (error) {
      if (error.status !== 404) tell(error.message); // the stream reports a session that is gone
    }
  }

  #options(scene) {
    return {
      scene,
      query: this.query,
      interest: Object.keys(this.query).length ? undefined : { rings: RINGS, viewpoints: this.views },
      stream: { now: this.clock },
      on: {
        ...this.crowd.handlers(this.clock),
        header: (header, again) => {
          this.crowd.begin(header);
          if (again && !header.resumed) this.#align();
        },
        event: this.on.event,
        status: (state) => {
          showConnection(state, STATES[state]);
          if (state === "lost" && this.state === "open") mention(LOST);
          if (state !== "connecting") this.state = state;
          this.latest = state;
        },
        failed: (reason) => tell(`${reason}. Reload the page to start again.`),
        ended: (reason) => this.on.ended(reason),
      },
    };
  }
}
