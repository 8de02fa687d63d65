// The golden characters as each engine has them: `make(nodes, humanoid, restOffsets)` gives { character, settle(),
// place(node) }, where `settle` does what a picture does and `place` reads a node's place in the world, glTF axes. In a
// page, the engines' own renderers draw the picture; in Node there is nothing to draw on.

import { FreeCamera } from "@babylonjs/core/Cameras/freeCamera.js";
import { Engine } from "@babylonjs/core/Engines/engine.js";
import { NullEngine } from "@babylonjs/core/Engines/nullEngine.js";
import { Quaternion, Vector3 } from "@babylonjs/core/Maths/math.vector.js";
import { Mesh } from "@babylonjs/core/Meshes/mesh.js";
import { VertexData } from "@babylonjs/core/Meshes/mesh.vertexData.js";
import { TransformNode } from "@babylonjs/core/Meshes/transformNode.js";
import { Scene } from "@babylonjs/core/scene.js";
import { VRMHumanoid } from "@pixiv/three-vrm";
import {
  Bone, BufferGeometry, Float32BufferAttribute, Group, PerspectiveCamera, Scene as Stage, Skeleton, SkinnedMesh, Uint16BufferAttribute,
  Vector3 as Place, WebGLRenderer,
} from "three";
import { BabylonCharacter } from "../src/babylon.js";
import { ThreeCharacter } from "../src/three.js";
import { VrmCharacter } from "../src/vrm.js";

const canvas = () => document.body.appendChild(document.createElement("canvas"));
const inPage = "document" in globalThis;
const renderer = inPage ? new WebGLRenderer({ canvas: canvas() }) : null;
const camera = new PerspectiveCamera();

/** What draws a picture of something of three.js: its matrices are of now after that. */
export function threePicture(root) {
  if (!renderer) return () => root.updateMatrixWorld();
  const stage = new Stage().add(root);
  return () => renderer.render(stage, camera);
}

function threeTree(nodes) {
  const root = new Group();
  const made = nodes.map(({ name, position, rotation, scale }) => {
    const bone = new Bone();
    bone.name = name;
    bone.position.fromArray(position);
    bone.quaternion.fromArray(rotation);
    bone.scale.fromArray(scale);
    return bone;
  });
  nodes.forEach(({ parent }, k) => (parent < 0 ? root : made[parent]).add(made[k]));
  return { root, made, place: (node) => made[node].getWorldPosition(new Place()).toArray() };
}

/** A mesh of the golden traces as a skin, each vertex moved by its node. */
function skinned(root, made, { places, nodes }) {
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new Float32BufferAttribute(places.flat(), 3));
  geometry.setAttribute("skinIndex", new Uint16BufferAttribute(nodes.flatMap((node) => [node, 0, 0, 0]), 4));
  geometry.setAttribute("skinWeight", new Float32BufferAttribute(nodes.flatMap(() => [1, 0, 0, 0]), 4));
  const mesh = new SkinnedMesh(geometry);
  root.add(mesh);
  root.updateMatrixWorld(true);
  mesh.bind(new Skeleton(made), mesh.matrixWorld);
}

const three = (nodes, humanoid, restOffsets, mesh) => {
  const { root, made, place } = threeTree(nodes);
  if (mesh) skinned(root, made, mesh);
  return { character: new ThreeCharacter(root, restOffsets), settle: threePicture(root), place };
};

const vrm = (nodes, humanoid, restOffsets, mesh, turned = false) => {
  const { root, made, place } = threeTree(nodes);
  root.updateMatrixWorld(true);
  const bones = Object.fromEntries(Object.entries(humanoid).map(([name, node]) => [name, { node: made[node] }]));
  const avatar = { scene: root, humanoid: new VRMHumanoid(bones) };
  root.add(avatar.humanoid.normalizedHumanBonesRoot);
  const picture = threePicture(root);
  if (turned) root.rotation.y = Math.PI; // VRMUtils.rotateVRM0
  return {
    character: new VrmCharacter(avatar, restOffsets),
    settle: () => {
      root.updateMatrixWorld(true);
      avatar.humanoid.update();
      picture();
    },
    place,
  };
};

const babylon = (nodes, humanoid, restOffsets, mesh) => {
  const scene = new Scene(inPage ? new Engine(canvas()) : new NullEngine());
  new FreeCamera("camera", new Vector3(0, 1, -5), scene);
  const root = new TransformNode("__root__", scene); // as the glTF loader makes it in a left-handed scene
  root.rotationQuaternion = new Quaternion(0, 1, 0, 0);
  root.scaling = new Vector3(1, 1, -1);
  const made = nodes.map(({ name, position, rotation, scale }) => {
    const node = new TransformNode(name, scene);
    node.position = Vector3.FromArray(position);
    node.rotationQuaternion = Quaternion.FromArray(rotation);
    node.scaling = Vector3.FromArray(scale);
    return node;
  });
  nodes.forEach(({ parent }, k) => { made[k].parent = parent < 0 ? root : made[parent]; });
  mesh?.nodes.forEach((node, k) => { // a part of its own of each corner, that hangs from its bone
    const part = new Mesh(`part ${k}`, scene);
    part.parent = root;
    const data = new VertexData();
    data.positions = mesh.places[k];
    data.applyToMesh(part);
    part.setParent(made[node]);
  });
  return {
    character: new BabylonCharacter(root, restOffsets),
    settle: () => {
      scene.render();
      made.forEach((node) => node.computeWorldMatrix(true));
    },
    place: (node) => {
      const { x, y, z } = made[node].getAbsolutePosition();
      return [-x, y, z];
    },
  };
};

export const ENGINES = { three, vrm, babylon };
