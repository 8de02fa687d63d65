// Files of an export and of onnxruntime-web, packed or not.

/**
 * Unpacks the content of a file. Files may be packed with gzip under their own names, since few web hosts pack what is not text.
 * @param {ArrayBuffer} bytes
 */
export async function unpacked(bytes) {
  const [first, second] = new Uint8Array(bytes);
  if (first !== 0x1f || second !== 0x8b) return bytes;
  return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"))).arrayBuffer();
}
