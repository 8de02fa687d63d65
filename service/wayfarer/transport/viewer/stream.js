// The motion stream over WebSocket: one StreamMotionResponse per binary frame. No DOM.

import { decodeStreamMessage, unpackPoses } from "./messages.js";

const RETRY_FIRST = 0.5; // seconds; doubled at each failure
const RETRY_MOST = 8;
const F32_LE = 1; // PoseEncoding
const [ENDED, FOREIGN_ORIGIN, NOT_FOUND] = [1000, 1008, 4404]; // close codes that are final
const SILENCE = 4; // seconds without even a heartbeat (one per second) that mean a dead connection

/**
 * Follows a session, and comes back by itself after a lost connection.
 *
 * `on` has: status("connecting" | "open" | "lost", detail), header(header), message(sentAt),
 * added(agent), chunk(chunk, frames, fps), removed(alias); ended(reason) when the
 * session is no more; failed(reason) when there is no sense in trying again. `newSocket(url)` makes a WebSocket; `schedule(callback, seconds)` is a timer.
 */
export class MotionStream {
  constructor(url, on, newSocket = (address) => new WebSocket(address), schedule = later) {
    this.url = url;
    this.on = on;
    this.newSocket = newSocket;
    this.schedule = schedule;
    this.header = null;
    this.socket = null;
    this.retry = RETRY_FIRST;
    this.closed = false;
    this.heard = 0; // messages so far, to notice silence
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
    const socket = this.newSocket(this.url);
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

  #dispatch({ sentAt, header, batch }) {
    if (header) {
      if (header.encoding !== F32_LE) throw new Error(`pose encoding ${header.encoding} is not known`);
      this.header = header;
      this.retry = RETRY_FIRST;
      this.on.header(header);
      this.on.status("open");
    }
    this.on.message(sentAt);
    if (!batch) return;
    if (!this.header) throw new Error("a batch came before the header");
    const { fps, posedBones } = this.header;
    for (const agent of batch.added) this.on.added(agent);
    for (const chunk of batch.chunks) {
      this.on.chunk(chunk, unpackPoses(chunk.poses, posedBones), fps);
    }
    for (const alias of batch.removed) this.on.removed(alias);
  }

  #lost(socket, { code, reason }) {
    if (socket !== this.socket || this.closed) return;
    this.socket = null;
    if (code === ENDED || code === NOT_FOUND) {
      this.closed = true;
      this.on.ended(reason);
    } else if (code === FOREIGN_ORIGIN) {
      this.closed = true;
      this.on.failed("the server does not stream to pages of this origin");
    } else {
      this.on.status("lost", reason);
      this.schedule(() => this.#connect(), this.retry);
      this.retry = Math.min(RETRY_MOST, this.retry * 2);
    }
  }
}

function later(callback, seconds) {
  setTimeout(callback, seconds * 1000);
}
