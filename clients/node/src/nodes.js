// Calls that find the node of a cluster that has their session: clients/README.md, "Many nodes".

import { Duplex, Readable } from "node:stream";
import { create } from "@bufbuild/protobuf";
import { status } from "@grpc/grpc-js";
import { ControlResponseSchema } from "./gen/wayfarer/v1/control_pb.js";
import { Patience, SILENCE_MS } from "./patience.js";
import { placeOf } from "./refusal.js";

const GONE = [status.UNAVAILABLE, status.DEADLINE_EXCEEDED];

/** The id of whom a request is about, as text; "": nobody's. */
export function aboutOf({ sessionId, agentId, sceneId, scene } = {}) {
  return [sessionId, agentId, sceneId, scene].filter((id) => typeof id === "string").join(" ");
}

/** The id of the session or scene that a reply says was made; "" without one. */
export const madeOf = ({ session, scene }) => aboutOf(session ?? scene);

/** Whether a refused call goes on, at the route's next address. */
export function goesOn(route, error) {
  const place = placeOf(error);
  if (place) return route.misdirected(place.host, place.port);
  return GONE.includes(error.code) && route.unavailable();
}

/** A stream of requests that can be sent again from its beginning. */
export function repeatable(requests) {
  const taken = [];
  const rest = (requests[Symbol.asyncIterator] ?? requests[Symbol.iterator]).call(requests);
  return () => Readable.from((async function* again() {
    yield* taken;
    for (;;) {
      const { value, done } = await rest.next();
      if (done) return;
      taken.push(value);
      yield value;
    }
  })());
}

/**
 * A call that answers by a stream: messages are read as of grpc-js's call, and written where it takes them. It goes from
 * node to node until one answers; what is written until then is written again. One with `control` goes on when its
 * session moves later, or its connection is lost.
 */
export class FollowingCall extends Duplex {
  #homes;
  #open;
  #control;
  #patience;
  #route = null;
  #call = null; // null: between two attempts
  #kept = []; // written before the first answer
  #begun = false; // this connection has been answered
  #ended = false; // nothing more will be written
  #written = null; // to be called when the last message has been
  #timer; // of the silence, or of the next attempt

  /**
   * `open(address)` begins the call there. `about`: see `aboutOf`; undefined: the first message says it.
   * `control`: a ControlState, of a call that is made again for `deadlineMs` after the last sign of life.
   */
  constructor(homes, open, about, control = null, deadlineMs = undefined) {
    super({ objectMode: true, writable: about === undefined });
    this.#homes = homes;
    this.#open = open;
    this.#control = control;
    this.#patience = new Patience(deadlineMs);
    if (about !== undefined) this.#begin(about);
  }

  cancel() {
    this.#call?.cancel();
  }

  _read() {
    if (this.#call?.isPaused()) this.#awaitLife();
    this.#call?.resume();
  }

  _write(message, _, done) {
    this.#control?.sent(message);
    if (this.#begun) {
      this.#written = done;
      this.#call.write(message, () => this.#goOn());
      return;
    }
    this.#kept.push(message);
    if (this.#call) this.#call.write(message);
    else if (!this.#route) this.#begin(aboutOf(message.payload?.value));
    done();
  }

  _final(done) {
    this.#ended = true;
    this.#call?.end();
    done();
  }

  _destroy(error, done) {
    clearTimeout(this.#timer);
    this.#call?.cancel();
    done(error);
  }

  #goOn() {
    const done = this.#written;
    this.#written = null;
    done?.();
  }

  #begin(about) {
    this.#route = this.#homes.route(about);
    this.#connect();
  }

  #connect() {
    const call = this.#open(this.#route.address);
    this.#call = call;
    this.#kept.forEach((message) => call.write(message));
    if (this.#ended) call.end();
    call.on("data", (message) => {
      if (this.#call !== call) return;
      if (!this.#begun) this.#route.answered();
      this.#begun = true;
      this.#kept = [];
      this.#control?.heard(message);
      this.#patience.heard();
      this.#awaitLife();
      if (this.push(message)) return;
      call.pause();
      clearTimeout(this.#timer); // its reader is slow
    });
    call.on("end", () => {
      if (this.#call !== call) return; // grpc-js ends a call after its error, too
      clearTimeout(this.#timer); // the session has ended: that is no silence
      this.push(null);
    });
    call.on("error", (error) => this.#call === call && this.#failed(error));
    if (this.#patience.begun) this.#awaitLife();
  }

  /** A connection over which nothing comes is given up, if the call can be made again. */
  #awaitLife() {
    clearTimeout(this.#timer);
    if (!this.#control) return;
    this.#timer = setTimeout(() => this.#failed(new Error(`nothing heard for ${SILENCE_MS / 1000} s`)), SILENCE_MS);
  }

  #failed(error) {
    clearTimeout(this.#timer);
    const follows = goesOn(this.#route, error); // also after it has begun: the next call goes there
    if (this.destroyed) return;
    const before = this.#patience.begun;
    const again = before ? this.#control && this.#patience.next(error) : follows ? 0 : null;
    if (again === null) {
      this.destroy(error);
      return;
    }
    const call = this.#call;
    this.#call = null;
    call.cancel();
    if (this.#begun) {
      this.#begun = false;
      this.#control.unanswered().forEach((reply) => this.push(reply));
      this.#kept = [this.#control.opening];
    }
    if (!before || (follows && placeOf(error))) {
      this.#connect();
    } else {
      this.#route.begin();
      this.#timer = setTimeout(() => this.#connect(), again);
    }
    this.#goOn();
  }
}

/** What a Control stream begins with when it is made again, and what was not answered before. */
export class ControlState {
  /** Its first message: with the token of the last batch, and the last viewpoints. */
  opening = null;
  #asked = new Set(); // ids of commands

  sent(message) {
    const { case: kind, value } = message.payload ?? {};
    if (kind === "open") this.opening = message;
    else if (kind === "viewpoints") this.#amend({ interest: { ...this.opening.payload.value.interest, viewpoints: value.viewpoints } });
    else if (kind !== "ack") this.#asked.add(BigInt(message.commandId ?? 0));
  }

  heard({ payload: { case: kind, value } }) {
    if (kind === "reply") this.#asked.delete(value.commandId);
    const token = kind === "motion" && value.payload.case === "batch" && value.payload.value.resumeToken;
    if (token) this.#amend({ resumeToken: token });
  }

  /** A reply for each command that has got none: whether it was heard is not known. */
  unanswered() {
    const message = "the connection ended before it was answered: the command may or may not have been heard";
    const replies = [...this.#asked].map((commandId) => create(ControlResponseSchema, {
      payload: { case: "reply", value: { commandId, problem: { code: status.UNAVAILABLE, message } } },
    }));
    this.#asked.clear();
    return replies;
  }

  #amend(change) {
    const { opening } = this;
    this.opening = { ...opening, payload: { case: "open", value: { ...opening.payload.value, ...change } } };
  }
}
