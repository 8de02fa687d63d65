// The people of this session: what the stream brings, played back smoothly on the stage.

import { FLAG } from "./messages.js";
import { PlayoutClock, PoseTrack } from "./jitter.js";
import { Bodies } from "./bodies.js";
import { Person } from "./people.js";
import { Trails } from "./trails.js";

const PRESSURE_SECONDS = 3; // for which reduced and held motion counts as present

/** Follows `MotionStream` events; `changed()` is called when somebody comes or goes. */
export class Crowd {
  /** `heightAt(x, z, y)`: of the ground at a place. */
  constructor(stage, heightAt, mesh, changed, failed) {
    this.stage = stage;
    this.bodies = new Bodies();
    this.trails = new Trails();
    this.heightAt = heightAt;
    stage.add(this.bodies.group);
    stage.add(this.trails.lines);
    this.mesh = mesh; // agent → [URL of its GLB, headers to ask for it with]
    this.changed = changed;
    this.failed = failed;
    this.clock = new PlayoutClock();
    this.members = new Map(); // alias → { person, track, frame, state }
    this.boneNames = [];
    this.marks = { trails: false, labels: false };
    this.caughtUpAt = -Infinity; // server time at which the stream was resumed
    this.strained = { reduced: -Infinity, held: -Infinity }; // local time of the last such chunk
  }

  get people() {
    return [...this.members.values()].map(({ person }) => person);
  }

  /** Handlers for MotionStream; `now()` is a local clock in seconds. */
  handlers(now) {
    return {
      message: (sentAt) => this.clock.observe(now(), sentAt),
      added: (agent) => this.add(agent),
      removed: (alias) => this.remove(alias),
      chunk: (chunk, frames, fps) => this.#chunk(chunk, frames, fps, now()),
    };
  }

  /** A new agent, or one that is known already, when a stream begins again. */
  add(agent) {
    const known = this.members.get(agent.alias);
    if (known?.person.agent.id === agent.id) return;
    if (known) this.remove(agent.alias);
    const person = new Person(agent, this);
    const frame = new Float32Array(3 + 4 * this.boneNames.length);
    this.members.set(agent.alias, { person, track: new PoseTrack(), frame, state: "standing" });
    this.stage.add(person.group);
    person.showLabel(this.marks.labels);
    person.load(...this.mesh(agent), this.boneNames).catch((error) => this.failed(`body not loaded: ${error.message}`));
    this.changed();
  }

  remove(alias) {
    this.members.get(alias)?.person.dispose();
    if (this.members.delete(alias)) this.changed();
  }

  /** Remove those that are no more, which nobody has told while the connection was lost. */
  keepOnly(agentIds) {
    for (const [alias, { person }] of [...this.members]) {
      if (!agentIds.has(person.agent.id)) this.remove(alias);
    }
  }

  clear() {
    for (const alias of [...this.members.keys()]) this.remove(alias);
    this.clock = new PlayoutClock();
  }

  mark(name, visible) {
    this.marks[name] = visible;
    if (name === "trails") this.trails.show(visible);
    else for (const person of this.people) person.showLabel(visible);
  }

  stateOf(person) {
    return this.members.get(person.agent.alias)?.state ?? "standing";
  }

  /** Show everybody as at local time `now`. */
  play(now) {
    const moment = this.clock.advance(now);
    for (const { person, track, frame } of this.members.values()) {
      if (track.sample(moment, frame)) person.pose(frame);
    }
    this.bodies.update(now);
    return moment;
  }

  /** Least motion in hand in seconds, and how often somebody had to wait. */
  health(moment) {
    const tracks = [...this.members.values()].map(({ track }) => track);
    return {
      buffered: Math.min(...tracks.map((track) => track.buffered(moment))),
      holds: tracks.reduce((sum, track) => sum + track.underruns, 0),
    };
  }

  /** "full", "reduced" or "held": how well the server has kept up of late. */
  pressure(now) {
    if (now - this.strained.held < PRESSURE_SECONDS) return "held";
    return now - this.strained.reduced < PRESSURE_SECONDS ? "reduced" : "full";
  }

  #chunk(chunk, frames, fps, now) {
    if (chunk.flags & FLAG.REDUCED) this.strained.reduced = now;
    if (chunk.flags & FLAG.HELD) this.strained.held = now;
    const member = this.members.get(chunk.alias);
    if (!member) return; // removed here, its last chunks still on the way
    // what was missed while the connection was lost is late for once, and says nothing of the next
    if (chunk.scheduledAt >= this.caughtUpAt) this.clock.observeChunk(now, chunk.scheduledAt);
    member.track.push(chunk.scheduledAt, fps, frames);
    member.state = chunk.state;
    if (chunk.flags & FLAG.ARRIVED) member.person.reach(chunk.goalRevision, chunk.waypoint);
  }
}
