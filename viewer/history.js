// The last minute of all people, as it was shown. No DOM.

import { mixPoses } from "./client/index.js";

const SECONDS = 60;
const FPS = 30; // most frames kept: a minute of one person is 0.75 MB
const MIN_FPS = 6;
const ALL_FPS = 6000; // of all people together: of more than 200 fewer frames each are kept, so that the page has time for the others
const ROOM = 64; // frames that there is room for at the start; doubled when more are needed
const GAP = 0.5; // seconds between two frames that belong to different visits: nobody is there between
const MOST = 30; // maximum frames noted at once, so that a page that was hidden for some seconds does not stall
const JUMP = 5; // seconds back or ahead after which it is another stream

/** Frames of one person of the last minute, a ring. */
class Track {
  constructor(width) {
    this.width = width;
    this.first = 0;
    this.count = 0;
    this.#room(ROOM);
  }

  push(time, frame, contacts) {
    while (this.count > 1 && this.times[this.slot(1)] <= time - SECONDS) {
      this.first = this.slot(1);
      this.count -= 1;
    }
    if (this.count === this.times.length) this.#room(2 * this.count);
    const slot = this.slot(this.count);
    this.times[slot] = time;
    this.frames.set(frame, this.width * slot);
    this.contacts[slot] = contacts;
    this.count += 1;
  }

  slot(k) {
    return (this.first + k) % this.times.length;
  }

  #room(size) {
    const grown = (Kind, before, width) => {
      const values = new Kind(size * width);
      if (this.count) values.set(before.subarray(this.first * width)); // the ring begins with its first frame again
      if (this.first) values.set(before.subarray(0, this.first * width), (this.count - this.first) * width);
      return values;
    };
    const { times, frames, contacts } = this;
    this.times = grown(Float64Array, times, 1);
    this.frames = grown(Float32Array, frames, this.width);
    this.contacts = grown(Uint8Array, contacts, 1);
    this.first = 0;
  }

  /** Number of the last frame at or before a time; -1: there is none. */
  at(time) {
    let low = -1, high = this.count - 1;
    while (low < high) {
      const middle = Math.ceil((low + high) / 2);
      if (this.times[this.slot(middle)] <= time) low = middle;
      else high = middle - 1;
    }
    return low;
  }
}

export class History {
  constructor() {
    this.clear();
  }

  clear() {
    this.tracks = new Map(); // alias → Track
    this.last = NaN; // moment noted last, server time in seconds
    this.begun = NaN;
  }

  /** The earliest moment that can be shown. */
  get first() {
    return Math.max(this.begun, this.last - SECONDS);
  }

  /** Notes all people { agent, played } up to a moment that is about to be shown, however few pictures there are. */
  note(moment, people) {
    if (!Number.isFinite(moment)) return;
    if (!(Math.abs(moment - this.last) <= JUMP)) {
      this.clear();
      this.begun = this.last = moment;
    }
    const fps = Math.min(FPS, Math.max(MIN_FPS, ALL_FPS / people.length));
    const step = Math.max(1 / fps, (moment - this.last) / MOST);
    for (let at = this.last + step; at <= moment; at += step) {
      this.last = at;
      for (const { agent, played } of people) {
        if (at < played.since || !played.track.sample(at, played.frame)) continue; // `since`: of a replay
        let track = this.tracks.get(agent.alias);
        if (!track) this.tracks.set(agent.alias, track = new Track(played.frame.length));
        track.push(at, played.frame, played.track.contacts);
      }
    }
    if (this.tracks.size > people.length) this.#forget();
  }

  /** Writes a person's frame of a moment into `out`; returns false if no person of this alias was there. */
  sample(alias, moment, out) {
    const track = this.tracks.get(alias);
    const k = track ? track.at(moment) : -1;
    if (k < 0) return false;
    const from = track.slot(k);
    if (k === track.count - 1) {
      if (moment - track.times[from] > GAP) return false;
      out.set(track.frames.subarray(track.width * from, track.width * (from + 1)));
      return true;
    }
    const to = track.slot(k + 1);
    const gap = track.times[to] - track.times[from];
    if (gap > GAP) return false;
    mixPoses(track.frames, track.width * from, track.frames, track.width * to, (moment - track.times[from]) / gap, out, track.width);
    return true;
  }

  /** Which feet stood on the ground at a moment: 1 left, 2 right. */
  contacts(alias, moment) {
    const track = this.tracks.get(alias);
    const k = track ? track.at(moment) : -1;
    return k < 0 ? 0 : track.contacts[track.slot(k)];
  }

  /** Speeds in m/s over the floor, and contacts, in a span of time: { speeds, contacts }, `count` of each; NaN if absent. */
  strip(alias, from, to, count) {
    const speeds = new Float32Array(count).fill(NaN);
    const contacts = new Uint8Array(count);
    const before = new Float32Array(this.tracks.get(alias)?.width ?? 0), after = before.slice();
    for (let k = 0; k < count; k += 1) {
      const moment = from + ((to - from) * (k + 0.5)) / count;
      contacts[k] = this.contacts(alias, moment);
      if (this.sample(alias, moment - 0.15, before) && this.sample(alias, moment + 0.15, after)) {
        speeds[k] = Math.hypot(after[0] - before[0], after[2] - before[2]) / 0.3;
      }
    }
    return { speeds, contacts };
  }

  /** Forgets people that left longer ago than is kept. */
  #forget() {
    for (const [alias, track] of this.tracks) {
      if (track.times[track.slot(track.count - 1)] < this.first) this.tracks.delete(alias);
    }
  }
}
