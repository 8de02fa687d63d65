// The user's character: a VRM or GLB file. It is read on this page and sent nowhere.

import { Box3, Vector3, cloneSkinned } from "./vendor/three.min.js";
import { BASES, BoneMapError, Character, mapBones, measureSoles, readRig } from "./client/index.js";
import { THREE_NODES } from "./client/three.js";
import { readGlb } from "./glb.js";
import { loadGlb } from "./packed.js";

const SIZES = [0.4, 4]; // metres: a character outside of this range has another unit
const PERSON = 1.7; // metres

/** Whether a file's bytes are a character: it has a skin, or says that it is an avatar. */
export function isCharacter(bytes) {
  const json = readGlb(bytes);
  return Boolean(json?.skins?.length || json?.extensions?.VRM || json?.extensions?.VRMC_vrm);
}

/** A file that is a character, with the map of its bones. */
export class CharacterFile {
  /** Reads a file's bytes. Throws, in words for the user, if they hold no such character. */
  static async read(bytes, name) {
    const json = readGlb(bytes);
    if (!json) throw new Error(`${name} is no GLB or VRM file: it does not begin as one`);
    if (!json.skins?.length) throw new Error(`${name} has no skeleton: a character needs a skin with bones`);
    const gltf = await loadGlb(bytes);
    return new CharacterFile(gltf, humanoidOf(json), name, sumOf(bytes));
  }

  /** `humanoid`: VRM's names → numbers of the file's nodes; `key`: of the file's content. */
  constructor({ scene, parser }, humanoid, name, key) {
    this.name = name;
    this.title = name.replace(/\.[^.]*$/, "").slice(0, 64);
    this.key = `wayfarer.bones.${key}`;
    this.source = scene;
    this.rescaled = 1;
    this.#normalise();
    const all = nodesOf(scene);
    const objects = new Map([...parser.associations].flatMap(([object, from]) => (all.includes(object) ? [[from?.nodes, object]] : [])));
    this.humanoid = new Map([...humanoid].flatMap(([bone, number]) => (objects.has(number) ? [[bone, all.indexOf(objects.get(number))]] : [])));
    this.correct = JSON.parse(localStorage.getItem(this.key) ?? "{}");
    this.#look();
    if (!this.problem || !Object.keys(this.correct).length) return;
    this.correct = {}; // stored before the present rules, and of no use with them
    this.#look();
  }

  /** Names of the nodes that can be chosen. */
  get nodeNames() {
    return this.rig.nodes.map(({ name }) => name).filter(Boolean);
  }

  /** Name of the node of a bone, or "". */
  nodeOf(bone) {
    const node = this.bones.get(bone);
    return node === undefined ? "" : this.rig.nodes[node].name;
  }

  /** Assigns this node to a bone (null: none). An invalid map leaves its fault in `problem`; a valid one is kept. */
  choose(bone, node) {
    this.correct = { ...this.correct, [bone]: node };
    this.#look();
    if (!this.problem) localStorage.setItem(this.key, JSON.stringify(this.correct));
  }

  /** Forgets the choices. */
  reset() {
    this.correct = {};
    localStorage.removeItem(this.key);
    this.#look();
  }

  /** Places of its joints at rest: [{ bone, position }], for a body of its proportions. */
  get joints() {
    return [...this.bones].map(([bone, node]) => {
      const [x, y, z] = this.rig.place(node);
      return { bone, position: { x, y, z } };
    });
  }

  /** Makes a separate body for an agent: { object, character, height, pose(frame), hide(), remove() }. */
  body(restOffsets) {
    const object = cloneSkinned(this.source);
    const humanoid = this.#humanoidOf(object);
    const character = new Character(THREE_NODES, [object], restOffsets, { correct: this.correct }, humanoid);
    return {
      object, character, height: this.height,
      pose: (frame) => character.pose(frame),
      hide: () => {}, // its parent object is hidden
      remove: () => object.removeFromParent(),
    };
  }

  /** Frees its memory on the graphics card. */
  dispose() {
    this.source.traverse((node) => {
      node.geometry?.dispose();
      for (const material of [node.material ?? []].flat()) {
        for (const value of Object.values(material)) if (value?.isTexture) value.dispose();
        material.dispose();
      }
    });
  }

  /** Sets shadows; scales a file in centimetres or decimetres to metres. */
  #normalise() {
    this.source.traverse((node) => {
      if (!node.isMesh) return;
      node.castShadow = node.receiveShadow = true;
      node.frustumCulled = false; // its bounds are those at rest
    });
    this.source.updateMatrixWorld(true);
    const high = heightOf(this.source);
    if (high < SIZES[0] || high > SIZES[1]) {
      this.rescaled = 10 ** Math.round(Math.log10(PERSON / high));
      this.source.scale.multiplyScalar(this.rescaled);
      this.source.updateMatrixWorld(true);
    }
    this.height = heightOf(this.source);
  }

  /** VRM's bones in the source, or in a copy of it. */
  #humanoidOf(scene) {
    const nodes = nodesOf(scene);
    return new Map([...this.humanoid].map(([bone, number]) => [bone, nodes[number]]));
  }

  /** Finds the map: `rig`, `bones`, `foundBy`, `floor`, or the `problem` with it. */
  #look() {
    const { rig, nodes, table } = readRig(THREE_NODES, [this.source], this.#humanoidOf(this.source));
    this.rig = rig;
    this.problem = "";
    try {
      const map = mapBones(rig, table, BASES.gltf, this.correct);
      const mesh = THREE_NODES.mesh([this.source], nodes);
      this.bones = map.bones;
      this.floor = measureSoles(map, mesh.places, mesh.nodes)?.floor;
      this.foundBy = map.foundBy;
    } catch (error) {
      if (!(error instanceof BoneMapError)) throw error;
      this.bones = error.bones;
      this.problem = error.message;
    }
  }
}

/** All nodes, in an order that a copy has, too. */
function nodesOf(scene) {
  const found = [];
  scene.traverse((node) => found.push(node));
  return found;
}

function heightOf(scene) {
  return new Box3().setFromObject(scene, true).getSize(new Vector3()).y;
}

/** VRM's names of bones → numbers of nodes, of VRM 0 and 1. */
function humanoidOf({ extensions = {} }) {
  const { VRMC_vrm: one, VRM: zero } = extensions;
  if (one) return new Map(Object.entries(one.humanoid?.humanBones ?? {}).map(([bone, { node }]) => [bone, node]));
  return new Map((zero?.humanoid?.humanBones ?? []).map(({ bone, node }) => [bone, node]));
}

/** A number that distinguishes files. */
function sumOf(bytes) {
  let sum = 2166136261; // FNV-1a
  for (const byte of new Uint8Array(bytes)) sum = Math.imul(sum ^ byte, 16777619);
  return `${bytes.byteLength}-${(sum >>> 0).toString(36)}`;
}
