// node babylon.mjs FILE "[seconds, …]": bones of the file in the world, as Babylon.js plays it.
globalThis.XMLHttpRequest ??= class {};
console.warn = console.log = () => {};
const { readFileSync } = await import("node:fs");
const { NullEngine } = await import("@babylonjs/core/Engines/nullEngine.js");
const { Scene } = await import("@babylonjs/core/scene.js");
const { FreeCamera } = await import("@babylonjs/core/Cameras/freeCamera.js");
const { ImportMeshAsync } = await import("@babylonjs/core/Loading/sceneLoader.js");
const { Vector3 } = await import("@babylonjs/core/Maths/math.vector.js");
await import("@babylonjs/loaders/glTF/2.0/index.js");

const KEYS_PER_SECOND = 60; // of Babylon's glTF loader
const scene = new Scene(new NullEngine());
scene.useRightHandedSystem = true;
new FreeCamera("camera", Vector3.Zero(), scene);
const url = `data:model/gltf-binary;base64,${readFileSync(process.argv[2]).toString("base64")}`;
const { animationGroups, skeletons } = await ImportMeshAsync(url, scene, { pluginExtension: ".glb" });
const [group] = animationGroups;
const frames = JSON.parse(process.argv[3]).map((time) => {
  group.start(false);
  group.goToFrame(time * KEYS_PER_SECOND);
  group.pause();
  scene.render();
  return skeletons.map(({ bones }) => bones.map((bone) => {
    const node = bone.getTransformNode();
    node.computeWorldMatrix(true);
    return [bone.name, ...node.getAbsolutePosition().asArray()];
  }));
});
process.stdout.write(JSON.stringify({ duration: (group.to - group.from) / KEYS_PER_SECOND, frames }));
process.exitCode = 0;
setTimeout(() => process.exit(), 50).unref?.();
