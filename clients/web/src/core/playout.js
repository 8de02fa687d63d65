// The moment to show, and the pose at it: clients/README.md, "Playout". Times are seconds; no clock is read.
// After warm-up nothing is allocated.

const FIRST_DELAY = 0.35;
const MIN_DELAY = 0.2;
const MAX_DELAY = 1.5;
const MARGIN = 0.06; // over the worst lateness of the window
const LATENESS_WINDOW = 20;
const OFFSET_WINDOW = 30; // seconds; the fastest message of this window counts as one without delay
const STRETCH = 0.05; // playback runs at most this much faster or slower
const JUMP = 1.0; // error in seconds beyond which it jumps instead (after a sleep of the tab)
const BLEND = 0.2; // seconds to blend from a held pose to the stream again
const KEPT = 400; // most frames kept: a hidden tab receives, but does not play

// A number that is not a small integer is boxed, which allocates, when it is passed to a function that is not inlined.
// So small functions put such numbers into arrays, where larger functions find them.

/** The minimum of the last `seconds`, from a ring of values that rise from oldest to newest. */
class WindowLeast {
  /** @param {number} seconds */
  constructor(seconds) {
    this.seconds = seconds;
    this.pairs = new Float64Array(2 * 64); // time, value
    this.first = 0;
    this.count = 0;
    this.given = new Float64Array(2); // time, value
    this.found = new Float64Array(1).fill(NaN); // the least; NaN when there is none
  }

  /** @param {number} now @param {number} value */
  add(now, value) {
    this.given[0] = now;
    this.given[1] = value;
    this.take();
  }

  /** Adds the time and value in `given`. */
  take() {
    const { given } = this;
    let mask = this.pairs.length / 2 - 1;
    while (this.count && this.pairs[2 * ((this.first + this.count - 1) & mask) + 1] >= given[1]) this.count -= 1;
    if (this.count > mask) {
      this.#grow();
      mask = this.pairs.length / 2 - 1;
    }
    const at = 2 * ((this.first + this.count) & mask);
    this.pairs[at] = given[0];
    this.pairs[at + 1] = given[1];
    this.count += 1;
  }

  /** Puts the least at the time in `given` into `found`; NaN when there is none. */
  look() {
    const mask = this.pairs.length / 2 - 1;
    while (this.count && this.pairs[2 * this.first] < this.given[0] - this.seconds) {
      this.first = (this.first + 1) & mask;
      this.count -= 1;
    }
    this.found[0] = this.count ? this.pairs[2 * this.first + 1] : NaN;
  }

  #grow() {
    const before = this.pairs;
    this.pairs = new Float64Array(2 * before.length);
    this.pairs.set(before.subarray(2 * this.first));
    this.pairs.set(before.subarray(0, 2 * this.first), before.length - 2 * this.first);
    this.first = 0;
  }
}

const NOW = 0, OFFSET = 1, PLAYHEAD = 2, LAST = 3, WANTED = 4, AT = 5, CAUGHT_UP = 6;

/** Chooses the moment of the stream (server time) to show now, for all agents alike. */
export class PlayoutClock {
  #transit = new WindowLeast(OFFSET_WINDOW); // local - server time of each message
  #earliness = new WindowLeast(LATENESS_WINDOW); // of each chunk, negative when late
  #numbers = new Float64Array(7).fill(NaN); // OFFSET: the last known least transit; CAUGHT_UP: when it was resumed

  /**
   * Notes a message that came at local `now`, sent at server time `sentAt`.
   * @param {number} now @param {number} sentAt
   */
  observe(now, sentAt) {
    this.#numbers[NOW] = now;
    this.#numbers[AT] = sentAt;
    this.#observe();
  }

  /**
   * Notes a chunk that came at local `now`, whose first frame is for `scheduledAt`.
   * @param {number} now @param {number} scheduledAt
   */
  observeChunk(now, scheduledAt) {
    this.#numbers[NOW] = now;
    this.#numbers[AT] = scheduledAt;
    this.#observeChunk();
  }

  /** The same, of times in arrays, so that none is boxed. @param {Float64Array} now @param {Float64Array} scheduledAt */
  takeChunk(now, scheduledAt) {
    this.#numbers[NOW] = now[0];
    this.#numbers[AT] = scheduledAt[0];
    this.#observeChunk();
  }

  /**
   * Notes that a connection was restored; its header was sent at server time `sentAt`. Chunks for earlier times were
   * missed meanwhile; their lateness predicts nothing.
   * @param {number} sentAt
   */
  resumed(sentAt) {
    this.#numbers[CAUGHT_UP] = sentAt;
  }

  /** The server's clock at local `now`, as if the fastest message had taken no time. @param {number} now */
  serverTime(now) {
    const offset = this.#numbers[OFFSET];
    return offset === offset ? now - offset : now;
  }

  /** The target delay, seconds. @param {number} now */
  wantedDelay(now) {
    this.#numbers[NOW] = now;
    this.#want();
    return this.#numbers[WANTED];
  }

  /** The present delay, seconds. @param {number} now */
  delay(now) {
    const playhead = this.#numbers[PLAYHEAD];
    return playhead === playhead ? this.serverTime(now) - playhead : this.wantedDelay(now);
  }

  /** Advances to local `now`; returns the moment to show, in server time. @param {number} now */
  advance(now) {
    const numbers = this.#numbers;
    if (numbers[OFFSET] !== numbers[OFFSET]) return now; // nothing has come yet
    numbers[NOW] = now;
    this.#advance();
    return numbers[PLAYHEAD];
  }

  #observeChunk() {
    const numbers = this.#numbers;
    if (numbers[AT] < numbers[CAUGHT_UP]) return;
    const offset = numbers[OFFSET] === numbers[OFFSET] ? numbers[OFFSET] : 0;
    this.#earliness.given[0] = numbers[NOW];
    this.#earliness.given[1] = numbers[AT] - (numbers[NOW] - offset);
    this.#earliness.take();
  }

  #observe() {
    const numbers = this.#numbers;
    // at first, expect as much as the first delay allows
    if (numbers[OFFSET] !== numbers[OFFSET]) this.#earliness.add(numbers[NOW], MARGIN - FIRST_DELAY);
    const transit = this.#transit;
    transit.given[0] = numbers[NOW];
    transit.given[1] = numbers[NOW] - numbers[AT];
    transit.take();
    transit.look();
    numbers[OFFSET] = transit.found[0];
  }

  #want() {
    const numbers = this.#numbers;
    this.#earliness.given[0] = numbers[NOW];
    this.#earliness.look();
    const earliness = this.#earliness.found[0];
    numbers[WANTED] = earliness === earliness
      ? Math.min(MAX_DELAY, Math.max(MIN_DELAY, MARGIN - earliness)) : MIN_DELAY;
  }

  #advance() {
    const numbers = this.#numbers;
    this.#want();
    const ideal = numbers[NOW] - numbers[OFFSET] - numbers[WANTED];
    if (!(Math.abs(ideal - numbers[PLAYHEAD]) <= JUMP)) {
      numbers[PLAYHEAD] = ideal;
    } else {
      const step = Math.max(0, numbers[NOW] - numbers[LAST]);
      const off = ideal - (numbers[PLAYHEAD] + step);
      numbers[PLAYHEAD] += step + Math.min(STRETCH * step, Math.max(-STRETCH * step, off));
    }
    numbers[LAST] = numbers[NOW];
  }
}

const TIME = 0, SHARE = 1, HELD_AT = 2;

/** The frames of one agent, and its pose at moments that never go back. */
export class PoseTrack {
  #times = new Float64Array(32); // rings
  #frames;
  #contacts = new Uint8Array(32);
  #first = 0;
  #count = 0;
  #starving = false;
  #held; // pose to blend from
  #numbers = new Float64Array(3).fill(NaN); // of the call: TIME, SHARE; HELD_AT: NaN when there is no blend
  #shown;

  /** @param {number} width numbers per frame: hips x, y, z, then x, y, z, w per bone */
  constructor(width) {
    this.width = width;
    /** How often frames ran out. */
    this.underruns = 0;
    /** Bits of the frame at or before the moment shown: 1 left foot, 2 right foot. */
    this.contacts = 0;
    /** Whether frames have run out, and the last one is shown. */
    this.held = false;
    this.#frames = new Float32Array(32 * width);
    this.#held = new Float32Array(width);
    this.#shown = new Float32Array(width);
  }

  /** Number of frames in the queue. */
  get length() {
    return this.#count;
  }

  /**
   * Adds `count` frames that stand one behind the other in `frames`, the first of which is for `time`, with a byte
   * of `contacts` each, from `at` on. Known ones are dropped.
   * @param {number} time @param {number} fps @param {ArrayLike<number>} frames @param {number} count
   * @param {ArrayLike<number>} contacts @param {number} [at]
   */
  push(time, fps, frames, count, contacts, at = 0) {
    this.#numbers[TIME] = time;
    this.#push(fps, frames, count, contacts, at);
  }

  /**
   * The same, of a time in an array, so that it is not boxed.
   * @param {Float64Array} time @param {number} fps @param {ArrayLike<number>} frames @param {number} count
   * @param {ArrayLike<number>} contacts @param {number} at
   */
  take(time, fps, frames, count, contacts, at) {
    this.#numbers[TIME] = time[0];
    this.#push(fps, frames, count, contacts, at);
  }

  /** Seconds of frames after `time`; negative when they have run out. @param {number} time */
  buffered(time) {
    return this.#count ? this.#times[this.#slot(this.#count - 1)] - time : -Infinity;
  }

  /**
   * Writes the pose at `time` into `out`; false when no frame has come yet.
   * @param {number} time @param {Float32Array} out @returns {boolean}
   */
  sample(time, out) {
    this.#numbers[TIME] = time;
    return this.#sample(out);
  }

  /** The same, of a time in an array, so that it is not boxed. @param {Float64Array} time @param {Float32Array} out @returns {boolean} */
  sampleAt(time, out) {
    this.#numbers[TIME] = time[0];
    return this.#sample(out);
  }

  /** @param {number} fps @param {ArrayLike<number>} frames @param {number} count @param {ArrayLike<number>} contacts @param {number} at */
  #push(fps, frames, count, contacts, at) {
    const { width } = this;
    const time = this.#numbers[TIME];
    const last = this.#count ? this.#times[this.#slot(this.#count - 1)] : -Infinity;
    for (let k = 0; k < count; k += 1) {
      const when = time + k / fps;
      if (when <= last + 0.25 / fps) continue;
      if (this.#count === KEPT) this.#drop();
      else if (this.#count === this.#times.length) this.#grow();
      const slot = this.#slot(this.#count);
      this.#times[slot] = when;
      this.#contacts[slot] = contacts[at + k];
      for (let n = 0; n < width; n += 1) this.#frames[width * slot + n] = frames[width * k + n];
      this.#count += 1;
    }
  }

  /** @param {Float32Array} out */
  #sample(out) {
    if (!this.#count) return false;
    const numbers = this.#numbers;
    const time = numbers[TIME];
    // one frame before `time` stays, to interpolate from
    while (this.#count > 1 && this.#times[this.#slot(1)] <= time) this.#drop();
    this.held = this.#count === 1 && time > this.#times[this.#first];
    if (this.held) {
      if (!this.#starving) this.underruns += 1;
      this.#starving = true;
    } else if (this.#starving && this.#count > 1) {
      this.#starving = false;
      this.#held.set(this.#shown);
      numbers[HELD_AT] = time;
    }
    this.#between(out);
    const share = (time - numbers[HELD_AT]) / BLEND;
    if (share >= 1) {
      numbers[HELD_AT] = NaN;
    } else if (share === share) {
      numbers[SHARE] = share * share * (3 - 2 * share);
      mix(this.#held, 0, out, 0, numbers, out, this.width);
    }
    for (let n = 0; n < this.width; n += 1) this.#shown[n] = out[n];
    this.contacts = this.#contacts[this.#first];
    return true;
  }

  /** @param {Float32Array} out */
  #between(out) {
    const { width } = this;
    const time = this.#numbers[TIME], before = this.#times[this.#first];
    const from = width * this.#first;
    if (this.#count === 1 || time <= before) {
      for (let n = 0; n < width; n += 1) out[n] = this.#frames[from + n];
      return;
    }
    const next = this.#slot(1);
    this.#numbers[SHARE] = (time - before) / (this.#times[next] - before);
    mix(this.#frames, from, this.#frames, width * next, this.#numbers, out, width);
  }

  /** @param {number} k */
  #slot(k) {
    return (this.#first + k) & (this.#times.length - 1);
  }

  #drop() {
    this.#first = this.#slot(1);
    this.#count -= 1;
  }

  #grow() {
    const size = this.#times.length;
    const [times, frames, contacts] = [this.#times, this.#frames, this.#contacts];
    this.#times = new Float64Array(2 * size);
    this.#frames = new Float32Array(2 * size * this.width);
    this.#contacts = new Uint8Array(2 * size);
    for (let k = 0; k < size; k += 1) {
      const slot = (this.#first + k) & (size - 1);
      this.#times[k] = times[slot];
      this.#contacts[k] = contacts[slot];
      this.#frames.set(frames.subarray(this.width * slot, this.width * (slot + 1)), this.width * k);
    }
    this.#first = 0;
  }
}

/**
 * out = between poses a (at i) and b (at j): hips on a line, rotations along the shorter arc. Aliasing is fine.
 * @param {Float32Array} a @param {number} i @param {Float32Array} b @param {number} j
 * @param {number} share @param {Float32Array} out @param {number} width
 */
export function mixPoses(a, i, b, j, share, out, width) {
  mix(a, i, b, j, Float64Array.of(0, share), out, width);
}

/**
 * @param {Float32Array} a @param {number} i @param {Float32Array} b @param {number} j
 * @param {Float64Array} numbers whose SHARE is meant @param {Float32Array} out @param {number} width
 */
function mix(a, i, b, j, numbers, out, width) {
  const share = numbers[SHARE];
  for (let k = 0; k < 3; k += 1) out[k] = a[i + k] + (b[j + k] - a[i + k]) * share;
  for (let k = 3; k < width; k += 4) {
    const p = i + k, q = j + k;
    let dot = a[p] * b[q] + a[p + 1] * b[q + 1] + a[p + 2] * b[q + 2] + a[p + 3] * b[q + 3];
    const sign = dot < 0 ? -1 : 1;
    dot *= sign;
    let fromA = 1 - share;
    let fromB = share * sign;
    if (dot < 0.9995) {
      const angle = Math.acos(dot);
      const sine = Math.sin(angle);
      fromA = Math.sin((1 - share) * angle) / sine;
      fromB = (Math.sin(share * angle) / sine) * sign;
    }
    const x = a[p] * fromA + b[q] * fromB, y = a[p + 1] * fromA + b[q + 1] * fromB;
    const z = a[p + 2] * fromA + b[q + 2] * fromB, w = a[p + 3] * fromA + b[q + 3] * fromB;
    const length = Math.sqrt(x * x + y * y + z * z + w * w) || 1;
    out[k] = x / length;
    out[k + 1] = y / length;
    out[k + 2] = z / length;
    out[k + 3] = w / length;
  }
}
