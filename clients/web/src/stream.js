// The motion stream over WebSocket: one StreamMotionResponse per binary frame.

import { idly, later } from "./lease.js";

const RETRY_FIRST = 0.5; // seconds; doubled at each failure
const RETRY_MOST = 8;
const PAUSE = 0.1; // seconds between texts at least
const SILENCE = 4; // seconds without even a heartbeat (one per second) that mean a dead connection
// close codes: 4000 + the HTTP status of the error
const ENDED = 1000, INVALID = 4422, UNKNOWN_CALLER = 4401, FORBIDDEN = 4403, NOT_FOUND = 4404;

/** @typedef {"connecting" | "open" | "lost"} Status */
/**
 * What a stream tells: `ended(reason)` when the session is no more; `refused(reason)` when the caller must show who
 * it is, who may then `open()` again; `failed(reason)` when there is no sense in trying again.
 * @typedef {object} StreamEvents
 * @property {(status: Status, detail?: string) => void} [status]
 * @property {(reason: string) => void} [ended]
 * @property {(reason: string) => void} [refused]
 * @property {(reason: string) => void} [failed]
 */
/**
 * @typedef {object} StreamOptions
 * @property {(url: string, protocols: string[]) => WebSocket} [newSocket] of another library, in Node before 22
 * @property {(callback: () => void, seconds: number) => void} [schedule] a timer
 * @property {() => number} [now] seconds of a clock that never goes back: the one that the player is played by
 */

/** Seconds of a clock that never goes back. */
export const clock = () => performance.now() / 1000;

/** Brings a session's motion to a player. A lost connection is made again and goes on where it was. */
export class MotionStream {
  #retry = RETRY_FIRST;
  #heard = 0; // messages so far, to notice silence
  #losses = 0; // so far
  #begun = false; // this connection's header has come
  #text = ""; // to be sent
  #said = "";
  #pauses = false; // one has just been sent
  /** @type {WebSocket | null} */
  #socket = null;

  /**
   * `address(resumeToken)` says where to connect (`Api.streamAddress`); `route` is told what came of it.
   * @param {(resumeToken: string) => { url: string, protocols: string[] }} address
   * @param {import("./core/player.js").MotionPlayer} player @param {StreamEvents} [on] @param {StreamOptions} [options]
   * @param {import("./core/homes.js").Route} [route]
   */
  constructor(address, player, on = {}, options = {}, route = undefined) {
    this.address = address;
    this.route = route;
    this.player = player;
    this.on = on;
    this.newSocket = options.newSocket ?? ((url, protocols) => new WebSocket(url, protocols));
    this.schedule = options.schedule ?? later;
    this.watch = options.schedule ?? idly;
    this.now = options.now ?? clock;
    this.closed = false;
    this.forgotten = ""; // a resume token that the server does not know
    this.open();
  }

  /** Connect, after the stream was refused. */
  open() {
    this.closed = false;
    this.#retry = RETRY_FIRST;
    this.#connectAgain();
  }

  /** Leave it for good. */
  close() {
    this.closed = true;
    this.#socket?.close();
  }

  /** Connect again, as after a loss: the network may have changed. While it is waiting to try again: at once. */
  reconnect() {
    if (this.#socket) this.#socket.close();
    else this.#connectAgain();
  }

  /** Send a text: the last of those within a tenth of a second, and none twice. @param {string} text */
  say(text) {
    if (text === this.#said) return;
    this.#text = this.#said = text;
    this.#send();
  }

  #send() {
    if (!this.#text || this.#pauses || !this.#begun || this.closed) return;
    this.#socket?.send(this.#text);
    this.#text = "";
    this.#pauses = true;
    this.schedule(() => {
      this.#pauses = false;
      this.#send();
    }, PAUSE);
  }

  #connect() {
    if (this.closed) return;
    this.#begun = false;
    this.on.status?.("connecting");
    this.player.begin();
    const token = this.player.resumeToken;
    const { url, protocols } = this.address(token === this.forgotten ? "" : token);
    const socket = this.newSocket(url, protocols);
    socket.binaryType = "arraybuffer";
    socket.onmessage = ({ data }) => this.#receive(socket, data);
    socket.onclose = ({ code, reason }) => this.#lost(socket, code, reason);
    socket.onerror = () => {}; // a close follows; the package "ws" ends the program where nobody listens
    this.#socket = socket;
    this.#watch(socket, this.#heard);
  }

  /** A half-open connection never closes by itself: end it when nothing comes. @param {WebSocket} socket @param {number} heardBefore */
  #watch(socket, heardBefore) {
    this.watch(() => {
      if (socket !== this.#socket || this.closed) return;
      if (this.#heard === heardBefore) socket.close();
      this.#watch(socket, this.#heard);
    }, SILENCE);
  }

  /** @param {WebSocket} socket @param {ArrayBuffer} data */
  #receive(socket, data) {
    if (socket !== this.#socket || this.closed) return;
    this.#heard += 1;
    try {
      if (this.player.receive(new Uint8Array(data), this.now()) !== "header") return;
    } catch (error) {
      this.close();
      this.on.failed?.(`cannot read the stream: ${/** @type {Error} */ (error).message}`);
      return;
    }
    this.#retry = RETRY_FIRST;
    this.#begun = true;
    this.route?.answered();
    this.#send();
    this.on.status?.("open");
  }

  #connectAgain() {
    this.route?.begin();
    this.#connect();
  }

  /** @param {WebSocket} socket @param {number} code @param {string} reason */
  #lost(socket, code, reason) {
    if (socket !== this.#socket || this.closed) return;
    this.#socket = null;
    this.#begun = false;
    const token = this.player.resumeToken;
    if (code === INVALID && token !== this.forgotten) {
      this.forgotten = token; // of another server, it may be: begin with what falls due next
      this.#connect();
    } else if (code === ENDED || code === NOT_FOUND) {
      this.closed = true;
      this.on.ended?.(reason);
    } else if (code === UNKNOWN_CALLER) {
      this.closed = true;
      this.on.refused?.(reason);
    } else if (code === FORBIDDEN || code === INVALID) {
      this.closed = true;
      this.on.failed?.(reason);
    } else if (this.route?.closed(code, reason)) {
      this.#connect();
    } else {
      this.on.status?.("lost", reason);
      const lost = ++this.#losses;
      this.schedule(() => lost === this.#losses && !this.#socket && this.#connectAgain(), this.#retry);
      this.#retry = Math.min(RETRY_MOST, this.#retry * 2);
    }
  }
}
