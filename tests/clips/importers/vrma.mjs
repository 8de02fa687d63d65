// node vrma.mjs FILE SECONDS: tracks of the file, as @pixiv/three-vrm-animation reads them.
globalThis.self = globalThis;
const { readFileSync } = await import("node:fs");
const { GLTFLoader } = await import("three/addons/loaders/GLTFLoader.js");
const { VRMAnimationLoaderPlugin } = await import("@pixiv/three-vrm-animation");

const loader = new GLTFLoader();
loader.register((parser) => new VRMAnimationLoaderPlugin(parser));
const data = readFileSync(process.argv[2]);
const { userData } = await loader.parseAsync(Uint8Array.from(data).buffer, "");
const [animation] = userData.vrmAnimations;
const { translation, rotation } = animation.humanoidTracks;
const sampled = (tracks) =>
  Object.fromEntries([...tracks].map(([bone, track]) => [bone, [...track.createInterpolant().evaluate(Number(process.argv[3]))]]));
console.log(JSON.stringify({
  duration: animation.duration,
  hips: animation.restHipsPosition.toArray(),
  translation: sampled(translation),
  rotation: sampled(rotation),
}));
