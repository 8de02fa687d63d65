// The JSON of a GLB file. No DOM.

const MAGIC = 0x46546c67; // "glTF"
const JSON_CHUNK = 0x4e4f534a;

/** What the JSON of a GLB's bytes holds; null where they are none. */
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
