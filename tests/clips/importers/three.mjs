// node three.mjs FILE "[seconds, …]": bones of the file in the world, as three.js plays it.
globalThis.self = globalThis;
const { readFileSync } = await import("node:fs");
const { AnimationMixer, LoopOnce, Vector3 } = await import("three");
const { GLTFLoader } = await import("three/addons/loaders/GLTFLoader.js");

const data = readFileSync(process.argv[2]);
const { scene, animations } = await new GLTFLoader().parseAsync(Uint8Array.from(data).buffer, "");
const mixer = new AnimationMixer(scene);
const action = mixer.clipAction(animations[0]).setLoop(LoopOnce);
action.clampWhenFinished = true;
action.play();
const skeletons = new Set();
scene.traverse((node) => node.isSkinnedMesh && skeletons.add(node.skeleton));
const frames = JSON.parse(process.argv[3]).map((time) => {
  mixer.setTime(time);
  scene.updateMatrixWorld(true);
  const people = new Map([...skeletons].map(({ bones }) => [bones[0], bones])); // meshes of one person share bones
  return [...people.values()].map((bones) =>
    bones.map((bone) => [bone.name, ...new Vector3().setFromMatrixPosition(bone.matrixWorld)]));
});
console.log(JSON.stringify({ duration: animations[0].duration, frames }));
