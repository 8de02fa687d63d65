// The last seconds of people as they were shown, small enough for an address. No DOM.
//
// A frame is a row of numbers: the hips' place, their turn about the vertical and their tilt, each other bone's rotation as
// axis times angle. Over some seconds each number is a rounded sum of cosines (DCT-II), which drops fast trembling.
// The last frame is corrected to a millimetre; before it, joints are off by some millimetres.

import { pack, unpack } from "./script.js";

export const FPS = 30;
const BLOCK = 90; // maximum frames of one sum of cosines
const VERSION = 2; // version 1 had a last frame that is off by up to 1.5 mm, and is still read
const ROUGH = { place: 5e-3, turn: 6e-3 }; // metres and radians to which cosines are rounded
const FINE = [{ place: 2e-4, turn: 2e-4 }, { place: 1e-4, turn: 1e-4 }]; // the last frame, by version
const CORRECTED = 12; // frames over which the correction fades in
const EACH = 900; // first guess of the characters for one second of one person
const SAME = 1e-6; // seconds: moments that differ by rounding
const LEAST = 0.5; // minimum seconds worth sending
const BROKEN = "The link's motion is not whole, or of another version of this page";

/**
 * The last seconds of people { agent, played } before `moment`, as many as fit into `room` characters: { text, seconds }, or { text:
 * "", seconds: 0 } if that is almost nothing. `history` has `sample(alias, moment, out)`, `contacts(alias, moment)` and `first`.
 */
export async function pastOf(people, history, moment, room) {
  // history begins a frame before the first that it keeps
  let seconds = Math.min(moment - history.first - 1 / FPS + SAME, room / (EACH * Math.max(1, people.length)));
  while (seconds >= LEAST) {
    const count = Math.floor(seconds * FPS) + 1;
    const text = await encodePast(count, people.map((person) => motionOf(person, history, moment, count)));
    if (text.length <= room) return { text, seconds: (count - 1) / FPS };
    seconds *= (0.95 * room) / text.length;
  }
  return { text: "", seconds: 0 };
}

function motionOf({ agent, played }, history, moment, count) {
  const width = played.frame.length, frame = new Float32Array(width);
  const frames = [], contacts = [];
  for (let k = count - 1; k >= 0; k -= 1) { // back to when it came
    const at = moment - (count - 1 - k) / FPS + SAME;
    if (!history.sample(agent.alias, at, frame)) break;
    frames.unshift(frame.slice());
    contacts.unshift(history.contacts(agent.alias, at));
  }
  return { frames, contacts };
}

/** Text of the last frames of people; `count`: number of frames of people who were present all the time. */
export async function encodePast(count, people) {
  const bones = ((people.find(({ frames }) => frames.length)?.frames[0].length ?? 7) - 3) / 4;
  const bytes = new Writer();
  bytes.put(VERSION, bones, count, people.length);
  for (const { frames } of people) bytes.put(frames.length);
  const rows = people.map(({ frames }) => channelsOf(frames, bones));
  const blocks = rows.flatMap((channels) => blocksOf(channels[0].length).map(([from, to]) => (
    channels.map((values, k) => cosines(values.subarray(from, to)).map((value) => Math.round(value / step(ROUGH, k)) + 0))
  )));
  eachNumber(blocks, (block, channel, k) => bytes.putSigned(block[channel][k]));
  let first = 0;
  for (const channels of rows) {
    const parts = blocksOf(channels[0].length), last = parts.at(-1);
    first += parts.length;
    if (!last) continue;
    const rough = valuesOf(blocks[first - 1]);
    channels.forEach((values, k) => bytes.putSigned(Math.round((values.at(-1) - rough[k].at(-1)) / step(FINE[VERSION - 1], k))));
  }
  for (const { contacts } of people) {
    for (let from = 0, to = 0; from < contacts.length; from = to) {
      while (to < contacts.length && contacts[to] === contacts[from]) to += 1;
      bytes.put(4 * (to - from) + contacts[from]);
    }
  }
  return pack(bytes.all());
}

/** The contents of a text: { count, people: [{ frames, contacts }] }. Throws a readable error if it holds nothing. */
export async function decodePast(text) {
  try {
    return decoded(new Reader(await unpack(text)));
  } catch {
    throw new Error(BROKEN);
  }
}

function decoded(bytes) {
  const [version, bones, count, size] = [bytes.take(), bytes.take(), bytes.take(), bytes.take()];
  const fine = FINE[version - 1];
  if (!fine || bones > 64 || count > 3600 || size > 1000) throw new Error(BROKEN);
  const lengths = Array.from({ length: size }, () => bytes.take());
  if (lengths.some((length) => length > count)) throw new Error(BROKEN);
  const each = 3 + 3 * bones;
  const blocks = lengths.flatMap((length) => blocksOf(length).map(([from, to]) => Array.from({ length: each }, () => new Float64Array(to - from))));
  eachNumber(blocks, (block, channel, k) => { block[channel][k] = bytes.takeSigned(); });
  let first = 0;
  const people = lengths.map((length) => {
    const parts = blocksOf(length).map((_, k) => valuesOf(blocks[first + k]));
    first += parts.length;
    const channels = Array.from({ length: each }, (_, k) => Float64Array.from(parts.flatMap((part) => [...part[k]])));
    if (length) channels.forEach((values, k) => correct(values, bytes.takeSigned() * step(fine, k)));
    return { frames: Array.from({ length }, (_, t) => frameOf(channels, t, bones)) };
  });
  for (const [k, length] of lengths.entries()) {
    const contacts = new Uint8Array(length);
    for (let from = 0; from < length;) {
      const run = bytes.take(), to = from + Math.floor(run / 4);
      contacts.fill(run % 4, from, to);
      if (to === from) throw new Error(BROKEN);
      from = to;
    }
    people[k].contacts = contacts;
  }
  return { count, people };
}

const step = ({ place, turn }, channel) => (channel < 3 ? place : turn);

/** Where blocks of about one length begin and end. */
function blocksOf(length) {
  const count = Math.ceil(length / BLOCK);
  return Array.from({ length: count }, (_, k) => [Math.floor((k * length) / count), Math.floor(((k + 1) * length) / count)]);
}

/** Visits similar numbers one after the other, since they compress well. */
function eachNumber(blocks, act) {
  for (let k = 0; k < BLOCK; k += 1) {
    for (let channel = 0; channel < (blocks[0]?.length ?? 0); channel += 1) {
      for (const block of blocks) if (k < block[channel].length) act(block, channel, k);
    }
  }
}

/** Numbers of frames over time: first the hips' place, turn and tilt, then three for each other bone. */
function channelsOf(frames, bones) {
  const channels = Array.from({ length: 3 + 3 * bones }, () => new Float64Array(frames.length));
  let turn = 0;
  frames.forEach((frame, t) => {
    for (let k = 0; k < 3; k += 1) channels[k][t] = frame[k];
    const [x, y, z, w] = frame.subarray(3, 7);
    const now = 2 * Math.atan2(y, w);
    turn += now - turn - 2 * Math.PI * Math.round((now - turn) / (2 * Math.PI));
    const sine = Math.sin(turn / 2), cosine = Math.cos(turn / 2);
    const tilt = axisTimesAngle(cosine * x - sine * z, 0, cosine * z + sine * x, cosine * w + sine * y);
    [channels[3][t], channels[4][t], channels[5][t]] = [turn, tilt[0], tilt[2]];
    for (let bone = 1; bone < bones; bone += 1) {
      axisTimesAngle(...frame.subarray(3 + 4 * bone, 7 + 4 * bone)).forEach((value, k) => { channels[3 + 3 * bone + k][t] = value; });
    }
  });
  return channels;
}

function frameOf(channels, t, bones) {
  const frame = new Float32Array(3 + 4 * bones);
  for (let k = 0; k < 3; k += 1) frame[k] = channels[k][t];
  const sine = Math.sin(channels[3][t] / 2), cosine = Math.cos(channels[3][t] / 2);
  const [x, , z, w] = rotation(channels[4][t], 0, channels[5][t]);
  frame.set([cosine * x + sine * z, sine * w, cosine * z - sine * x, cosine * w], 3);
  for (let bone = 1; bone < bones; bone += 1) {
    const at = 3 + 3 * bone;
    frame.set(rotation(channels[at][t], channels[at + 1][t], channels[at + 2][t]), 3 + 4 * bone);
  }
  return frame;
}

function axisTimesAngle(x, y, z, w) {
  const sine = Math.hypot(x, y, z), sign = w < 0 ? -1 : 1;
  const each = sine > 1e-9 ? (2 * Math.atan2(sine, sign * w)) / sine : 2;
  return [sign * each * x, sign * each * y, sign * each * z];
}

function rotation(x, y, z) {
  const angle = Math.hypot(x, y, z), each = angle > 1e-9 ? Math.sin(angle / 2) / angle : 0.5;
  return [each * x, each * y, each * z, Math.cos(angle / 2)];
}

const WAVES = new Map(); // length → its cosines, row by row

function waves(length) {
  if (!WAVES.has(length)) {
    WAVES.set(length, Float64Array.from({ length: length * length }, (_, at) => {
      const k = Math.floor(at / length), t = at % length;
      return Math.sqrt((k ? 2 : 1) / length) * Math.cos((Math.PI * (t + 0.5) * k) / length);
    }));
  }
  return WAVES.get(length);
}

/** Values over time as shares of cosines. */
function cosines(values) {
  const { length } = values, table = waves(length), shares = new Float64Array(length);
  for (let k = 0; k < length; k += 1) for (let t = 0; t < length; t += 1) shares[k] += table[k * length + t] * values[t];
  return shares;
}

/** Values over time, for each number of a block of rounded shares. */
function valuesOf(block) {
  return block.map((shares, channel) => {
    const { length } = shares, table = waves(length), values = new Float64Array(length), size = step(ROUGH, channel);
    for (let k = 0; k < length; k += 1) if (shares[k]) for (let t = 0; t < length; t += 1) values[t] += size * shares[k] * table[k * length + t];
    return values;
  });
}

/** Moves the last value by `off`, and the values before it gradually less. */
function correct(values, off) {
  const from = Math.max(0, values.length - CORRECTED);
  for (let t = from; t < values.length; t += 1) values[t] += (off * (t + 1 - from)) / (values.length - from);
}

/** Whole numbers as bytes, seven bits in each. */
class Writer {
  #bytes = [];

  put(...numbers) {
    for (let rest of numbers) {
      for (; rest >= 128; rest = Math.floor(rest / 128)) this.#bytes.push((rest % 128) + 128);
      this.#bytes.push(rest);
    }
  }

  putSigned(number) {
    this.put(number < 0 ? -2 * number - 1 : 2 * number);
  }

  all() {
    return Uint8Array.from(this.#bytes);
  }
}

class Reader {
  #at = 0;

  constructor(bytes) {
    this.bytes = bytes;
  }

  take() {
    for (let number = 0, scale = 1; ; scale *= 128) {
      if (this.#at >= this.bytes.length || scale > 2 ** 49) throw new Error(BROKEN);
      const byte = this.bytes[this.#at];
      this.#at += 1;
      number += (byte % 128) * scale;
      if (byte < 128) return number;
    }
  }

  takeSigned() {
    const number = this.take();
    return number % 2 ? -(number + 1) / 2 : number / 2;
  }
}
