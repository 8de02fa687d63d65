// The motion stream over WebSocket: one StreamMotionResponse per binary frame. No DOM.

import { decodeStreamMessage } from "./messages.js";
import { unpackPoses } from "./poses.js";

const RETRY_FIRST = 0.5; // seconds; doubled at each failure
const RETRY_MOST = 8;
const SILENCE = 4; // seconds without even a heartbeat (one per second) that mean a dead connection
// close codes: 4000 + the HTTP status of the error
const [ENDED, INVALID, UNKNOWN_CALLER, FORBIDDEN, NOT_FOUND] = [1000, 4422, 4401, 4403, 4404];

/**
 * Follows a session. A lost connection is made again and goes on where it was, as far as the server
 * still holds what was missed.
 *
 * `address(resumeToken)` gives { url, protocols }. `on` has: status("connecting" | "open" | "lost",
 * detail), header(header, again, sentAt), message(sentAt), added(agent), chunk(chunk, frames, fps),
 * removed(alias), event(event); ended(reason) when the session is no more; refused(reason) when the
 * caller must show who it is, who may then `open()` again; failed(reason) when there is no sense in
 * trying again. `newSocket(url, protocols)` makes a WebSocket; `schedule(callback, seconds)` is a timer.
 */
export class MotionStream {
  constructor(address, on, newSocket = (url, protocols) => new WebSocket(url, protocols), schedule = later) {
    this.address = address;
    this.on = on;
    this.newSocket = newSocket;
    this.schedule = schedule;
    this.header = null;
    this.socket = null;
    this.resumeToken = "";
    this.connections = 0; // that have brought a header
    this.heard = 0; // messages so far, to notice silence
    this.open();
  }

  open() {
    this.closed = false;
    this.retry = RETRY_FIRST;
    this.#connect();
  }

  close() {
    this.closed = true;
    this.socket?.close();
  }

  #connect() {
    if (this.closed) return;
    this.on.status("connecting");
    this.header = null;
    const { url, protocols } = this.address(this.resumeToken);
    const socket = this.newSocket(url, protocols);
    socket.binaryType = "arraybuffer";
    socket.onmessage = (event) => this.#receive(socket, event.data);
    socket.onclose = (event) => this.#lost(socket, event);
    this.socket = socket;
    this.#watch(socket, this.heard);
  }

  /** A half-open connection never closes by itself: end it when nothing comes. */
  #watch(socket, heardBefore) {
    this.schedule(() => {
      if (socket !== this.socket || this.closed) return;
      if (this.heard === heardBefore) socket.close();
      this.#watch(socket, this.heard);
    }, SILENCE);
  }

  #receive(socket, data) {
    if (socket !== this.socket) return;
    this.heard += 1;
    try {
      this.#dispatch(decodeStreamMessage(new Uint8Array(data)));
    } catch (error) {
      this.close();
      this.on.failed(`cannot read the stream: ${error.message}`);
    }
  }

  #dispatch({ sentAt, header, batch, event }) {
    if (header) {
      unpackPoses(new Uint8Array(0), layoutOf(header)); // an unknown encoding is told at once
      this.header = header;
      this.retry = RETRY_FIRST;
      this.connections += 1;
      this.on.header(header, this.connections > 1, sentAt);
      this.on.status("open");
    }
    this.on.message(sentAt);
    if (!batch && !event) return;
    if (!this.header) throw new Error("motion came before the header");
    if (batch) this.#batch(batch);
    if (event) this.on.event(event);
  }

  #batch({ added, chunks, removed, resumeToken }) {
    for (const agent of added) this.on.added(agent);
    for (const chunk of chunks) {
      this.on.chunk(chunk, unpackPoses(chunk.poses, layoutOf(this.header)), this.header.sentFps);
    }
    for (const alias of removed) this.on.removed(alias);
    if (resumeToken) this.resumeToken = resumeToken;
  }

  #lost(socket, { code, reason }) {
    if (socket !== this.socket || this.closed) return;
    this.socket = null;
    if (code === INVALID && this.resumeToken) {
      this.resumeToken = ""; // of another server, it may be: begin with what falls due next
      this.#connect();
    } else if (code === ENDED || code === NOT_FOUND) {
      this.closed = true;
      this.on.ended(reason);
    } else if (code === UNKNOWN_CALLER) {
      this.closed = true;
      this.on.refused(reason);
    } else if (code === FORBIDDEN || code === INVALID) {
      this.closed = true;
      this.on.failed(reason);
    } else {
      this.on.status("lost", reason);
      this.schedule(() => this.#connect(), this.retry);
      this.retry = Math.min(RETRY_MOST, this.retry * 2);
    }
  }
}

function layoutOf({ encoding, bones }) {
  return { encoding, bones: bones.length };
}

function later(callback, seconds) {
  setTimeout(callback, seconds * 1000);
}
