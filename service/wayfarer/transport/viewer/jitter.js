// Smooth playback of chunks that arrive unevenly. No DOM, no clock: time is an argument, in seconds.

const FIRST_DELAY = 0.35;
const LEAST_DELAY = 0.2;
const MOST_DELAY = 1.5;
const MARGIN = 0.06; // over the worst lateness seen of late
const LATENESS_WINDOW = 20; // seconds for which the worst lateness counts
const STRETCH = 0.05; // playback may run this much faster or slower to reach the wanted delay
const JUMP = 1.0; // seconds off beyond which it jumps instead (a tab that slept)
const OFFSET_WINDOW = 30; // seconds over which the least transit time is taken as "no delay"
const BLEND = 0.2; // seconds to blend from a held pose to the stream again
const KEPT = 400; // frames kept at most: a hidden tab receives, but does not play

/** The least value of the last `seconds`, by a queue of values that rise from front to back. */
class WindowLeast {
  #queue = []; // [time, value]

  constructor(seconds) {
    this.seconds = seconds;
  }

  add(now, value) {
    while (this.#queue.length && this.#queue.at(-1)[1] >= value) this.#queue.pop();
    this.#queue.push([now, value]);
  }

  /** NaN when there is none. */
  least(now) {
    while (this.#queue.length && this.#queue[0][0] < now - this.seconds) this.#queue.shift();
    return this.#queue.length ? this.#queue[0][1] : NaN;
  }
}

/** Which moment of the stream (server time) to show now, for all agents alike. */
export class PlayoutClock {
  #transit = new WindowLeast(OFFSET_WINDOW); // local - server time of each message
  #earliness = new WindowLeast(LATENESS_WINDOW); // of each chunk, negative when late
  #offset = NaN; // the last known least transit
  #playhead = null;
  #lastNow = 0;

  /** Note a message that arrived at local `now`, sent at server time `sentAt`. */
  observe(now, sentAt) {
    // until lateness is known from experience, expect as much as the first delay allows
    if (Number.isNaN(this.#offset)) this.#earliness.add(now, MARGIN - FIRST_DELAY);
    this.#transit.add(now, now - sentAt);
    this.#offset = this.#transit.least(now);
  }

  /** Note a chunk that arrived at local `now` and whose first frame was scheduled for then. */
  observeChunk(now, scheduledAt) {
    this.#earliness.add(now, scheduledAt - this.serverTime(now));
  }

  /** The server's clock at local `now`, as if the fastest recent message had taken no time. */
  serverTime(now) {
    return Number.isNaN(this.#offset) ? now : now - this.#offset;
  }

  /** Delay to aim at. */
  wantedDelay(now) {
    const earliness = this.#earliness.least(now);
    if (Number.isNaN(earliness)) return LEAST_DELAY;
    return Math.min(MOST_DELAY, Math.max(LEAST_DELAY, MARGIN - earliness));
  }

  /** Delay in force. */
  delay(now) {
    return this.#playhead === null ? this.wantedDelay(now) : this.serverTime(now) - this.#playhead;
  }

  /** Advance to local `now` and return the moment to show. */
  advance(now) {
    if (Number.isNaN(this.#offset)) return now; // nothing has come yet
    const ideal = this.serverTime(now) - this.wantedDelay(now);
    if (this.#playhead === null || Math.abs(ideal - this.#playhead) > JUMP) {
      this.#playhead = ideal;
    } else {
      const step = Math.max(0, now - this.#lastNow);
      const error = ideal - (this.#playhead + step);
      const limit = STRETCH * step;
      this.#playhead += step + Math.min(limit, Math.max(-limit, error));
    }
    this.#lastNow = now;
    return this.#playhead;
  }
}

/** The frames of one agent, and the pose at any moment of them. */
export class PoseTrack {
  #times = [];
  #frames = [];
  #shown = null; // last pose given out
  #held = null; // pose to blend from
  #heldAt = 0;
  underruns = 0;
  #starving = false;

  /** Add frames, the first of which is for `time`. Frames at or before known ones are dropped. */
  push(time, fps, frames) {
    const last = this.#times.at(-1) ?? -Infinity;
    for (let k = 0; k < frames.length; k += 1) {
      const at = time + k / fps;
      if (at <= last + 0.25 / fps) continue;
      this.#times.push(at);
      this.#frames.push(frames[k]);
    }
    const surplus = this.#times.length - KEPT;
    if (surplus > 0) {
      this.#times.splice(0, surplus);
      this.#frames.splice(0, surplus);
    }
  }

  get frameCount() {
    return this.#times.length;
  }

  /** Seconds of frames that lie after `time`; negative when the track has run dry. */
  buffered(time) {
    return this.#times.length ? this.#times.at(-1) - time : -Infinity;
  }

  /** Write the pose at `time` into `out`; false when no frame has come yet. */
  sample(time, out) {
    const times = this.#times;
    if (times.length === 0) return false;
    // keep one frame before `time`, to interpolate from
    while (times.length > 1 && times[1] <= time) {
      times.shift();
      this.#frames.shift();
    }
    if (times.length === 1 && time > times[0]) {
      if (!this.#starving) this.underruns += 1;
      this.#starving = true;
    } else if (this.#starving && times.length > 1) {
      this.#starving = false;
      this.#held = this.#shown ? Float32Array.from(this.#shown) : null;
      this.#heldAt = time;
    }
    this.#mix(time, out);
    if (this.#held !== null) {
      const share = (time - this.#heldAt) / BLEND;
      if (share >= 1) this.#held = null;
      else mixPoses(this.#held, out, share * share * (3 - 2 * share), out);
    }
    this.#shown ??= new Float32Array(out.length);
    this.#shown.set(out);
    return true;
  }

  #mix(time, out) {
    const [before, after] = this.#times;
    if (after === undefined || time <= before) out.set(this.#frames[0]);
    else mixPoses(this.#frames[0], this.#frames[1], (time - before) / (after - before), out);
  }
}

/** out = a…b at `share`: hips linearly, rotations along the shorter arc (slerp). Aliasing is fine. */
export function mixPoses(a, b, share, out) {
  for (let k = 0; k < 3; k += 1) out[k] = a[k] + (b[k] - a[k]) * share;
  for (let k = 3; k < a.length; k += 4) {
    let dot = a[k] * b[k] + a[k + 1] * b[k + 1] + a[k + 2] * b[k + 2] + a[k + 3] * b[k + 3];
    const sign = dot < 0 ? -1 : 1;
    dot *= sign;
    let fromA = 1 - share;
    let fromB = share * sign;
    if (dot < 0.9995) {
      const angle = Math.acos(dot);
      fromA = Math.sin((1 - share) * angle) / Math.sin(angle);
      fromB = (Math.sin(share * angle) / Math.sin(angle)) * sign;
    }
    let norm = 0;
    for (let c = k; c < k + 4; c += 1) {
      out[c] = a[c] * fromA + b[c] * fromB;
      norm += out[c] * out[c];
    }
    norm = Math.sqrt(norm) || 1;
    for (let c = k; c < k + 4; c += 1) out[c] /= norm;
  }
}
