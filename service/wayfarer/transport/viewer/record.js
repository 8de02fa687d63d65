// What is shown, as a file: a person's motion as GLB, the picture as WebM.

import { withMotion } from "./animated_glb.js";
import { FRAME } from "./timeline.js";

const VIDEO_FPS = 30;
const VIDEO_TYPES = ["video/webm;codecs=vp9", "video/webm;codecs=vp8", "video/webm"];

/** Let the user save bytes under a name. */
function save(blob, name) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 60_000);
}

/**
 * Save the motion of a person from one moment to another, on its body. `mesh(agent, detail)`: [URL of the body, headers];
 * `boneNames`: whose rotations the frames hold. Throws when there is no motion then, or no body.
 */
export async function saveMotion(person, history, from, to, mesh, boneNames) {
  const { agent, played } = person;
  const width = played.frame.length;
  const frame = new Float32Array(width);
  const times = [];
  const frames = [];
  for (let moment = Math.max(from, history.first); moment <= to + 1e-6; moment += FRAME) {
    if (!history.sample(agent.alias, moment, frame)) continue;
    times.push(times.length * FRAME);
    frames.push(frame.slice());
  }
  if (times.length < 2) throw new Error(`There is no motion of ${agent.name || "this person"} at that time`);
  const all = new Float32Array(width * frames.length);
  frames.forEach((one, k) => all.set(one, width * k));
  const [url, headers] = mesh(agent, "high");
  const answer = await fetch(url, { headers });
  if (!answer.ok) throw new Error(`the body cannot be had: HTTP ${answer.status}`);
  const glb = withMotion(await answer.arrayBuffer(), boneNames, times, all, agent.name || "motion");
  const plain = (agent.name || "person").replace(/[^\w-]+/g, "_");
  save(new Blob([glb], { type: "model/gltf-binary" }), `${plain}.glb`);
}

/** Films the stage. `filmed(seconds)` is called each second that there is something of. */
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

  /** End, and save what has been filmed. Rejects when there is nothing of it. */
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
