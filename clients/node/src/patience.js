// When a lost stream is opened again, and when no more.

import { status } from "@grpc/grpc-js";
import { placeOf, retryAfterMs } from "./refusal.js";

/** Without even a heartbeat (one per second) for so long, a connection is dead. */
export const SILENCE_MS = 5000;

/** For how long a lost stream is tried again, unless the caller says otherwise. */
export const DEADLINE_MS = 30_000;

const PAUSE_MS = [100, 2000]; // first and longest between attempts
const PASSING = [status.UNAVAILABLE, status.RESOURCE_EXHAUSTED];

/** The attempts of one stream, for `deadlineMs` since the last sign of life. */
export class Patience {
  #deadlineMs;
  #heardAt = Date.now();
  #pause = PAUSE_MS[0];
  /** The stream has been there before. */
  begun = false;

  constructor(deadlineMs = DEADLINE_MS) {
    this.#deadlineMs = deadlineMs;
  }

  heard() {
    this.begun = true;
    this.#heardAt = Date.now();
    this.#pause = PAUSE_MS[0];
  }

  /** Milliseconds to wait before the next attempt, after this error; null: there is none. */
  next(error) {
    const asked = retryAfterMs(error);
    const first = error.code === undefined || error.code === status.UNAVAILABLE || asked || placeOf(error);
    const passes = first || (this.begun && PASSING.includes(error.code));
    const left = this.#heardAt + this.#deadlineMs - Date.now();
    if (!passes || left <= 0) return null;
    const wait = Math.max(asked, this.#pause * (0.5 + Math.random() / 2));
    this.#pause = Math.min(2 * this.#pause, PAUSE_MS[1]);
    return Math.min(left, wait);
  }
}
