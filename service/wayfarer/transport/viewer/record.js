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

/** Films the stage. */
export class Film {
  constructor(canvas) {
    this.canvas = canvas;
    this.recorder = null;
  }

  get runs() {
    return this.recorder !== null;
  }

  /** Begin; or end, and save what has been filmed. */
  toggle() {
    if (this.runs) {
      this.recorder.stop();
      this.recorder = null;
      return;
    }
    const type = VIDEO_TYPES.find((known) => globalThis.MediaRecorder?.isTypeSupported(known));
    if (!type) throw new Error("This browser cannot record WebM video");
    const recorder = new MediaRecorder(this.canvas.captureStream(VIDEO_FPS), { mimeType: type });
    const pieces = [];
    recorder.ondataavailable = ({ data }) => data.size && pieces.push(data);
    recorder.onstop = () => {
      for (const track of recorder.stream.getTracks()) track.stop();
      save(new Blob(pieces, { type: "video/webm" }), "wayfarer.webm");
    };
    recorder.start(1000);
    this.recorder = recorder;
  }
}
