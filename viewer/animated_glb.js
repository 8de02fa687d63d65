// Bodies' GLBs with motion in them, as one GLB or as a VRM animation. Bytes and numbers in, bytes out; no DOM, no three.js.

import { WORDS } from "./client/core/bone_names.js";
import { binaryOf, readGlb } from "./glb.js";

const JSON_CHUNK = 0x4e4f534a, BINARY_CHUNK = 0x004e4942, MAGIC = 0x46546c67;
const FLOAT = 5126;
const VRMA = "VRMC_vrm_animation";
const HUMANOID = { ...WORDS.vrm, ...Object.fromEntries(WORDS.vrm.spine.map((name, k) => [`spine${k + 1}`, name])) };

/**
 * A file of several people, each below a node of its name, with one animation. Each is { name, glb, times, frames }: its body,
 * `times` [T] in seconds, and `frames` [T × width] as the stream has them (hips x, y, z, then x, y, z, w of each of
 * `boneNames`). Throws when a body has not these bones.
 */
export function withMotion(people, boneNames, name = "motion") {
  const file = new Assembly();
  const top = [];
  const about = [];
  for (const person of people) {
    const { document, binary } = parts(person.glb);
    const node = file.take(document, binary);
    const joints = new Set(document.skins[0].joints.map(node));
    const [root] = document.skins[0].joints;
    file.animate(joints, boneNames, person.times, person.frames);
    file.document.nodes.push({ name: person.name, children: [node(root)] });
    top.push(file.document.nodes.length - 1);
    for (const other of document.scenes[0].nodes) if (other !== root) top.push(node(other)); // meshes lie beside their bones
    about.push({ ...document.extras, name: person.name });
  }
  file.document.scenes = [{ nodes: top }];
  file.document.extras = { people: about };
  return file.finish(name);
}

/** A VRM animation (VRMC_vrm_animation 1.0) of one person as in `withMotion`: its bones and their motion, without a body. */
export function vrmAnimation({ glb, times, frames }, boneNames, name = "motion") {
  const file = new Assembly();
  const { document } = parts(glb);
  const { joints } = document.skins[0];
  const places = new Map(joints.map((joint, k) => [joint, k]));
  file.document.nodes = joints.map((joint) => {
    const { name: bone, translation, children = [] } = document.nodes[joint];
    const kept = children.filter((child) => places.has(child)).map((child) => places.get(child));
    return { name: bone, translation, ...(kept.length && { children: kept }) };
  });
  const { nodes } = file.document;
  file.animate(new Set(nodes.keys()), boneNames, times, frames);
  const humanBones = Object.fromEntries(nodes.flatMap(({ name: bone }, node) => (
    boneNames.includes(bone) && HUMANOID[bone] ? [[HUMANOID[bone], { node }]] : []
  )));
  for (const node of nodes) node.name = HUMANOID[node.name] ?? node.name;
  file.document.scenes = [{ nodes: [0] }];
  file.document.extensionsUsed = [VRMA];
  file.document.extensions = { [VRMA]: { specVersion: "1.0", humanoid: { humanBones } } };
  return file.finish(name);
}

/** A glTF under construction. */
class Assembly {
  constructor() {
    this.document = {
      asset: { version: "2.0", generator: "wayfarer" }, scene: 0, nodes: [], bufferViews: [], accessors: [], meshes: [], skins: [], materials: [],
    };
    this.pieces = [];
    this.length = 0;
    this.samplers = [];
    this.channels = [];
  }

  /** Adds everything in a document except its scene. Returns a function from its node numbers to those of this file. */
  take({ bufferViews, accessors, meshes, skins, materials = [], nodes }, binary) {
    const { document } = this;
    const counts = Object.fromEntries(["bufferViews", "accessors", "meshes", "skins", "materials", "nodes"].map((kind) => [kind, document[kind].length]));
    const moved = (kind) => (number) => number + counts[kind];
    const view = moved("bufferViews"), accessor = moved("accessors"), node = moved("nodes");
    document.bufferViews.push(...bufferViews.map((one) => ({ ...one, byteOffset: (one.byteOffset ?? 0) + this.length })));
    document.accessors.push(...accessors.map((one) => ({ ...one, bufferView: view(one.bufferView) })));
    document.materials.push(...materials);
    document.meshes.push(...meshes.map((mesh) => ({
      ...mesh,
      primitives: mesh.primitives.map((primitive) => ({
        ...primitive,
        attributes: Object.fromEntries(Object.entries(primitive.attributes).map(([name, number]) => [name, accessor(number)])),
        ...("indices" in primitive && { indices: accessor(primitive.indices) }),
        ...("material" in primitive && { material: moved("materials")(primitive.material) }),
      })),
    })));
    document.skins.push(...skins.map((skin) => ({
      ...skin, joints: skin.joints.map(node), inverseBindMatrices: accessor(skin.inverseBindMatrices),
      ...("skeleton" in skin && { skeleton: node(skin.skeleton) }),
    })));
    document.nodes.push(...nodes.map((one) => ({
      ...one,
      ...(one.children && { children: one.children.map(node) }),
      ...("mesh" in one && { mesh: moved("meshes")(one.mesh) }),
      ...("skin" in one && { skin: moved("skins")(one.skin) }),
    })));
    this.#append(binary);
    return node;
  }

  /** Channels of the nodes with the bones' names, among `joints`. */
  animate(joints, boneNames, times, frames) {
    const width = 3 + 4 * boneNames.length;
    const count = times.length;
    const input = this.#accessor(Float32Array.from(times), "SCALAR", { min: [Math.fround(times[0])], max: [Math.fround(times[count - 1])] });
    const animate = (node, path, output) => {
      this.samplers.push({ input, output, interpolation: "LINEAR" });
      this.channels.push({ sampler: this.samplers.length - 1, target: { node, path } });
    };
    const { nodes } = this.document;
    const nodeOf = new Map([...joints].map((number) => [nodes[number].name, number]));
    boneNames.forEach((bone, k) => {
      const node = nodeOf.get(bone);
      if (node === undefined) throw new Error(`the body has no bone ${bone}`);
      delete nodes[node].matrix; // a node with channels has none
      if (k === 0) animate(node, "translation", this.#accessor(column(frames, width, 0, 3, count), "VEC3"));
      animate(node, "rotation", this.#accessor(unbroken(column(frames, width, 3 + 4 * k, 4, count)), "VEC4"));
    });
  }

  /** The file's bytes. */
  finish(name) {
    const { document, samplers, channels } = this;
    document.animations = [{ name, samplers, channels }];
    document.buffers = [{ byteLength: this.length }];
    for (const [kind, all] of Object.entries(document)) if (Array.isArray(all) && !all.length) delete document[kind]; // an empty list is not allowed
    return joined(document, this.pieces, this.length);
  }

  #append(bytes) {
    const padded = new Uint8Array(4 * Math.ceil(bytes.length / 4));
    padded.set(bytes);
    this.pieces.push(padded);
    this.length += padded.length;
  }

  #accessor(values, type, extent = {}) {
    const { bufferViews, accessors } = this.document;
    bufferViews.push({ buffer: 0, byteOffset: this.length, byteLength: values.byteLength });
    this.#append(new Uint8Array(values.buffer, values.byteOffset, values.byteLength));
    const size = { SCALAR: 1, VEC3: 3, VEC4: 4 }[type];
    accessors.push({ bufferView: bufferViews.length - 1, componentType: FLOAT, count: values.length / size, type, ...extent });
    return accessors.length - 1;
  }
}

function column(frames, width, first, size, count) {
  const values = new Float32Array(count * size);
  for (let k = 0; k < count; k += 1) values.set(frames.subarray(width * k + first, width * k + first + size), size * k);
  return values;
}

/** Quaternions of which none is more than half a turn from the one before: q and -q are the same turn. */
function unbroken(turns) {
  for (let k = 4; k < turns.length; k += 4) {
    const dot = turns[k] * turns[k - 4] + turns[k + 1] * turns[k - 3] + turns[k + 2] * turns[k - 2] + turns[k + 3] * turns[k - 1];
    if (dot < 0) for (let n = k; n < k + 4; n += 1) turns[n] = -turns[n];
  }
  return turns;
}

function parts(glb) {
  const document = readGlb(glb);
  if (!document) throw new Error("this is no GLB file");
  return { document, binary: binaryOf(glb) };
}

function joined(document, pieces, length) {
  const text = new TextEncoder().encode(JSON.stringify(document));
  const textRoom = 4 * Math.ceil(text.length / 4), room = 4 * Math.ceil(length / 4);
  const glb = new Uint8Array(12 + 8 + textRoom + 8 + room);
  const view = new DataView(glb.buffer);
  [MAGIC, 2, glb.length, textRoom, JSON_CHUNK].forEach((value, k) => view.setUint32(4 * k, value, true));
  glb.fill(0x20, 20, 20 + textRoom);
  glb.set(text, 20);
  view.setUint32(20 + textRoom, room, true);
  view.setUint32(24 + textRoom, BINARY_CHUNK, true);
  let at = 28 + textRoom;
  for (const piece of pieces) {
    glb.set(piece, at);
    at += piece.length;
  }
  return glb.buffer;
}
