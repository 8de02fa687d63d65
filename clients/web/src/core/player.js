// The agents of a stream, played smoothly: messages and times go in, poses come out.

import { FLAG, StreamDecoder } from "./messages.js";
import { PlayoutClock, PoseTrack } from "./playout.js";
import { frameBytes } from "./poses.js";
import { TierUnpacker } from "./tiers.js";

/** @typedef {import("./messages.js").Agent} Agent */
/** @typedef {import("./messages.js").Chunk} Chunk */
/** @typedef {import("./messages.js").Header} Header */

/** An agent as it is shown. */
export class PlayedAgent {
  /** @param {Agent} agent @param {number} width numbers per frame */
  constructor(agent, width) {
    this.agent = agent;
    /** Hips x, y, z, then x, y, z, w for each of the header's bones. */
    this.frame = new Float32Array(width);
    this.track = new PoseTrack(width);
    /** Whether `frame` holds a pose. */
    this.shown = false;
    /** Whether it was removed for having left the last ring, and may come again. */
    this.hidden = false;
    /** Number of its ring, from the last chunk. */
    this.tier = 0;
    /** "standing", "walking", "stopping" or "turning", from the last chunk. */
    this.state = "standing";
  }
}

/**
 * Callbacks of a player, called as messages come: `header(header, again)`, `added(played)`, `removed(played)`, also for
 * agents that have left the last ring and are `hidden`, `chunk(played, chunk)`, whose `chunk` is one object that is
 * overwritten each time, and `event(event)`.
 * @typedef {object} PlayerEvents
 * @property {(header: Header, again: boolean) => void} [header]
 * @property {(played: PlayedAgent) => void} [added]
 * @property {(played: PlayedAgent) => void} [removed]
 * @property {(played: PlayedAgent, chunk: Chunk) => void} [chunk]
 * @property {(event: import("./messages.js").MotionEvent) => void} [event]
 */

/** Plays a stream. Times are seconds of any clock of this machine. Allocates only for new agents. */
export class MotionPlayer {
  #decoder = new StreamDecoder();
  #unpacked = new Float32Array(0);
  /** @type {TierUnpacker | null} */
  #tiers = null;
  #goneUnderruns = 0;
  #begun = false;
  #now = new Float64Array(1); // of the message
  #moment = new Float64Array(1); // shown

  /** @param {PlayerEvents} [on] */
  constructor(on = {}) {
    this.on = on;
    this.clock = new PlayoutClock();
    /** By alias. @type {Map<number, PlayedAgent>} */
    this.agents = new Map();
    /** @type {Header | null} */
    this.header = null;
    /** The moment shown: server time, seconds since 1970. */
    this.moment = NaN;
    /** Counts since the start; `gaps`, `reduced` and `held` count chunks with that flag. */
    this.stats = { messages: 0, bytes: 0, chunks: 0, frames: 0, gaps: 0, reduced: 0, held: 0 };
  }

  /** The token from which the next stream resumes; "" at first. */
  get resumeToken() {
    return this.#decoder.resumeToken;
  }

  /** How often an agent's frames ran out. */
  get underruns() {
    let sum = this.#goneUnderruns;
    for (const played of this.agents.values()) sum += played.track.underruns;
    return sum;
  }

  /** Seconds of motion in the queue of the agent that has the least; Infinity without agents. */
  get buffered() {
    let least = Infinity;
    for (const played of this.agents.values()) least = Math.min(least, played.track.buffered(this.moment));
    return least;
  }

  /** A connection begins: its first message is a header. */
  begin() {
    this.#begun = false;
  }

  /**
   * Takes a message of the stream (StreamMotionResponse) that came at local `now`. Returns its kind. Throws when it
   * cannot be read; the connection is then of no more use.
   * @param {Uint8Array} message @param {number} now
   */
  receive(message, now) {
    const decoder = this.#decoder;
    const kind = decoder.decode(message);
    this.stats.messages += 1;
    this.stats.bytes += message.length;
    if (kind === "header") this.#header(/** @type {Header} */ (decoder.header));
    this.clock.observe(now, decoder.sentAt);
    this.#now[0] = now;
    if (kind === "batch") this.#batch();
    else if (kind === "event" && decoder.event) this.on.event?.(decoder.event);
    return kind;
  }

  /** Shows all agents as at local `now`. Returns the moment shown, in server time. @param {number} now */
  advance(now) {
    this.moment = this.#moment[0] = this.clock.advance(now);
    this.agents.forEach(this.#show);
    return this.moment;
  }

  /** Time has passed in which nothing could be received: `MotionStream.wake`. */
  wake() {
    this.clock = new PlayoutClock();
  }

  /** Forgets all agents, as if they were removed, and the clock. */
  clear() {
    for (const alias of [...this.agents.keys()]) this.remove(alias);
    this.clock = new PlayoutClock();
  }

  /** Forgets an agent. @param {number} alias */
  remove(alias) {
    const played = this.agents.get(alias);
    if (!played) return;
    this.#goneUnderruns += played.track.underruns;
    this.agents.delete(alias);
    this.on.removed?.(played);
  }

  #show = (/** @type {PlayedAgent} */ played) => {
    played.shown = played.track.sampleAt(this.#moment, played.frame);
  };

  /** @param {Header} header */
  #header(header) {
    const again = this.header !== null;
    this.#begun = true;
    this.header = header;
    header.tiers.forEach(({ encoding, bones }) => frameBytes(encoding, bones.length)); // an unknown one throws at once
    this.#tiers = new TierUnpacker(header);
    if (again) this.clock.resumed(this.#decoder.sentAt);
    this.on.header?.(header, again);
  }

  #batch() {
    const decoder = this.#decoder, { header } = this, tiers = this.#tiers;
    if (!this.#begun || !header || !tiers) throw new Error("motion came before the header");
    decoder.checkFrames(header);
    for (const agent of decoder.added) this.#add(agent, tiers.width);
    for (let row = 0; row < decoder.chunks; row += 1) this.#chunk(decoder.chunk(row), tiers);
    for (let row = 0; row < decoder.removed; row += 1) this.remove(decoder.removedAlias(row));
    for (let row = 0; row < decoder.hidden; row += 1) this.#hide(decoder.hiddenAlias(row));
  }

  /** @param {number} alias */
  #hide(alias) {
    const played = this.agents.get(alias);
    if (played) played.hidden = true;
    this.remove(alias);
  }

  /** A new agent, or a known one when a stream begins again. @param {Agent} agent @param {number} width */
  #add(agent, width) {
    const known = this.agents.get(agent.alias);
    if (known?.agent.id === agent.id && known.track.width === width) return;
    if (known) this.remove(agent.alias);
    const played = new PlayedAgent(agent, width);
    this.agents.set(agent.alias, played);
    this.on.added?.(played);
  }

  /** @param {ReturnType<StreamDecoder["chunk"]>} chunk @param {TierUnpacker} tiers */
  #chunk(chunk, tiers) {
    const { stats } = this, { view, bytes, tier } = this.#decoder, { width } = tiers;
    stats.chunks += 1;
    stats.frames += chunk.frames;
    if (chunk.flags & FLAG.GAP) stats.gaps += 1;
    if (chunk.flags & FLAG.REDUCED) stats.reduced += 1;
    if (chunk.flags & FLAG.HELD) stats.held += 1;
    const played = this.agents.get(chunk.alias);
    if (!played) return; // removed here, its last chunks still on the way
    this.clock.takeChunk(this.#now, chunk.time);
    if (this.#unpacked.length < chunk.frames * width) this.#unpacked = new Float32Array(2 * chunk.frames * width);
    tiers.unpack(view, chunk.poses, chunk.frames, tier, this.#unpacked);
    played.track.take(chunk.time, tiers.tiers[tier].sentFps, this.#unpacked, chunk.frames, bytes, chunk.contacts);
    played.state = chunk.state;
    played.tier = tier;
    this.on.chunk?.(played, chunk);
  }
}
