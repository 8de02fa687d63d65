// Bodies on the stage, sixteen to a mesh: a crowd of 200 is drawn in 13 calls, not in 200.

import {
  BufferAttribute, BufferGeometry, GLTFLoader, Group, MeshLambertMaterial, Skeleton, SkinnedMesh,
  Sphere,
} from "./vendor/three.min.js";
import { Rig } from "./rig.js";

const TOGETHER = 16; // bodies in one mesh: with more, one that comes costs more to add
const LOADING = 4; // bodies asked for at a time
const JOIN_SECONDS = 0.25; // between two rebuilds of a mesh, when many come at once
const LOOK = new MeshLambertMaterial({ vertexColors: true });
const THICKNESS = { hair: 0.014, shirt: 0.012, trousers: 0.007 }; // metres that it stands off the skin, by the material's name
const NOBODY = { // as `bodyOf`: one triangle without size
  position: new Float32Array(9), normal: new Float32Array(9), color: new Uint8Array(12), index: new Uint32Array(3),
  skinIndex: new Uint16Array(12), skinWeight: new Float32Array(12),
};

/** All bodies. */
export class Bodies {
  constructor() {
    this.group = new Group();
    this.packs = [];
    this.waiting = [];
    this.loading = 0;
    const unseen = new Pack(1); // so that the shader of bodies is ready before the first one comes
    unseen.mesh.geometry = joined([NOBODY], 1);
    this.group.add(unseen.mesh);
  }

  /** Load a body for one person: a promise of { pose(frame), hide(), height, rig, remove() }. */
  async load(url, headers, boneNames) {
    await this.#turn();
    try {
      const loader = new GLTFLoader().setRequestHeader(headers);
      return this.#place(bodyOf((await loader.loadAsync(url)).scene, boneNames));
    } finally {
      this.loading -= 1;
      this.waiting.shift()?.();
    }
  }

  /** Before every picture; `now` in seconds. */
  update(now) {
    for (const pack of this.packs) pack.update(now);
  }

  async #turn() {
    while (this.loading >= LOADING) await new Promise((go) => this.waiting.push(go));
    this.loading += 1;
  }

  #place(body) {
    let pack = this.packs.find((found) => found.fits(body));
    if (!pack) {
      pack = new Pack(body.rig.count);
      this.packs.push(pack);
      this.group.add(pack.mesh);
    }
    return pack.add(body);
  }
}

/** Up to `TOGETHER` bodies in one mesh; each has its own stretch of the bones. */
class Pack {
  constructor(joints) {
    this.joints = joints;
    this.bodies = new Array(TOGETHER).fill(null);
    this.builtAt = -Infinity;
    this.changed = false;
    this.mesh = new SkinnedMesh(new BufferGeometry(), LOOK);
    this.mesh.castShadow = true;
    this.mesh.receiveShadow = true;
    this.mesh.frustumCulled = false; // its bodies are anywhere
    this.mesh.boundingSphere = new Sphere(); // not to be computed from bones that are not there
    this.skeleton = new Skeleton(new Array(TOGETHER * joints).fill(null));
    this.skeleton.update = () => {}; // the matrices are written by `pose`, not read from a tree of bones
    this.skeleton.computeBoneTexture();
    this.skeleton.boneMatrices.fill(0); // a body without a pose yet is a point
    this.mesh.bind(this.skeleton, this.mesh.matrixWorld);
  }

  fits(body) {
    return body.rig.count === this.joints && this.bodies.includes(null);
  }

  add(body) {
    const slot = this.bodies.indexOf(null);
    const start = 16 * this.joints * slot;
    const { boneMatrices, boneTexture } = this.skeleton;
    this.bodies[slot] = body;
    this.changed = true;
    return {
      height: body.height,
      rig: body.rig,
      hide: () => {
        boneMatrices.fill(0, start, start + 16 * this.joints);
        boneTexture.needsUpdate = true;
      },
      pose: (frame) => {
        body.rig.matrices(frame, boneMatrices, start);
        boneTexture.needsUpdate = true;
      },
      remove: () => {
        boneMatrices.fill(0, start, start + 16 * this.joints);
        boneTexture.needsUpdate = true;
        this.bodies[slot] = null;
        this.changed = true;
      },
    };
  }

  update(now) {
    if (!this.changed || now - this.builtAt < JOIN_SECONDS) return;
    this.changed = false;
    this.builtAt = now;
    this.mesh.geometry.dispose();
    this.mesh.geometry = joined(this.bodies, this.joints);
    this.mesh.visible = this.bodies.some(Boolean);
  }
}

/** One geometry of several; each body's bones come after those of the slots before it. */
function joined(bodies, joints) {
  const present = bodies.map((body, slot) => ({ body, slot })).filter(({ body }) => body);
  const sum = (count) => present.reduce((total, { body }) => total + count(body), 0);
  const vertices = sum(({ position }) => position.length / 3);
  const parts = {
    position: new Float32Array(3 * vertices), normal: new Float32Array(3 * vertices),
    color: new Uint8Array(4 * vertices), skinIndex: new Uint16Array(4 * vertices),
    skinWeight: new Float32Array(4 * vertices),
  };
  const index = new Uint32Array(sum((body) => body.index.length));
  let vertex = 0;
  let corner = 0;
  for (const { body, slot } of present) {
    for (const name of ["position", "normal"]) parts[name].set(body[name], 3 * vertex);
    for (const name of ["color", "skinWeight"]) parts[name].set(body[name], 4 * vertex);
    body.skinIndex.forEach((joint, k) => {
      parts.skinIndex[4 * vertex + k] = joint + joints * slot;
    });
    body.index.forEach((number, k) => {
      index[corner + k] = number + vertex;
    });
    vertex += body.position.length / 3;
    corner += body.index.length;
  }
  const geometry = new BufferGeometry();
  for (const [name, values] of Object.entries(parts)) {
    const size = values.length / Math.max(1, vertices);
    geometry.setAttribute(name, new BufferAttribute(values, size || 3, name === "color"));
  }
  geometry.setIndex(new BufferAttribute(index, 1));
  return geometry;
}

/** What a loaded GLB holds, as plain arrays: all its parts as one, with their materials' colours. */
function bodyOf(scene, boneNames) {
  const parts = [];
  scene.traverse((node) => {
    if (node.isSkinnedMesh) parts.push(node);
  });
  if (!parts.length) throw new Error("the file holds no skinned mesh");
  const { bones, boneInverses } = parts[0].skeleton;
  const joints = bones.map((bone, joint) => ({
    name: bone.name,
    parent: bones.indexOf(bone.parent),
    offset: bone.position.toArray(),
    inverse: boneInverses[joint].elements,
  }));
  const merged = (name) => joinedArrays(parts.map(({ geometry }) => geometry.attributes[name].array));
  const position = merged("position");
  let first = 0;
  const index = parts.map(({ geometry }) => {
    const moved = Uint32Array.from(geometry.index.array, (number) => number + first);
    first += geometry.attributes.position.count;
    return moved;
  });
  return {
    rig: new Rig(joints, boneNames),
    height: heightOf(position),
    position: thickened(position, parts), normal: merged("normal"), color: joinedArrays(parts.map(colours)),
    index: joinedArrays(index), skinIndex: merged("skinIndex"), skinWeight: merged("skinWeight"),
  };
}

/** Clothes and hair stand off the skin: hems have an edge. */
function thickened(position, parts) {
  const moved = position.slice();
  let at = 0;
  for (const { geometry: { attributes: { normal } }, material } of parts) {
    const off = THICKNESS[material.name] ?? 0;
    for (let k = 0; k < 3 * normal.count; k += 1) moved[at + k] += off * normal.array[k];
    at += 3 * normal.count;
  }
  return moved;
}

/** Several arrays of one type as one. */
function joinedArrays(arrays) {
  const all = new arrays[0].constructor(arrays.reduce((sum, { length }) => sum + length, 0));
  let at = 0;
  for (const values of arrays) {
    all.set(values, at);
    at += values.length;
  }
  return all;
}

/** Metres from the lowest to the highest of places x, y, z. */
function heightOf(places) {
  let low = Infinity;
  let high = -Infinity;
  for (let k = 1; k < places.length; k += 3) {
    low = Math.min(low, places[k]);
    high = Math.max(high, places[k]);
  }
  return high - low;
}

/** The colour of a part's material for each of its vertices: red, green, blue, opacity, 0 to 255. */
function colours({ material, geometry }) {
  const { r, g, b } = material.color;
  const one = [r, g, b, 1].map((share) => Math.round(255 * share));
  const bytes = new Uint8Array(4 * geometry.attributes.position.count);
  for (let k = 0; k < bytes.length; k += 4) bytes.set(one, k);
  return bytes;
}
