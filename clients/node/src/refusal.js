// Calls that a server refuses for now, with the time after which to come again.

import { BinaryReader } from "@bufbuild/protobuf/wire";
import { status } from "@grpc/grpc-js";

const DETAILS = "grpc-status-details-bin";
const RETRY_INFO = "type.googleapis.com/google.rpc.RetryInfo";

/** Milliseconds after which a refused call may be sent again; 0 when the server has not said. */
export function retryAfterMs(error) {
  if (error.code !== status.RESOURCE_EXHAUSTED) return 0;
  const [details] = error.metadata?.get(DETAILS) ?? [];
  if (!details) return 0;
  try {
    for (const any of fields(details)[3] ?? []) {
      const { 1: [type] = [], 2: [info] = [] } = fields(any);
      if (!type || !info || Buffer.from(type).toString() !== RETRY_INFO) continue;
      const [delay] = fields(info)[1] ?? [];
      const { 1: [seconds = 0n] = [], 2: [nanos = 0n] = [] } = delay ? fields(delay) : {};
      return Number(seconds) * 1000 + Number(nanos) / 1e6;
    }
  } catch {
    return 0; // not what this server sends: a proxy's
  }
  return 0;
}

/** The fields of an encoded message by number, each a list: varints as bigint, all else as bytes. */
function fields(bytes) {
  const reader = new BinaryReader(bytes);
  const found = {};
  while (reader.pos < reader.len) {
    const [number, type] = reader.tag();
    const value = type === 0 ? BigInt(reader.int64()) : type === 2 ? reader.bytes() : reader.skip(type, number);
    (found[number] ??= []).push(value);
  }
  return found;
}
