// Client of Wayfarer, a motion service: people who walk, in a web page or in Node.

export * from "./core/index.js";
export { Character, readRig } from "./character.js";
export { Access } from "./access.js";
export { Api, ApiError, onFloor } from "./api.js";
export { keepAlive } from "./lease.js";
export { Session } from "./session.js";
export { MotionStream, clock } from "./stream.js";
