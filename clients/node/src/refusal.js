// Why a server refuses a call: when to come again, or where it should have gone.

import { BinaryReader } from "@bufbuild/protobuf/wire";
import { status } from "@grpc/grpc-js";

const DETAILS = "grpc-status-details-bin";
const PREFIX = "type.googleapis.com/google.rpc.";

/** Milliseconds after which a refused call may be sent again; 0 when the server has not said. */
export function retryAfterMs(error) {
  if (error.code !== status.RESOURCE_EXHAUSTED) return 0;
  const info = detail(error, "RetryInfo");
  const [delay] = info?.[1] ?? [];
  const { 1: [seconds = 0n] = [], 2: [nanos = 0n] = [] } = delay ? fields(delay) : {};
  return Number(seconds) * 1000 + Number(nanos) / 1e6;
}

/** Where a misdirected call should have gone: { host, port }; null for other errors. */
export function placeOf(error) {
  if (error.code !== status.FAILED_PRECONDITION) return null;
  const info = detail(error, "ErrorInfo");
  if (textOf(info?.[1]) !== "MISDIRECTED") return null;
  const metadata = Object.fromEntries((info[3] ?? []).map((entry) => {
    const { 1: key, 2: value } = fields(entry);
    return [textOf(key), textOf(value)];
  }));
  return { host: metadata.host ?? "", port: Number(metadata.grpc_port ?? 0) };
}

const textOf = ([bytes] = []) => (bytes ? Buffer.from(bytes).toString() : "");

/** The fields of a google.rpc message that an error has; undefined without it. */
function detail(error, name) {
  const [details] = error.metadata?.get(DETAILS) ?? [];
  if (!details) return undefined;
  try {
    for (const any of fields(details)[3] ?? []) {
      const { 1: type, 2: [value] = [] } = fields(any);
      if (textOf(type) === PREFIX + name && value) return fields(value);
    }
  } catch {
    // not what this server sends: a proxy's
  }
  return undefined;
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
