// Bodies on the stage, many per mesh: a crowd of 300 is drawn in 6 calls, not in 300.

import {
  BufferAttribute, BufferGeometry, Group, MeshLambertMaterial, Skeleton, SkinnedMesh, Sphere,
} from "./vendor/three.min.js";
import { binaryOf, readGlb } from "./glb.js";
import { posedJoints, Rig, settle } from "./rig.js";

const UNIT = { vertices: 512, corners: 2688 }; // whole triangles; a body takes some units of a pack, in a row
const UNITS = [128, 512]; // of the first pack: 25 light bodies, or 4 fine ones; most of one
const BONED = 64; // bodies for whose bones room is made at a time
const MOST_BONES = 65536; // numbers of bones that a vertex can have
const KINDS = { 5121: Uint8Array, 5123: Uint16Array, 5125: Uint32Array, 5126: Float32Array }; // of numbers in a GLB
const WIDTHS = { SCALAR: 1, VEC3: 3, VEC4: 4, MAT4: 16 };
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
    this.bones = [];
    this.waiting = [];
    this.loading = 0;
    this.unseen = new Pack(1, new Bones(1)); // so that the shader of bodies is ready before the first one comes
    this.unseen.add(NOBODY);
    this.group.add(this.unseen.mesh);
  }

  /**
   * Loads a body for one person, in one colour if `colour` is given: a promise of { pose(frame), hide(), height, rig, remove() }. `file()`:
   * URL of its GLB, and headers.
   */
  async load(file, boneNames, colour = null) {
    await this.#turn();
    try {
      const [url, headers] = file(); // when it is its turn: writing URLs for hundreds who come at once takes long
      const answer = await fetch(url, { headers });
      if (!answer.ok) throw new Error(`HTTP ${answer.status}`);
      const body = bodyOf(await answer.arrayBuffer(), boneNames);
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
    for (const pack of this.packs) {
      const placed = pack.add(body);
      if (placed) return placed;
    }
    let bones = this.bones.find((found) => found.fits(body.rig));
    if (!bones) this.bones.push(bones = new Bones(body.rig.count));
    const all = this.packs.reduce((sum, { taken }) => sum + taken.length, 0);
    const [first, most] = UNITS;
    const pack = new Pack(Math.max(unitsOf(body), first, Math.min(2 * all, most)), bones); // few people need little memory
    this.packs.push(pack);
    this.group.remove(this.unseen.mesh);
    this.group.add(pack.mesh);
    return pack.add(body);
  }
}

/** The matrices of all bodies' bones: one texture, sent to the graphics card once per picture. */
class Bones {
  /** `joints`: of each rig. */
  constructor(joints) {
    this.joints = joints;
    this.taken = []; // whether a rig has this place
    this.skeleton = new Skeleton();
    this.skeleton.update = () => {}; // the matrices are written by `pose`, not read from a tree of bones
    this.#room();
  }

  fits({ count }) {
    return count === this.joints && (this.taken.includes(false) || count * (this.taken.length + 1) <= MOST_BONES);
  }

  /** Makes room for more rigs. Each rig keeps its place. */
  #room() {
    this.skeleton.boneTexture?.dispose();
    this.skeleton.bones.length += BONED * this.joints;
    this.skeleton.computeBoneTexture();
  }

  /** Adds a rig, without a pose: { first: number of its first bone, pose(frame), hide(), remove() }. */
  add(rig) {
    const { skeleton, taken, joints } = this;
    const place = taken.includes(false) ? taken.indexOf(false) : taken.length;
    const first = joints * place;
    if (first + joints > skeleton.bones.length) this.#room();
    taken[place] = true;
    const hide = () => {
      skeleton.boneMatrices.fill(0, 16 * first, 16 * (first + joints)); // all of it is a point
      skeleton.boneTexture.needsUpdate = true;
    };
    return {
      first,
      hide,
      pose: (frame) => {
        rig.matrices(frame, skeleton.boneMatrices, 16 * first);
        skeleton.boneTexture.needsUpdate = true;
      },
      remove: () => {
        hide();
        taken[place] = false;
      },
    };
  }
}

/** Bodies in one mesh. Each has its own range of vertices and corners of triangles, so that only a new body's is sent to the card. */
class Pack {
  /** `units`: its size. */
  constructor(units, bones) {
    this.bones = bones;
    this.taken = new Array(units).fill(false); // whether a body has this unit
    this.mesh = new SkinnedMesh(this.#geometry(), LOOK);
    this.mesh.castShadow = true;
    this.mesh.receiveShadow = true;
    this.mesh.frustumCulled = false; // its bodies are anywhere
    this.mesh.boundingSphere = new Sphere(); // not to be computed from bones that are not there
    this.mesh.bind(bones.skeleton, this.mesh.matrixWorld);
  }

  #geometry() {
    const vertices = this.taken.length * UNIT.vertices;
    const geometry = new BufferGeometry();
    const parts = {
      position: new Float32Array(3 * vertices), normal: new Float32Array(3 * vertices),
      color: new Uint8Array(4 * vertices), skinIndex: new Uint16Array(4 * vertices),
      skinWeight: new Float32Array(4 * vertices),
    };
    for (const [name, values] of Object.entries(parts)) {
      geometry.setAttribute(name, new BufferAttribute(values, values.length / vertices, name === "color"));
    }
    geometry.setIndex(new BufferAttribute(new Uint32Array(this.taken.length * UNIT.corners), 1));
    return geometry;
  }

  /** Returns null if there is no room for it. */
  add(body) {
    const { height, rig } = body;
    const count = unitsOf(body);
    const unit = this.bones.fits(rig) ? this.#free(count) : -1;
    if (unit < 0) return null;
    const { first, pose, hide, remove } = this.bones.add(rig);
    this.taken.fill(true, unit, unit + count);
    this.#write(body, first, unit);
    this.#draw();
    return {
      height, rig, pose, hide,
      remove: () => {
        remove();
        this.taken.fill(false, unit, unit + count);
        this.#erase(unit, count);
        this.#draw();
      },
    };
  }

  /** The first of some free units in a row; -1 if there are none. */
  #free(count) {
    let first = 0;
    for (let unit = 0; unit < this.taken.length; unit += 1) {
      if (this.taken[unit]) first = unit + 1;
      else if (unit - first + 1 === count) return first;
    }
    return -1;
  }

  /** Writes a body to its range. `bone`: its first one. */
  #write(body, bone, unit) {
    const { attributes, index } = this.mesh.geometry;
    const first = UNIT.vertices * unit;
    for (const [name, attribute] of Object.entries(attributes)) {
      const at = attribute.itemSize * first;
      attribute.array.set(body[name], at);
      written(attribute, at, body[name].length);
    }
    const bones = attributes.skinIndex.array;
    const end = 4 * first + body.skinIndex.length;
    for (let k = 4 * first; k < end; k += 1) bones[k] += bone;
    const at = UNIT.corners * unit;
    for (let k = 0; k < body.index.length; k += 1) index.array[at + k] = body.index[k] + first;
    written(index, at, body.index.length);
  }

  /** Leaves triangles without size: the bones will be another body's. */
  #erase(unit, count) {
    const { index } = this.mesh.geometry;
    index.array.fill(0, UNIT.corners * unit, UNIT.corners * (unit + count));
    written(index, UNIT.corners * unit, UNIT.corners * count);
  }

  /** Draws up to the last body. */
  #draw() {
    const count = this.taken.lastIndexOf(true) + 1;
    this.mesh.geometry.setDrawRange(0, UNIT.corners * count);
    this.mesh.visible = count > 0;
  }
}

/** Sends some numbers of a buffer to the graphics card with the next picture. */
function written(attribute, at, count) {
  attribute.addUpdateRange(at, count);
  attribute.needsUpdate = true;
}

/** Units that a body needs. */
function unitsOf({ position, index }) {
  return Math.ceil(Math.max(position.length / 3 / UNIT.vertices, index.length / UNIT.corners));
}

/**
 * The contents of a body's GLB as plain arrays: all its parts as one, with their materials' colours. The server writes it, with one
 * skin and tight accessors, so this takes a part of GLTFLoader's time.
 */
function bodyOf(bytes, boneNames) {
  const document = readGlb(bytes);
  if (!document?.skins?.length) throw new Error("the file holds no skin");
  const { nodes, skins: [skin], meshes, materials = [], accessors, bufferViews } = document;
  const binary = binaryOf(bytes);
  const numbers = (accessor) => {
    const { bufferView, byteOffset = 0, componentType, count, type } = accessors[accessor];
    const at = binary.byteOffset + (bufferViews[bufferView].byteOffset ?? 0) + byteOffset;
    return new KINDS[componentType](bytes, at, WIDTHS[type] * count);
  };
  const inverses = numbers(skin.inverseBindMatrices);
  const joints = skin.joints.map((node, joint) => ({
    name: nodes[node].name,
    parent: skin.joints.findIndex((other) => nodes[other].children?.includes(node)),
    offset: nodes[node].translation ?? [0, 0, 0],
    inverse: inverses.subarray(16 * joint, 16 * joint + 16),
  }));
  const parts = meshes.flatMap(({ primitives }) => primitives.map(({ attributes, indices, material }) => ({
    position: numbers(attributes.POSITION), normal: numbers(attributes.NORMAL),
    skinIndex: numbers(attributes.JOINTS_0), skinWeight: numbers(attributes.WEIGHTS_0),
    index: new Uint32Array(numbers(indices)), colour: materials[material]?.pbrMetallicRoughness?.baseColorFactor ?? [1, 1, 1],
  })));
  let first = 0;
  for (const { position, index } of parts) {
    for (let k = 0; k < index.length; k += 1) index[k] += first;
    first += position.length / 3;
  }
  const merged = (name) => joinedArrays(parts.map((part) => part[name]));
  const found = posedJoints(joints, boneNames);
  const clothed = { position: merged("position"), normal: merged("normal"), skinIndex: merged("skinIndex"), skinWeight: merged("skinWeight") };
  settle(clothed, found);
  return {
    rig: new Rig(found.posed, boneNames),
    height: heightOf(clothed.position),
    color: joinedArrays(parts.map(({ colour, position }) => uniform(colour, position.length / 3))),
    index: merged("index"), ...clothed,
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

/** A colour [red, green, blue], 0 to 1, for each of some vertices. */
function uniform(colour, count) {
  const one = [...colour.slice(0, 3), 1].map((share) => Math.round(255 * share));
  const [together] = new Uint32Array(Uint8Array.from(one).buffer);
  return new Uint8Array(new Uint32Array(count).fill(together).buffer);
}
