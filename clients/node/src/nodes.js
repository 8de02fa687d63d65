// Calls that find the node of a cluster that has their session: clients/README.md, "Many nodes".

import { Duplex, Readable } from "node:stream";
import { status } from "@grpc/grpc-js";
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
 * node to node until one answers; what is written until then is written again.
 */
export class FollowingCall extends Duplex {
  #homes;
  #open;
  #route;
  #call;
  #kept = []; // written before the first answer
  #begun = false;
  #ended = false; // nothing more will be written

  /** `open(address)` begins the call there. `about`: see `aboutOf`; undefined: the first message says it. */
  constructor(homes, open, about) {
    super({ objectMode: true, writable: about === undefined });
    this.#homes = homes;
    this.#open = open;
    if (about !== undefined) this.#begin(about);
  }

  cancel() {
    this.#call?.cancel();
  }

  _read() {
    this.#call?.resume();
  }

  _write(message, _, done) {
    if (this.#begun) return this.#call.write(message, done);
    this.#kept.push(message);
    if (this.#call) this.#call.write(message);
    else this.#begin(aboutOf(message.payload?.value));
    done();
  }

  _final(done) {
    this.#ended = true;
    this.#call?.end();
    done();
  }

  _destroy(error, done) {
    this.#call?.cancel();
    done(error);
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
      if (!this.#begun) this.#route.answered();
      this.#begun = true;
      this.#kept = [];
      if (!this.push(message)) call.pause();
    });
    call.on("end", () => this.push(null));
    call.on("error", (error) => {
      const follows = goesOn(this.#route, error); // also after it has begun: the next call goes there
      if (this.destroyed) return;
      if (follows && !this.#begun) this.#connect();
      else this.destroy(error);
    });
  }
}
