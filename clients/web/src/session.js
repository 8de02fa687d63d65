// A session of a server: made, kept alive, streamed and played.

import { Access } from "./access.js";
import { Api } from "./api.js";
import { MotionPlayer } from "./core/player.js";
import { keepAlive } from "./lease.js";
import { MotionStream, clock } from "./stream.js";

/**
 * `scene`: id of a scene, "" for an endless floor. `query`: `encoding`, `fps` … of the stream (docs/wire-format.md).
 * `interest`: levels of detail, { rings: [{ radius, format }], viewpoints: [{ position: { x, y, z }, reach }] }.
 * `on`: callbacks of the player and the stream. `token`: an API key or JWT.
 * @typedef {object} SessionOptions
 * @property {string} [token]
 * @property {string} [scene]
 * @property {number} [leaseSeconds] that the session outlives its last sign of life
 * @property {Record<string, string | number>} [query]
 * @property {Interest} [interest]
 * @property {import("./core/player.js").PlayerEvents & import("./stream.js").StreamEvents} [on]
 * @property {import("./stream.js").StreamOptions} [stream]
 */

/** @typedef {{ position: { x: number, y: number, z: number }, reach?: number }} Viewpoint */
/** @typedef {{ rings: { radius: number, format?: object }[], viewpoints: Viewpoint[] }} Interest */

/** People who walk, and their poses. */
export class Session {
  /** @type {() => void} */
  #stopRenewing = () => {};

  /**
   * A session of your own. It ends when you close it, or `leaseSeconds` after this program ends.
   * @param {string | Api} server its address, as "http://localhost:8080"; "" is the one this page came from
   * @param {SessionOptions} [options] @returns {Promise<Session>} rejects with ApiError
   */
  static async open(server, options = {}) {
    if (!options.stream?.newSocket && !("WebSocket" in globalThis)) {
      throw new Error("this runtime has no WebSocket (Node has one from 22 on): give options.stream.newSocket, see the README");
    }
    const api = apiOf(server, options);
    const lease = options.leaseSeconds ?? 60;
    const { session_id: id } = await api.createSession(lease, options.scene ?? "");
    const session = new Session(api, id, options);
    session.#stopRenewing = keepAlive(api, id, lease, options.stream?.schedule);
    session.own = true;
    return session;
  }

  /**
   * Another program's session, to watch or to give goals in.
   * @param {string | Api} server @param {string} id @param {SessionOptions} [options]
   */
  static join(server, id, options = {}) {
    return new Session(apiOf(server, options), id, options);
  }

  /** @param {Api} api @param {string} id @param {SessionOptions} options */
  constructor(api, id, { on = {}, query = {}, interest, scene = "", stream = {} }) {
    this.api = api;
    this.id = id;
    this.scene = scene;
    this.own = false;
    this.player = new MotionPlayer(on);
    this.now = stream.now ?? clock;
    this.interest = interest;
    const asked = () => (this.interest ? { ...query, interest: JSON.stringify(this.interest) } : query);
    this.stream = new MotionStream((token) => api.streamAddress(id, asked(), token), this.player, {
      ...on,
      refused: async (reason) => {
        if (await api.access.renew(api.access.token, reason)) this.stream.open();
        else on.refused?.(reason);
      },
    }, stream, api.homes.route(id));
  }

  /** All agents as shown, by alias. */
  get agents() {
    return this.player.agents;
  }

  /** Creates agents: [{ gender, position, name … }], as in `POST /v1/sessions/…/agents`. @param {object[]} specs */
  createAgents(specs) {
    return this.api.createAgents(this.id, specs);
  }

  /**
   * See the people from these places, in a session with `interest`. Call it as often as the camera moves: ten calls a
   * second at most are sent, and always the last.
   * @param {Viewpoint[]} viewpoints
   */
  look(viewpoints) {
    if (!this.interest) throw new Error("the session was opened without `interest`");
    this.interest = { ...this.interest, viewpoints };
    this.stream.say(JSON.stringify({ viewpoints }));
  }

  /** Shows all agents as at this moment, and fills their `frame`s. Call it once per picture. */
  update() {
    return this.player.advance(this.now());
  }

  /** Leaves the session; your own ends. */
  close() {
    this.#stopRenewing();
    this.stream.close();
    if (this.own) this.api.abandonSession(this.id);
    this.player.clear();
  }
}

/** @param {string | Api} server @param {SessionOptions} options */
function apiOf(server, { token = "" }) {
  return server instanceof Api ? server : new Api(server, { access: new Access(token) });
}
