// The services of a server as objects: calls are promises, streams are async iterables.

import { setTimeout as sleep } from "node:timers/promises";
import { create, fromBinary, toBinary } from "@bufbuild/protobuf";
import { Metadata, credentials, makeGenericClientConstructor } from "@grpc/grpc-js";
import { Homes } from "wayfarer-client/core";
import { AdminService } from "./gen/wayfarer/v1/admin_pb.js";
import { AgentService } from "./gen/wayfarer/v1/agent_pb.js";
import { CatalogService } from "./gen/wayfarer/v1/catalog_pb.js";
import { ControlService } from "./gen/wayfarer/v1/control_pb.js";
import { GoalService } from "./gen/wayfarer/v1/goal_pb.js";
import { MotionService } from "./gen/wayfarer/v1/motion_pb.js";
import { SceneService } from "./gen/wayfarer/v1/scene_pb.js";
import { SessionService } from "./gen/wayfarer/v1/session_pb.js";
import { SnapshotService } from "./gen/wayfarer/v1/snapshot_pb.js";
import { ControlState, FollowingCall, aboutOf, goesOn, madeOf, repeatable } from "./nodes.js";
import { retryAfterMs } from "./refusal.js";

const TIMEOUT_MS = 10_000;
const SERVICES = {
  scenes: SceneService,
  sessions: SessionService,
  agents: AgentService,
  goals: GoalService,
  motion: MotionService,
  control: ControlService,
  snapshots: SnapshotService,
  catalog: CatalogService,
  admin: AdminService,
};

/**
 * Connect to a server, as "localhost:50051". `apiKey` or `token` (a JWT) shows who calls; `tls` are
 * credentials of grpc-js (`credentials.createSsl(…)`), none by default. Unary calls fail after
 * `timeoutMs`; one that is refused for now is sent again when the server has said, for as long. A call
 * that sends a stream takes an iterable of requests. A failed call throws grpc-js's ServiceError:
 * `code`, `details`.
 *
 *     const { session } = await client.sessions.createSession({ basis: Basis.UNITY });
 *     for await (const message of client.motion.streamMotion({ sessionId: session.sessionId })) …
 */
export function connect(address, { apiKey, token, tls, timeoutMs = TIMEOUT_MS } = {}) {
  const metadata = new Metadata();
  if (apiKey) metadata.set("x-api-key", apiKey);
  if (token) metadata.set("authorization", `Bearer ${token}`);
  const stubs = new Map(); // by service and node
  const homes = new Homes(address);
  const client = { close: () => stubs.forEach((stub) => stub.close()) };
  for (const [name, service] of Object.entries(SERVICES)) {
    const Stub = makeGenericClientConstructor(definition(service), service.typeName);
    const at = (node) => {
      const key = `${name} ${node}`;
      if (!stubs.has(key)) stubs.set(key, new Stub(node, tls ?? credentials.createInsecure()));
      return stubs.get(key);
    };
    client[name] = Object.fromEntries(
      service.methods.map((method) => [method.localName, caller(at, homes, method, metadata, timeoutMs)]),
    );
  }
  return client;
}

/** `at(node)`: the stub that calls a node. */
function caller(at, homes, { localName, methodKind }, metadata, timeoutMs) {
  if (methodKind === "bidi_streaming")
    return ({ deadlineMs } = {}) =>
      new FollowingCall(homes, (node) => at(node)[localName](metadata), undefined, new ControlState(), deadlineMs);
  if (methodKind === "server_streaming")
    return (request = {}) =>
      new FollowingCall(homes, (node) => at(node)[localName](request, metadata), aboutOf(request));
  const limit = () => ({ deadline: Date.now() + timeoutMs });
  const settle = (resolve, reject) => (error, reply) => (error ? reject(error) : resolve(reply));
  if (methodKind === "client_streaming")
    return (requests) => {
      const again = repeatable(requests);
      const once = (node) =>
        new Promise((resolve, reject) => {
          const stream = again();
          const call = at(node)[localName](metadata, limit(), settle(resolve, reject));
          call.on("error", () => stream.destroy());
          stream.pipe(call);
        });
      return untilTaken(once, homes.route(""), timeoutMs);
    };
  return (request = {}) => {
    const once = (node) =>
      new Promise((resolve, reject) => at(node)[localName](request, metadata, limit(), settle(resolve, reject)));
    return untilTaken(once, homes.route(aboutOf(request)), timeoutMs);
  };
}

/**
 * Call again what belongs to another node, and what is refused for now, when the server has said; within `timeoutMs` in
 * all.
 */
async function untilTaken(call, route, timeoutMs) {
  const end = Date.now() + timeoutMs;
  for (;;) {
    try {
      const reply = await call(route.address);
      route.answered(madeOf(reply));
      return reply;
    } catch (error) {
      if (goesOn(route, error)) continue;
      const wait = retryAfterMs(error) * (1 + Math.random() / 5); // so that not all come back together
      if (!wait || Date.now() + wait > end) throw error;
      await sleep(wait);
    }
  }
}

/** What grpc-js needs to know of a generated service. */
function definition(service) {
  const streams = (kind, ...kinds) => kinds.includes(kind);
  return Object.fromEntries(
    service.methods.map(({ name, localName, methodKind, input, output }) => [
      localName,
      {
        path: `/${service.typeName}/${name}`,
        requestStream: streams(methodKind, "client_streaming", "bidi_streaming"),
        responseStream: streams(methodKind, "server_streaming", "bidi_streaming"),
        requestSerialize: (message) => Buffer.from(toBinary(input, create(input, message))),
        requestDeserialize: (bytes) => fromBinary(input, bytes),
        responseSerialize: (message) => Buffer.from(toBinary(output, create(output, message))),
        responseDeserialize: (bytes) => fromBinary(output, bytes),
      },
    ]),
  );
}
