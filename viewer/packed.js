// The user's GLB files, packed or not. A decoder is loaded when a file needs it, from this page's own server.

import { BufferAttribute, BufferGeometry, GLTFLoader, Group } from "./vendor/three.min.js";
import { readGlb } from "./glb.js";

const DRACO = "KHR_draco_mesh_compression";
const MESHOPT = ["EXT_meshopt_compression", "KHR_meshopt_compression"];
const KINDS = { // of three.js's arrays in Draco
  Float32Array: "DT_FLOAT32", Int8Array: "DT_INT8", Int16Array: "DT_INT16", Int32Array: "DT_INT32",
  Uint8Array: "DT_UINT8", Uint16Array: "DT_UINT16", Uint32Array: "DT_UINT32",
};

/** Parses a GLB's bytes with GLTFLoader. Rejects with the reason why it cannot be read. */
export async function loadGlb(bytes) {
  const json = readGlb(bytes) ?? {};
  const wanted = new Set([...(json.extensionsRequired ?? []), ...(json.extensionsUsed ?? [])]);
  const loader = new GLTFLoader();
  if (MESHOPT.some((name) => wanted.has(name))) {
    loader.setMeshoptDecoder((await import("./vendor/meshopt.min.js")).MeshoptDecoder);
  }
  if (wanted.has(DRACO)) loader.setDRACOLoader(await dracoLoader());
  const gltf = await loader.parseAsync(bytes, "");
  gltf.scene ??= await everything(gltf.parser); // a file need not have a scene
  return gltf;
}

/** All nodes of a file. */
async function everything(parser) {
  const nodes = parser.json.nodes ?? [];
  const below = new Set(nodes.flatMap(({ children }) => children ?? []));
  const tops = [...nodes.keys()].filter((number) => !below.has(number));
  return new Group().add(...(await Promise.all(tops.map((number) => parser.getDependency("node", number)))));
}

/** The part of three.js's DRACOLoader that GLTFLoader uses. Its worker is made of a blob, which this page's policy forbids. */
async function dracoLoader() {
  const draco = await (await import("./vendor/draco.min.js")).dracoDecoder();
  return {
    preload() {},
    decodeDracoFile(buffer, take, ids, types, _colours, fail) {
      try {
        take(geometryOf(draco, new Int8Array(buffer), ids, types));
      } catch (error) {
        fail(error);
      }
    },
  };
}

/** `ids` and `types`: names of attributes → Draco's numbers, and names of arrays. */
function geometryOf(draco, bytes, ids, types) {
  const decoder = new draco.Decoder();
  const mesh = new draco.Mesh();
  try {
    const status = decoder.DecodeArrayToMesh(bytes, bytes.byteLength, mesh);
    if (!status.ok()) throw new Error(`a mesh that Draco has packed is damaged: ${status.error_msg()}`);
    const geometry = new BufferGeometry();
    for (const [name, id] of Object.entries(ids)) {
      const attribute = decoder.GetAttributeByUniqueId(mesh, id);
      const size = attribute.num_components();
      const values = copied(draco, globalThis[types[name]], mesh.num_points() * size, (at, length) =>
        decoder.GetAttributeDataArrayForAllPoints(mesh, attribute, draco[KINDS[types[name]]], length, at));
      geometry.setAttribute(name, new BufferAttribute(values, size));
    }
    const order = copied(draco, Uint32Array, mesh.num_faces() * 3, (at, length) => decoder.GetTrianglesUInt32Array(mesh, length, at));
    return geometry.setIndex(new BufferAttribute(order, 1));
  } finally {
    draco.destroy(mesh);
    draco.destroy(decoder);
  }
}

/** An array that `fill(address, bytes)` writes into the decoder's memory. */
function copied(draco, Kind, count, fill) {
  const length = count * Kind.BYTES_PER_ELEMENT;
  const at = draco._malloc(length);
  fill(at, length);
  const values = new Kind(draco.HEAPU8.buffer, at, count).slice();
  draco._free(at);
  return values;
}
