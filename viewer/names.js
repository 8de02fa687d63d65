// People's names, in one draw call: those nearest to the camera, without overlaps.

import {
  BufferAttribute, BufferGeometry, CanvasTexture, DynamicDrawUsage, Mesh, MeshBasicMaterial, SRGBColorSpace, Vector3,
} from "./vendor/three.min.js";

const MOST = 40; // shown at a time
const SIZE = [0.12, 0.03]; // width and height as shares of the view's height, half its tangent: the same at any distance
const CELL = [256, 64]; // pixels of a name
const CELLS = [4, 32]; // names kept as pictures, beside and over each other
const ABOVE = 0.22; // metres over the head
const CORNERS = [[0, 0], [1, 0], [1, 1], [0, 1]];
const place = new Vector3(); // hundreds of people are looked at in each picture

/** The names of people, drawn on `mesh`. */
export class Names {
  constructor() {
    const pictures = new CanvasTexture({ width: CELL[0] * CELLS[0], height: CELL[1] * CELLS[1] });
    pictures.source.dataReady = false; // they are copied into it one by one
    pictures.colorSpace = SRGBColorSpace;
    this.mesh = new Mesh(quads(MOST), new MeshBasicMaterial({ map: pictures, transparent: true, depthTest: false }));
    this.mesh.material.onBeforeCompile = facingCamera;
    this.mesh.frustumCulled = false;
    this.mesh.renderOrder = 1;
    this.pen = null; // made when it is first needed
    this.cells = new Map(); // text → number of its cell; those shown last stand last
    this.shown = []; // [{ person, x, y, depth }]: see `show`
    this.hide();
  }

  hide() {
    this.mesh.visible = false;
  }

  /** Notes that the graphics card has lost its pictures, as in a tab that slept on a phone. */
  forget() {
    this.cells.clear();
  }

  /** Shows names over people in a picture of `width` by `height` pixels. */
  show(people, { camera, renderer }, width, height) {
    const reach = height / (2 * Math.tan((camera.fov * Math.PI) / 360));
    const [w, h] = SIZE.map((share) => share * reach);
    const seen = [];
    for (const person of people) {
      if (!person.shown || !person.group.visible) continue;
      place.set(person.x, person.y + person.height + ABOVE, person.z).applyMatrix4(camera.matrixWorldInverse);
      const depth = -place.z;
      const x = (place.x / depth) * reach, y = (place.y / depth) * reach; // pixels from the middle
      if (depth > camera.near && Math.abs(x) < (width + w) / 2 && Math.abs(y) < (height + h) / 2) seen.push({ person, x, y, depth });
    }
    seen.sort((a, b) => a.depth - b.depth);
    this.shown = [];
    for (const one of seen) {
      if (this.shown.length === MOST) break;
      if (this.shown.every(({ x, y }) => Math.abs(x - one.x) > w || Math.abs(y - one.y) > h)) this.shown.push(one);
    }
    this.#draw(renderer);
  }

  #draw(renderer) {
    const { position, uv } = this.mesh.geometry.attributes;
    const cells = this.#cellsOf(this.shown.map(({ person }) => person.agent.name), renderer);
    this.shown.forEach(({ person: { x, y, z, height } }, k) => {
      const column = cells[k] % CELLS[0], row = Math.floor(cells[k] / CELLS[0]);
      CORNERS.forEach(([right, up], corner) => {
        position.setXYZ(4 * k + corner, x, y + height + ABOVE, z);
        uv.setXY(4 * k + corner, (column + right) / CELLS[0], (row + up) / CELLS[1]);
      });
    });
    position.needsUpdate = uv.needsUpdate = true;
    this.mesh.geometry.setDrawRange(0, 6 * this.shown.length);
    this.mesh.visible = this.shown.length > 0;
  }

  /** The cells of texts. A new text gets the cell of the text that was shown longest ago. */
  #cellsOf(texts, renderer) {
    for (const text of texts) {
      const cell = this.cells.get(text);
      if (cell !== undefined && this.cells.delete(text)) this.cells.set(text, cell);
    }
    const { map } = this.mesh.material;
    const fresh = [...new Set(texts)].filter((text) => !this.cells.has(text));
    fresh.forEach((text, k) => {
      const full = this.cells.size === CELLS[0] * CELLS[1];
      const [[oldest, freed]] = full ? this.cells : [["", this.cells.size]];
      this.cells.delete(oldest);
      this.cells.set(text, freed);
      map.mipmapsAutoUpdate = k === fresh.length - 1; // once for all of them
      const at = new Vector3(CELL[0] * (freed % CELLS[0]), CELL[1] * Math.floor(freed / CELLS[0]));
      renderer.copyTextureToTexture(new CanvasTexture(this.#written(text)), map, null, at);
    });
    return texts.map((text) => this.cells.get(text));
  }

  /** A canvas with a text on a plate; the next text is written on the same. */
  #written(text) {
    const [width, height] = CELL;
    this.pen ??= Object.assign(document.createElement("canvas"), { width, height }).getContext("2d", { willReadFrequently: true });
    const { pen } = this;
    pen.clearRect(0, 0, width, height);
    pen.font = "600 34px system-ui, sans-serif";
    const wide = Math.min(250, pen.measureText(text).width + 36);
    pen.fillStyle = "rgb(255 255 255 / 85%)";
    pen.beginPath();
    pen.roundRect((width - wide) / 2, 6, wide, 52, 18);
    pen.fill();
    pen.fillStyle = "#22303a";
    pen.textAlign = "center";
    pen.textBaseline = "middle";
    pen.fillText(text, width / 2, 34, 220);
    return pen.canvas;
  }
}

/** A geometry of rectangles, all at one point; `corner` is where a vertex lies from it. */
function quads(count) {
  const geometry = new BufferGeometry();
  const corners = CORNERS.flatMap(([right, up]) => [(right - 0.5) * SIZE[0], (up - 0.5) * SIZE[1]]);
  const repeated = (values) => Float32Array.from({ length: count * values.length }, (_, k) => values[k % values.length]);
  geometry.setAttribute("position", new BufferAttribute(new Float32Array(12 * count), 3).setUsage(DynamicDrawUsage));
  geometry.setAttribute("uv", new BufferAttribute(new Float32Array(8 * count), 2).setUsage(DynamicDrawUsage));
  geometry.setAttribute("corner", new BufferAttribute(repeated(corners), 2));
  geometry.setIndex(Array.from({ length: count }, (_, k) => [0, 1, 2, 0, 2, 3].map((corner) => 4 * k + corner)).flat());
  return geometry;
}

/** Makes a material's rectangles face the camera. */
function facingCamera(shader) {
  shader.vertexShader = `attribute vec2 corner;\n${shader.vertexShader}`.replace("#include <project_vertex>", `
    vec4 mvPosition = modelViewMatrix * vec4(transformed, 1.0);
    mvPosition.xy -= mvPosition.z * corner;
    gl_Position = projectionMatrix * mvPosition;`);
}
