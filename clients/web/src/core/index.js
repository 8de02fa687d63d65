// The core: no engine, no clock, no socket. Bytes and times go in, poses come out.

export { BASES, headingOf } from "./bases.js";
export { BoneMap, BoneMapError, mapBones } from "./bone_map.js";
export { Homes, Route, placeOf } from "./homes.js";
export { FLAG, StreamDecoder } from "./messages.js";
export { MotionPlayer, PlayedAgent } from "./player.js";
export { PlayoutClock, PoseTrack, mixPoses } from "./playout.js";
export { ENCODING, frameBytes, unpackPoses } from "./poses.js";
export { multiply, rotate } from "./quaternions.js";
export { Retarget } from "./retarget.js";
export { BONES, PARENTS, Rig } from "./rig.js";
export { measureSoles } from "./soles.js";
export { SmoothRoot } from "./root.js";
export { TierUnpacker } from "./tiers.js";
