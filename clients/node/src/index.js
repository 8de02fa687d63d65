// Client of Wayfarer, a motion-generation service: goals in, poses out.

export { connect } from "./client.js";
export { follow } from "./follow.js";
export { retryAfterMs } from "./refusal.js";
export { unpackChunks } from "./poses.js";
export { AgentState, Gender } from "./gen/wayfarer/v1/agent_pb.js";
export { Basis } from "./gen/wayfarer/v1/common_pb.js";
export { ChunkFlag, EventKind, PoseEncoding, PoseProfile, SlowReader } from "./gen/wayfarer/v1/motion_pb.js";
export { MeshFormat } from "./gen/wayfarer/v1/scene_pb.js";
