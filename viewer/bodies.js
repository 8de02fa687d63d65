// Bodies on the stage, many per mesh: a crowd of 200 is drawn in 7 calls, not in 200.

import {
  BufferAttribute, BufferGeometry, GLTFLoader, Group, MeshLambertMaterial, Skeleton, SkinnedMesh,
  Sphere,
} from "./vendor/three.min.js";
import { posedJoints, Rig, settle } from "./rig.js";

const ROOM = { vertices: 3072, corners: 12288 }; // that a body may have, or a multiple of it
const VERTICES = 65536; // of one mesh: 21 light bodies, or 3 fine ones
const DOUBLE_SIDE = 2; // three.js's number of it
const LOADING = 4; // bodies that are loaded at a time
const LOOK = new MeshLambertMaterial({ vertexColors: true, side: DOUBLE_SIDE }); // the inside of a sleeve is visible
const NOBODY = { // like the result of `bodyOf`: one triangle without size
  position: new Float32Array(9), normal: new Float32Array(9), color: new Uint8Array(12), index: new Uint32Array(3),
  skinIndex: new Uint16Array(12), skinWeight: new Float32Array(12), rig: { count: 1 },
};

/** All bodies. */
export class Bodies {
  constructor() {
    this.group = new Group();
    this.packs = [];
    this.waiting = [];
    this.loading = 0;
    const unseen = new Pack(NOBODY, 1); // so that the shader of bodies is ready before the first one comes
    unseen.add(NOBODY);
    this.group.add(unseen.mesh);
  }

  /**
   * Loads a body for one person, in one colour if `colour` is given: a promise of { pose(frame), hide(), height, rig, remove() }. `file()`:
   * URL of its GLB, and headers.
   */
  async load(file, boneNames, colour = null) {
    await this.#turn();
    try {
      const [url, headers] = file(); // when it is its turn: writing URLs for hundreds who come at once takes long
      const loader = new GLTFLoader().setRequestHeader(headers);
      const body = bodyOf((await loader.loadAsync(url)).scene, boneNames);
      if (colour) body.color = uniform(colour, body.position.length / 3);
      return this.#place(body);
    } finally {
      this.loading -= 1;
      this.waiting.shift()?.();
    }
  }

  async #turn() {
    while (this.loading >= LOADING) await new Promise((go) => this.waiting.push(go));
    this.loading += 1;
  }

  #place(body) {
    let pack = this.packs.find((found) => found.fits(body));
    if (!pack) {
      pack = new Pack(body);
      this.packs.push(pack);
      this.group.add(pack.mesh);
    }
    return pack.add(body);
  }
}

/**
 * Bodies of about one size in one mesh. Each has its own range of the vertices, of the corners of triangles and of the bones, so
 * that only a new body's ranges are written to the graphics card.
 */
class Pack {
  constructor(body, places = Math.max(1, Math.floor(VERTICES / roomOf(body).vertices))) {
    this.joints = body.rig.count;
    this.room = roomOf(body);
    this.bodies = new Array(places).fill(null);
    this.mesh = new SkinnedMesh(this.#geometry(), LOOK);
    this.mesh.castShadow = true;
    this.mesh.receiveShadow = true;
    this.mesh.frustumCulled = false; // its bodies are anywhere
    this.mesh.boundingSphere = new Sphere(); // not to be computed from bones that are not there
    this.skeleton = new Skeleton(new Array(this.bodies.length * this.joints).fill(null));
    this.skeleton.update = () => {}; // the matrices are written by `pose`, not read from a tree of bones
    this.skeleton.computeBoneTexture();
    this.skeleton.boneMatrices.fill(0); // a body without a pose yet is a point
    this.mesh.bind(this.skeleton, this.mesh.matrixWorld);
  }

  #geometry() {
    const vertices = this.bodies.length * this.room.vertices;
    const geometry = new BufferGeometry();
    const parts = {
      position: new Float32Array(3 * vertices), normal: new Float32Array(3 * vertices),
      color: new Uint8Array(4 * vertices), skinIndex: new Uint16Array(4 * vertices),
      skinWeight: new Float32Array(4 * vertices),
    };
    for (const [name, values] of Object.entries(parts)) {
      geometry.setAttribute(name, new BufferAttribute(values, values.length / vertices, name === "color"));
    }
    geometry.setIndex(new BufferAttribute(new Uint32Array(this.bodies.length * this.room.corners), 1));
    return geometry;
  }

  fits(body) {
    const { vertices, corners } = roomOf(body);
    const alike = vertices === this.room.vertices && corners === this.room.corners;
    return alike && body.rig.count === this.joints && this.bodies.includes(null);
  }

  add(body) {
    const slot = this.bodies.indexOf(null);
    const start = 16 * this.joints * slot;
    const { boneMatrices, boneTexture } = this.skeleton;
    const vanish = () => {
      boneMatrices.fill(0, start, start + 16 * this.joints);
      boneTexture.needsUpdate = true;
    };
    this.bodies[slot] = body;
    this.#write(body, slot);
    this.#draw();
    return {
      height: body.height,
      rig: body.rig,
      hide: vanish,
      pose: (frame) => {
        body.rig.matrices(frame, boneMatrices, start);
        boneTexture.needsUpdate = true;
      },
      remove: () => {
        vanish();
        this.bodies[slot] = null;
        this.#draw();
      },
    };
  }

  /** Writes a body to its ranges. */
  #write(body, slot) {
    const { attributes, index } = this.mesh.geometry;
    const first = this.room.vertices * slot;
    const written = (attribute, at, count) => {
      attribute.addUpdateRange(at, count);
      attribute.needsUpdate = true;
    };
    for (const [name, attribute] of Object.entries(attributes)) {
      const at = attribute.itemSize * first;
      attribute.array.set(body[name], at);
      written(attribute, at, body[name].length);
    }
    const bones = attributes.skinIndex.array;
    const end = 4 * first + body.skinIndex.length;
    for (let k = 4 * first; k < end; k += 1) bones[k] += this.joints * slot;
    const at = this.room.corners * slot;
    const count = body.index.length;
    for (let k = 0; k < count; k += 1) index.array[at + k] = body.index[k] + first;
    index.array.fill(first, at + count, at + this.room.corners); // triangles without size
    written(index, at, this.room.corners);
  }

  /** Draws up to the last body. */
  #draw() {
    const count = this.bodies.findLastIndex(Boolean) + 1;
    this.mesh.geometry.setDrawRange(0, this.room.corners * count);
    this.mesh.visible = count > 0;
  }
}

/** The room for a body: equal for bodies of about one size. */
function roomOf({ position, index }) {
  const upTo = (count, step) => step * Math.ceil(count / step);
  return { vertices: upTo(position.length / 3, ROOM.vertices), corners: upTo(index.length, ROOM.corners) };
}

/** The contents of a loaded GLB as plain arrays: all its parts as one, with their materials' colours. */
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
  const found = posedJoints(joints, boneNames);
  const skin = Object.fromEntries(["position", "normal", "skinIndex", "skinWeight"].map((name) => [name, merged(name)]));
  settle(skin, found);
  let first = 0;
  const index = parts.map(({ geometry }) => {
    const moved = new Uint32Array(geometry.index.array);
    for (let k = 0; k < moved.length; k += 1) moved[k] += first; // `from` with a function takes 30 times as long
    first += geometry.attributes.position.count;
    return moved;
  });
  return {
    rig: new Rig(found.posed, boneNames),
    height: heightOf(skin.position),
    color: joinedArrays(parts.map(colours)),
    index: joinedArrays(index), ...skin,
  };
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
  return uniform([r, g, b], geometry.attributes.position.count);
}

/** A colour [red, green, blue], 0 to 1, for each of some vertices. */
function uniform(colour, count) {
  const one = [...colour, 1].map((share) => Math.round(255 * share));
  const [together] = new Uint32Array(Uint8Array.from(one).buffer);
  return new Uint8Array(new Uint32Array(count).fill(together).buffer);
}
