// The two parts of a GLB file: its JSON and its numbers. No DOM.

const MAGIC = 0x46546c67; // "glTF"
const JSON_CHUNK = 0x4e4f534a;

/** The JSON of a GLB's bytes; null if they are none. */
export function readGlb(bytes) {
  const view = new DataView(bytes);
  if (bytes.byteLength < 20 || view.getUint32(0, true) !== MAGIC || view.getUint32(16, true) !== JSON_CHUNK) return null;
  const length = view.getUint32(12, true);
  if (20 + length > bytes.byteLength) return null;
  try {
    return JSON.parse(new TextDecoder().decode(new Uint8Array(bytes, 20, length)));
  } catch {
    return null;
  }
}

/** The numbers of a GLB's bytes, which `readGlb` can read; empty if it has none. */
export function binaryOf(bytes) {
  const view = new DataView(bytes), at = 20 + view.getUint32(12, true);
  return at < bytes.byteLength ? new Uint8Array(bytes, at + 8, view.getUint32(at, true)) : new Uint8Array();
}

/**
 * Whether a file with a skin is a level: more of its meshes stand by themselves than hang from its bones, as in a town with a flag
 * or a passer-by. A VRM avatar is none.
 */
export function isLevel(json) {
  if (json?.extensions?.VRM || json?.extensions?.VRMC_vrm) return false;
  const nodes = json?.nodes ?? [];
  const onBones = new Set((json?.skins ?? []).flatMap(({ joints }) => joints ?? []));
  for (const bone of onBones) for (const child of nodes[bone]?.children ?? []) onBones.add(child); // a set grows while it is walked
  const meshes = nodes.flatMap((node, number) => (node.mesh === undefined ? [] : [node.skin === undefined && !onBones.has(number)]));
  return meshes.filter(Boolean).length > meshes.length / 2;
}
