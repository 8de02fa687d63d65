// The picture as a file: people's motion as GLB or VRM animation, the picture as WebM.

import { vrmAnimation, withMotion } from "./animated_glb.js";
import { FRAME } from "./timeline.js";

const VIDEO_FPS = 30;
const VIDEO_TYPES = ["video/webm;codecs=vp9", "video/webm;codecs=vp8", "video/webm"];

/** Offers bytes to the user as a file. */
function save(blob, name) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 60_000);
}

/**
 * Saves the motion of people in a span of time: as "glb" on their bodies, as "vrma" the motion of one. `mesh(agent, detail)` returns
 * [URL of the body, headers]. `boneNames` names the bones of the frames. Throws if nobody was there, or there is no body.
 */
export async function saveMotion(kind, people, history, from, to, mesh, boneNames) {
  const moved = people.map(({ agent, played }) => ({ agent, name: agent.name || "person", ...motionOf(agent, played, history, from, to) }));
  const seen = moved.filter(({ moments }) => moments.length > 1);
  if (!seen.length) throw new Error(`There is no motion of ${people.length > 1 ? "these people" : moved[0].name} at that time`);
  const start = Math.min(...seen.map(({ moments: [first] }) => first));
  const actors = await Promise.all(seen.map(async ({ agent, name, moments, frames }) => (
    { name, glb: await bodyOf(mesh(agent, "high")), times: moments.map((moment) => moment - start), frames }
  )));
  const title = seen.length > 1 ? `${seen.length} people` : seen[0].name;
  const file = kind === "vrma" ? vrmAnimation(actors[0], boneNames, title) : withMotion(actors, boneNames, title);
  save(new Blob([file], { type: "model/gltf-binary" }), `${title.replace(/[^\w-]+/g, "_")}.${kind}`);
}

/** A person's moments and frames, as far as they are known. */
function motionOf(agent, played, history, from, to) {
  const width = played.frame.length;
  const frame = new Float32Array(width);
  const moments = [], kept = [];
  for (let moment = Math.max(from, history.first); moment <= to + 1e-6; moment += FRAME) {
    if (!history.sample(agent.alias, moment, frame)) continue;
    moments.push(moment);
    kept.push(...frame);
  }
  return { moments, frames: Float32Array.from(kept) };
}

async function bodyOf([url, headers]) {
  const answer = await fetch(url, { headers });
  if (!answer.ok) throw new Error(`the body cannot be had: HTTP ${answer.status}`);
  return answer.arrayBuffer();
}

/** Films the stage. `filmed(seconds)` is called for each second of the film. */
export class Film {
  constructor(canvas, filmed) {
    Object.assign(this, { canvas, filmed });
    this.recorder = null;
  }

  get runs() {
    return this.recorder !== null;
  }

  begin() {
    const type = VIDEO_TYPES.find((known) => globalThis.MediaRecorder?.isTypeSupported(known));
    if (!type) throw new Error("This browser cannot record WebM video");
    const recorder = new MediaRecorder(this.canvas.captureStream(VIDEO_FPS), { mimeType: type });
    this.pieces = [];
    this.begun = performance.now();
    recorder.ondataavailable = ({ data }) => {
      if (!data.size) return;
      this.pieces.push(data);
      if (recorder === this.recorder) this.filmed(Math.round((performance.now() - this.begun) / 1000));
    };
    recorder.start(1000);
    this.recorder = recorder;
  }

  /** Ends the film and saves it. Rejects if it is empty. */
  async end() {
    const { recorder, pieces } = this;
    this.recorder = null;
    const stopped = new Promise((done) => recorder.addEventListener("stop", done));
    recorder.stop();
    await stopped;
    for (const track of recorder.stream.getTracks()) track.stop();
    if (!pieces.length) throw new Error("Nothing was filmed: no picture was drawn in that time");
    save(new Blob(pieces, { type: "video/webm" }), "wayfarer.webm");
  }
}
