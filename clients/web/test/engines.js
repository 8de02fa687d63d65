// The golden characters as each engine has them: `make(nodes, humanoid, restOffsets)` gives { character, settle(),
// place(node) }, where `settle` does what a picture does and `place` reads a node's place in the world, glTF axes.

import { NullEngine, Quaternion, Scene, TransformNode, Vector3 } from "@babylonjs/core";
import { VRMHumanoid } from "@pixiv/three-vrm";
import { Bone, Group, Vector3 as Place } from "three";
import { BabylonCharacter } from "../src/babylon.js";
import { ThreeCharacter } from "../src/three.js";
import { VrmCharacter } from "../src/vrm.js";

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

const three = (nodes, humanoid, restOffsets) => {
  const { root, place } = threeTree(nodes);
  return { character: new ThreeCharacter(root, restOffsets), settle: () => root.updateMatrixWorld(), place };
};

const vrm = (nodes, humanoid, restOffsets, turned = false) => {
  const { root, made, place } = threeTree(nodes);
  root.updateMatrixWorld(true);
  const bones = Object.fromEntries(Object.entries(humanoid).map(([name, node]) => [name, { node: made[node] }]));
  const avatar = { scene: root, humanoid: new VRMHumanoid(bones) };
  root.add(avatar.humanoid.normalizedHumanBonesRoot);
  if (turned) root.rotation.y = Math.PI; // VRMUtils.rotateVRM0
  return {
    character: new VrmCharacter(avatar, restOffsets),
    settle: () => {
      root.updateMatrixWorld(true);
      avatar.humanoid.update();
      root.updateMatrixWorld(true);
    },
    place,
  };
};

const babylon = (nodes, humanoid, restOffsets) => {
  const scene = new Scene(new NullEngine());
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
  return {
    character: new BabylonCharacter(root, restOffsets),
    settle: () => made.forEach((node) => node.computeWorldMatrix(true)),
    place: (node) => {
      const { x, y, z } = made[node].getAbsolutePosition();
      return [-x, y, z];
    },
  };
};

export const ENGINES = { three, vrm, babylon };
