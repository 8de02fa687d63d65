// The moment that is shown: now, or one of the last minute. No DOM.

export const FRAME = 1 / 30; // seconds of a step
export const RATES = [1, 0.5, 0.25, 0.1];

export class Timeline {
  /** `history` has the moments { first, last } that can be shown. */
  constructor(history) {
    this.history = history;
    this.moment = null; // null: the stream, as it comes
    this.rate = 1;
    this.playing = true;
  }

  get live() {
    return this.moment === null;
  }

  goLive() {
    this.moment = null;
    this.playing = true;
    this.rate = 1;
  }

  pause() {
    if (this.live && !Number.isFinite(this.history.last)) return; // nothing has been shown
    this.moment ??= this.history.last;
    this.playing = false;
  }

  /** Continues from the moment shown. */
  play() {
    this.playing = true;
  }

  /** Shows a moment by its share of the history: 0 the earliest, 1 the last. */
  scrub(share) {
    this.pause();
    if (this.live) return;
    const { first, last } = this.history;
    this.moment = first + (last - first) * Math.min(1, Math.max(0, share));
  }

  /** Moves by this number of frames. */
  step(frames) {
    this.pause();
    if (!this.live) this.#to(this.moment + frames * FRAME);
  }

  /** Sets the share of the speed; a speed below 1 falls behind the stream. */
  setRate(rate) {
    this.rate = rate;
    if (rate < 1 && this.live && Number.isFinite(this.history.last)) this.moment = this.history.last;
  }

  /** Advances by some seconds. Returns the moment to show, or null for the present. */
  advance(seconds) {
    if (this.live) return null;
    const on = this.playing ? seconds * this.rate : 0;
    this.#to(this.moment + on);
    if (this.playing && this.rate >= 1 && this.moment >= this.history.last) this.goLive();
    return this.moment;
  }

  /** The moment shown as a share of the history: 0 to 1. */
  get share() {
    const { first, last } = this.history;
    return this.live || !(last > first) ? 1 : (this.moment - first) / (last - first);
  }

  #to(moment) {
    this.moment = Math.min(this.history.last, Math.max(this.history.first, moment));
  }
}
