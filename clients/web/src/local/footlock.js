// Keeps feet that bear weight in place; the next step starts from there. It mirrors the server's
// world/output/footlock.py, which explains the rules, for one person. World: metres, Z up, 40 frames per second.

import { multiply } from "../core/quaternions.js";
import { FRAMES, LegPose, SOLES, moveAnkles } from "./legs.js";
import { bounded } from "./steering.js";

const FPS = 40, SEED = 2;
const TOUCH_HEIGHT = 0.03, TOUCH_SPEED = 0.4, LIFT_HEIGHT = 0.05, LIFT_SPEED = 0.7, TOLD_HEIGHT = 0.02;
const RISE = 1 / 3;
const SLIPPING = [0.25, LIFT_SPEED], SWIVELLING = [2, 6], TILTED = [0.01, 0.025], LEASH = [0.09, 0.14];
const FADE = 1 / (0.15 * FPS);
const SETTLE = 0.25, DROP = 0.02, SOFTNESS = 0.006;
/** How far markers follow knee and ankle. @type {Record<string, [number, number]>} */
const SHARES = {
  THI: [0.5, 0], KNE: [1, 0], KNI: [1, 0], SHN: [0.5, 0.5], CLF: [0.5, 0.5],
  ...Object.fromEntries(["ANK", "HEE", "TOE", "MT1", "MT5"].map((name) => [name, [0, 1]])),
  ...Object.fromEntries(["HEEL", "MT1", "MT5", "TOE"].map((name) => [`SOLE_${name}`, [0, 1]])),
};

/** How far each marker follows each leg, [marker, side, knee and ankle]. @param {string[]} names */
export function legShares(names) {
  const none = [0, 0];
  return names.map((name) => [..."LR"].map((side) => (name[0] === side ? SHARES[name.slice(1)] : undefined) ?? none));
}

/** @param {number} value @param {number[]} ends */
function smooth(value, [low, high]) {
  const t = bounded((value - low) / (high - low), 0, 1);
  return t * t * (3 - 2 * t);
}

/**
 * The step with feet that stay, and its contacts. `shares` are those of its markers.
 * @param {import("./legs.js").Legs} legs @param {number[][][]} shares @param {import("./person.js").Seed} seed
 * @param {import("./person.js").Step} step @returns {import("./person.js").Step}
 */
export function lockFeet(legs, shares, seed, step) {
  const before = new LegPose(legs, seed.translation, Float64Array.from(seed.rotations), SEED);
  const pose = new LegPose(legs, step.translation, step.rotations);
  const contacts = new Uint8Array(2 * FRAMES), shifts = new Float64Array(6 * FRAMES), yaws = new Float64Array(2 * FRAMES);
  for (let side = 0; side < 2; side += 1) {
    let [x, y, height] = slide(before.soles, side, before.soles, 2 + side);
    let touches = height < TOUCH_HEIGHT && FPS * Math.hypot(x, y) < TOUCH_SPEED;
    let hold = Number(touches), shift = [0, 0, 0], yaw = 0;
    for (let k = side; k < 2 * FRAMES; k += 2) {
      const [old, from] = k < 2 ? [before.soles, 2 + side] : [pose.soles, k - 2];
      let atX, atY;
      [x, y, height, atX, atY] = slide(old, from, pose.soles, k);
      const speed = FPS * Math.hypot(x, y);
      touches = touches ? height < LIFT_HEIGHT && speed < LIFT_SPEED : height < TOUCH_HEIGHT && speed < TOUCH_SPEED;
      hold = bounded(hold + (touches ? RISE : -RISE), 0, 1);
      const grip = hold * (1 - smooth(speed, SLIPPING)) * (1 - smooth(Math.hypot(shift[0], shift[1]), LEASH));
      const stays = 1 - (1 - grip) * FADE, settling = -height * (1 - smooth(height, [0, DROP]));
      shift = [stays * shift[0] - grip * x, stays * shift[1] - grip * y, shift[2] + SETTLE * (hold * settling - shift[2])];
      const [swivel, tilt] = swivelOf(old, from, pose.soles, k);
      const firm = hold * (1 - smooth(FPS * Math.abs(swivel), SWIVELLING)) * (1 - smooth(tilt, TILTED));
      yaw = (1 - (1 - firm) * FADE) * yaw - firm * swivel;
      yaws[k] = yaw;
      multiply(Float64Array.of(0, 0, Math.sin(yaw / 2), Math.cos(yaw / 2)), 0, pose.ankleTurn, 4 * k, pose.ankleTurn, 4 * k);
      const [ankleX, ankleY] = ankleOf(pose, step, k), [offX, offY] = turnedOff(yaw, ankleX - atX, ankleY - atY);
      shifts.set([shift[0] + offX, shift[1] + offY, shift[2]], 3 * k);
      contacts[k] = Number(touches && grip >= 0.5 && height + shift[2] <= TOLD_HEIGHT);
    }
  }
  const rotations = step.rotations.slice(), markers = step.markers.slice();
  moveAnkles(pose, shifts, rotations);
  turnFeet(shares, pose, step, yaws, markers);
  follow(shares, pose, new LegPose(legs, step.translation, rotations), markers);
  return { ...step, rotations, markers, contacts };
}

/** The ankle of foot `k` on the floor plan. @param {LegPose} pose @param {import("./person.js").Step} step @param {number} k */
function ankleOf(pose, step, k) {
  const root = 3 * (k >> 1);
  return [step.translation[root] + pose.ankle[3 * k], step.translation[root + 1] + pose.ankle[3 * k + 1]];
}

/** How far the end of an arm moves that turns by `yaw`. @param {number} yaw @param {number} x @param {number} y */
function turnedOff(yaw, x, y) {
  const sine = Math.sin(yaw), lessCosine = Math.cos(yaw) - 1;
  return [lessCosine * x - sine * y, sine * x + lessCosine * y];
}

/**
 * Turns the markers of feet about their ankles.
 * @param {number[][][]} shares @param {LegPose} pose @param {import("./person.js").Step} step @param {Float64Array} yaws
 * @param {Float32Array} markers
 */
function turnFeet(shares, pose, step, yaws, markers) {
  for (let s = 0; s < SEED; s += 1) {
    shares.forEach((legs, marker) => legs.forEach(([, ofAnkle], side) => {
      if (ofAnkle !== 1) return;
      const at = 3 * (shares.length * s + marker), k = 2 * (FRAMES - SEED + s) + side, [x, y] = ankleOf(pose, step, k);
      const [offX, offY] = turnedOff(yaws[k], markers[at] - x, markers[at + 1] - y);
      markers[at] += offX;
      markers[at + 1] += offY;
    }));
  }
}

/**
 * Moves the markers of the last frames with their legs.
 * @param {number[][][]} shares @param {LegPose} from @param {LegPose} to @param {Float32Array} markers
 */
function follow(shares, from, to, markers) {
  for (let s = 0; s < SEED; s += 1) {
    shares.forEach((legs, marker) => legs.forEach(([ofKnee, ofAnkle], side) => {
      if (!ofKnee && !ofAnkle) return;
      const at = 3 * (shares.length * s + marker), leg = 3 * (2 * (FRAMES - SEED + s) + side);
      for (let n = 0; n < 3; n += 1) {
        markers[at + n] += ofKnee * (to.knee[leg + n] - from.knee[leg + n]) + ofAnkle * (to.ankle[leg + n] - from.ankle[leg + n]);
      }
    }));
  }
}

/**
 * Radians that a foot turns from one frame to another, and metres between its heel and its balls in height.
 * @param {Float64Array} old @param {number} from @param {Float64Array} soles @param {number} to
 */
function swivelOf(old, from, soles, to) {
  const [a, b] = along(old, 3 * SOLES * from), now = 3 * SOLES * to, [x, y] = along(soles, now);
  return [Math.atan2(a * y - b * x, a * x + b * y), Math.abs(soles[now + 2] - (soles[now + 5] + soles[now + 8]) / 2)];
}

/** From the heel to between the balls. @param {Float64Array} soles @param {number} at */
const along = (soles, at) => [0, 1].map((n) => (soles[at + 3 + n] + soles[at + 6 + n]) / 2 - soles[at + n]);

/**
 * Movement [x, y] of a foot's bearing point from one frame to another, its height and place there; places are numbers of feet.
 * @param {Float64Array} old @param {number} from @param {Float64Array} soles @param {number} to
 */
function slide(old, from, soles, to) {
  const was = 3 * SOLES * from, now = 3 * SOLES * to;
  let height = Infinity;
  for (let p = 0; p < 3 * SOLES; p += 3) height = Math.min(height, soles[now + p + 2]);
  let x = 0, y = 0, loads = 0, atX = 0, atY = 0;
  for (let p = 0; p < 3 * SOLES; p += 3) {
    const load = Math.exp((height - soles[now + p + 2]) / SOFTNESS);
    loads += load;
    x += load * (soles[now + p] - old[was + p]);
    y += load * (soles[now + p + 1] - old[was + p + 1]);
    atX += load * soles[now + p];
    atY += load * soles[now + p + 1];
  }
  return [x / loads, y / loads, height, atX / loads, atY / loads];
}
