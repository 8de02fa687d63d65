// The last minute of all people, as it was shown. No DOM.

import { mixPoses } from "./client/index.js";

const SECONDS = 60;
const FPS = 30; // most frames kept: a minute of one person is 0.75 MB
const MIN_FPS = 6;
const ALL_FPS = 6000; // of all people together: of more than 200 fewer frames each are kept, so that the page has time for the others
const BLOCK = 32; // frames that memory is taken for at a time
const TURNS = 8; // in which people are noted one after another: all at once would delay the picture
const GAP = 0.5; // seconds between two frames that belong to different visits: nobody is there between
const MOST = 30; // maximum frames noted at once, so that a page that was hidden for some seconds does not stall
const JUMP = 5; // seconds back or ahead after which it is another stream

/** Frames of one person of the last minute, numbered, in blocks. */
class Track {
  /** `number`: of the first frame. People whose numbers differ do not need new blocks in the same picture. */
  constructor(width, number) {
    this.width = width;
    this.first = this.end = number; // of the oldest frame; after the newest
    this.dropped = 0; // blocks before the first one kept
    this.blocks = [this.#room()];
    this.second = Infinity; // time of the frame after the oldest one
  }

  get count() {
    return this.end - this.first;
  }

  push(time, frame, contacts) {
    let spare = null;
    while (this.second <= time - SECONDS) {
      this.first += 1;
      this.second = this.count > 1 ? this.time(this.first + 1) : Infinity;
      if (this.first % BLOCK) continue;
      spare = this.blocks.shift();
      this.dropped += 1;
    }
    const slot = this.end % BLOCK;
    if (!slot && this.count) this.blocks.push(spare ?? this.#room());
    const block = this.blocks.at(-1);
    block.times[slot] = time;
    block.frames.set(frame, this.width * slot);
    block.contacts[slot] = contacts;
    this.end += 1;
    if (this.count === 2) this.second = time;
  }

  #room() {
    return { times: new Float64Array(BLOCK), frames: new Float32Array(BLOCK * this.width), contacts: new Uint8Array(BLOCK) };
  }

  #block(number) {
    return this.blocks[Math.floor(number / BLOCK) - this.dropped];
  }

  time(number) {
    return this.#block(number).times[number % BLOCK];
  }

  contacts(number) {
    return this.#block(number).contacts[number % BLOCK];
  }

  /** Where a frame is: [numbers, index of its first one]. */
  frame(number) {
    return [this.#block(number).frames, this.width * (number % BLOCK)];
  }

  /** Number of the last frame at or before a time; -1: there is none. */
  at(time) {
    let low = this.first - 1, high = this.end - 1;
    while (low < high) {
      const middle = Math.ceil((low + high) / 2);
      if (this.time(middle) <= time) low = middle;
      else high = middle - 1;
    }
    return low < this.first ? -1 : low;
  }
}

export class History {
  constructor() {
    this.clear();
  }

  clear() {
    this.tracks = new Map(); // alias → Track
    this.last = NaN; // moment up to which all people are noted, server time in seconds
    this.noted = NaN; // moment up to which some are
    this.turn = 0; // of those who are noted next
    this.begun = NaN;
  }

  /** The earliest moment that can be shown. */
  get first() {
    return Math.max(this.begun, this.last - SECONDS);
  }

  /** Notes all people { agent, played } up to a moment that is about to be shown, however few pictures there are. */
  note(moment, people) {
    if (!Number.isFinite(moment)) return;
    if (!(Math.abs(moment - this.noted) <= JUMP)) {
      this.clear();
      this.begun = this.last = this.noted = moment;
    }
    const fps = Math.min(FPS, Math.max(MIN_FPS, ALL_FPS / people.length));
    const step = Math.max(1 / fps, (moment - this.noted) / MOST);
    for (let at = this.noted + step / TURNS; at <= moment; at += step / TURNS) {
      for (let k = this.turn; k < people.length; k += TURNS) {
        const { agent, played } = people[k];
        if (at < played.since || !played.track.sample(at, played.frame)) continue; // `since`: of a replay
        let track = this.tracks.get(agent.alias);
        if (!track) this.tracks.set(agent.alias, track = new Track(played.frame.length, agent.alias % BLOCK));
        track.push(at, played.frame, played.track.contacts);
      }
      this.noted = at;
      this.turn = (this.turn + 1) % TURNS;
    }
    this.last = Math.max(this.last, this.noted - step);
    if (this.tracks.size > people.length) this.#forget();
  }

  /** Writes a person's frame of a moment into `out`; returns false if no person of this alias was there. */
  sample(alias, moment, out) {
    const track = this.tracks.get(alias);
    const number = track ? track.at(moment) : -1;
    if (number < 0) return false;
    const [from, i] = track.frame(number);
    const time = track.time(number);
    if (number === track.end - 1) {
      if (moment - time > GAP) return false;
      out.set(from.subarray(i, i + track.width));
      return true;
    }
    const gap = track.time(number + 1) - time;
    if (gap > GAP) return false;
    const [to, j] = track.frame(number + 1);
    mixPoses(from, i, to, j, (moment - time) / gap, out, track.width);
    return true;
  }

  /** Which feet stood on the ground at a moment: 1 left, 2 right. */
  contacts(alias, moment) {
    const track = this.tracks.get(alias);
    const number = track ? track.at(moment) : -1;
    return number < 0 ? 0 : track.contacts(number);
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
      if (track.time(track.end - 1) < this.first) this.tracks.delete(alias);
    }
  }
}
