// The motion stream over WebSocket: one StreamMotionResponse per binary frame.

import { idly, later } from "./lease.js";

const RETRY_FIRST = 0.5; // seconds; doubled at each failure
const RETRY_MOST = 8;
const PAUSE = 0.1; // least seconds between two texts
const LOOK = 0.75; // seconds between looks at whether something has come
const SILENT = 3; // looks without even a heartbeat (one per second) after which a connection is dead: within 3 s
// close codes: 4000 + the HTTP status of the error
const ENDED = 1000, INVALID = 4422, UNKNOWN_CALLER = 4401, FORBIDDEN = 4403, NOT_FOUND = 4404;

/** @typedef {"connecting" | "open" | "lost"} Status */
/**
 * Callbacks of a stream: `ended(reason)` when the session is gone, `refused(reason)` when the caller must authenticate
 * and may then `open()` again, `failed(reason)` when another attempt is pointless.
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
 * @property {() => number} [now] seconds of a clock that never goes back: the player's clock
 */

/** Seconds of a clock that never goes back. */
export const clock = () => performance.now() / 1000;

/** Brings a session's motion to a player. A lost connection is restored and resumes where it was. */
export class MotionStream {
  #retry = RETRY_FIRST;
  #heard = 0; // messages so far, to notice silence
  #losses = 0; // so far
  #begun = false; // this connection's header has come
  #text = ""; // waiting to be sent
  #said = "";
  #pauses = false; // one has just been sent
  /** @type {WebSocket | null} */
  #socket = null;

  /**
   * `address(resumeToken)` says where to connect (`Api.streamAddress`); `route` receives the outcome.
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
    this.forgotten = ""; // a resume token unknown to the server
    this.open();
  }

  /** Connect, after the stream was refused. */
  open() {
    this.closed = false;
    this.#retry = RETRY_FIRST;
    this.#connectAgain();
  }

  /** Closes the stream. */
  close() {
    this.closed = true;
    this.#socket?.close();
  }

  /** Connects again, as after a loss: the network may have changed. While a retry is pending, it connects at once. */
  reconnect() {
    if (this.#socket) this.#socket.close();
    else this.#connectAgain();
  }

  /**
   * This program has slept, frozen by the browser or with its machine. The data in the socket is old and says nothing about
   * the network: connect again, and find the moment to show again.
   */
  wake() {
    if (this.closed) return;
    const socket = this.#socket;
    this.#socket = null; // nothing of it counts any more
    socket?.close();
    this.#losses += 1; // nor does a retry that is pending
    this.player.wake();
    this.#connectAgain();
  }

  /** Sends a text. Only the last within a tenth of a second is sent, and none twice. @param {string} text */
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
    socket.onerror = () => {}; // a close follows; the package "ws" ends the program without a listener
    this.#socket = socket;
    this.#watch(socket, this.#heard);
  }

  /** A half-open connection never closes by itself: end it when nothing comes. @param {WebSocket} socket @param {number} heardBefore @param {number} looks left */
  #watch(socket, heardBefore, looks = SILENT) {
    this.watch(() => {
      if (socket !== this.#socket || this.closed) return;
      const silent = this.#heard === heardBefore;
      if (silent && looks === 1) socket.close();
      this.#watch(socket, this.#heard, silent && looks > 1 ? looks - 1 : SILENT);
    }, LOOK);
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
      this.forgotten = token; // perhaps of another server: begin with the frames that fall due next
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
