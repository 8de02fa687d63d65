// Pictures that this page paints: sky, paving, floor.

import { CanvasTexture, RepeatWrapping, SRGBColorSpace } from "./vendor/three.min.js";

const PAINTED = { willReadFrequently: true }; // on the processor: the page does not wait for the graphics card

/** A sky from the zenith to the horizon, in the upper half of a sphere. */
export function skyTexture(zenith, horizon) {
  const canvas = document.createElement("canvas");
  canvas.width = 4;
  canvas.height = 256;
  const pen = canvas.getContext("2d", PAINTED);
  const shade = pen.createLinearGradient(0, 0, 0, 256);
  shade.addColorStop(0, zenith);
  shade.addColorStop(0.5, horizon);
  pen.fillStyle = shade;
  pen.fillRect(0, 0, 4, 256);
  const texture = new CanvasTexture(canvas);
  texture.colorSpace = SRGBColorSpace;
  return texture;
}

/** Flagstones of 4 × 4 m, to be laid by metres. */
export function pavingTexture() {
  const size = 1024, rows = 8;
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = size;
  const pen = canvas.getContext("2d", PAINTED);
  pen.fillStyle = "#8d8878";
  pen.fillRect(0, 0, size, size);
  let seed = 7; // the same stones each time
  const chance = () => (seed = (seed * 16807) % 2147483647) / 2147483647;
  const high = size / rows;
  for (let row = 0; row < rows; row += 1) {
    const stones = 5 + Math.floor(2 * chance());
    const shift = chance() * high;
    for (let stone = 0; stone < stones; stone += 1) {
      const wide = size / stones;
      pen.fillStyle = `hsl(${38 + 8 * chance()}, ${9 + 5 * chance()}%, ${68 + 9 * chance()}%)`;
      for (const around of [-size, 0, size]) pen.fillRect(shift + stone * wide + around + 2, row * high + 2, wide - 4, high - 4);
    }
  }
  const texture = new CanvasTexture(canvas);
  texture.colorSpace = SRGBColorSpace;
  texture.wrapS = texture.wrapT = RepeatWrapping;
  texture.anisotropy = 8;
  return texture;
}

/** A tile of 5 × 5 m: thin lines each metre, a stronger one at the edge. */
export function floorTexture() {
  const size = 1024;
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = size;
  const pen = canvas.getContext("2d", PAINTED);
  pen.fillStyle = "#c4c2b6";
  pen.fillRect(0, 0, size, size);
  for (let metre = 0; metre <= 5; metre += 1) {
    const strong = metre % 5 === 0;
    pen.fillStyle = strong ? "#a5a294" : "#b6b3a6";
    const thick = strong ? 5 : 3;
    const at = (metre * size) / 5 - thick / 2;
    pen.fillRect(at, 0, thick, size);
    pen.fillRect(0, at, size, thick);
  }
  const texture = new CanvasTexture(canvas);
  texture.colorSpace = SRGBColorSpace;
  texture.wrapS = texture.wrapT = RepeatWrapping;
  return texture;
}
