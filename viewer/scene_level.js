// A scene on the stage: its walkable ground, its permanent solids, and its obstacles.

import {
  BufferAttribute, BufferGeometry, Color, Group, LineBasicMaterial, LineSegments, Mesh,
  MeshLambertMaterial, ShapeUtils, Vector2,
} from "./vendor/three.min.js";
import { blockMeets, Ground, planePoint, pointOn } from "./ground.js";
import { crownHides, crownOf, dressingOf } from "./dressing.js";
import { loadGlb } from "./packed.js";
import { LAMPLIGHT } from "./scene.js";
import { blockMesh, extentOf, outlineOf } from "./shapes.js";
import { pavingTexture } from "./textures.js";

const STONES = 4; // metres of the paving's pattern
const RIM = "#8fa89b";
const EDGE = "#5f5a52";
const WALLS = ["#d8c3a5", "#e3d6bd", "#c98f70", "#b7a58c", "#cfc6b6"]; // of solids taller than people
const STONE = "#b9b4a9"; // of benches and steps
const POST = "#86705a"; // tall and thin
const LOW = 1.2; // metres
const THIN = 0.8; // metres across
const SHADE = 0.72; // fraction of the light at the foot of a wall
const WOOD = "#b98a5a";
const CHOSEN = "#0b7285";
const SIGHT = 300; // metres; a click on anything farther does not count
const SEE_THROUGH = 0.12; // opacity of walls that hide the camera's target
const HEADROOM = 1.4; // metres over the camera's target; lower blocks do not hide it
const SINK = 0.03; // metres of the endless floor below the ground of a level: at equal height they would flicker

/** Shows `Outlines` (scenes.js), one at a time. */
export class Level {
  constructor() {
    this.group = new Group();
    this.ground = null;
    this.extent = null;
    this.obstacles = new Map(); // name → block
    this.solids = [];
    this.crowns = []; // of each solid: null where it is no tree
    this.model = null;
    this.chosen = null; // name of an obstacle
    this.floor = new Mesh(new BufferGeometry(), new MeshLambertMaterial({
      map: pavingTexture(), polygonOffset: true, polygonOffsetFactor: -1, polygonOffsetUnits: -1,
    }));
    this.floor.receiveShadow = true;
    this.rim = new LineSegments(new BufferGeometry(), new LineBasicMaterial({ color: RIM }));
    this.fixed = new Blocks();
    this.loose = new Blocks();
    this.group.add(this.floor, this.rim, this.fixed.group, this.loose.group);
    this.clear();
  }

  clear() {
    this.show({ vertices: [], triangles: [], solids: [], obstacles: new Map() });
    this.#setModel(null);
    this.ground = null;
    this.extent = null;
    this.group.visible = false;
  }

  show({ vertices, triangles, solids, obstacles }) {
    this.group.visible = true;
    this.ground = new Ground(vertices, triangles);
    this.extent = extentOf(vertices);
    this.#drawGround(vertices, triangles);
    if (!same(solids, this.solids)) {
      this.solids = solids;
      this.crowns = solids.map(crownOf);
      this.fixed.show(solids, colourOf);
    }
    this.showObstacles(obstacles);
  }

  /** Obstacles as requested, before the server has sent the ground without them. */
  showObstacles(obstacles) {
    this.obstacles = obstacles;
    if (!obstacles.has(this.chosen)) this.chosen = null;
    const names = [...obstacles.keys()];
    this.loose.show([...obstacles.values()], (_, k) => (names[k] === this.chosen ? CHOSEN : WOOD));
  }

  choose(name) {
    this.chosen = name;
    this.showObstacles(this.obstacles);
  }

  showWalkable(visible) {
    this.floor.visible = this.rim.visible = visible;
  }

  /** Also draws the file that the scene was made of (GLB bytes). */
  async showModel(bytes) {
    const { scene } = await loadGlb(bytes);
    scene.traverse((node) => {
      if (node.isMesh) node.castShadow = node.receiveShadow = true;
    });
    this.#setModel(scene);
  }

  /** Height of its lowest ground. */
  get base() {
    if (!this.extent || !Number.isFinite(this.extent.low)) return 0;
    return Math.min(this.extent.low, ...this.solids.map(({ bottom }) => bottom));
  }

  /** Height at which the stage's endless floor should lie. */
  get under() {
    return this.extent ? this.base - SINK : 0;
  }

  /** The first thing that a ray meets: { at, point: of the ground there, obstacle: its name, if any }, or null. */
  meets(ray) {
    let best = { along: Infinity };
    const consider = (along, found) => {
      if (along < best.along) best = { along, ...found };
    };
    for (const block of this.solids) consider(blockMeets(ray, block), {});
    for (const [obstacle, block] of this.obstacles) consider(blockMeets(ray, block), { obstacle });
    const ground = this.ground?.meets(ray) ?? planePoint(ray, this.base);
    if (ground) consider(distance(ray.origin, ground), {});
    if (best.along > SIGHT) return null;
    const at = pointOn(ray, best.along);
    return { at, point: { ...at, y: this.heightAt(at.x, at.z, at.y) }, obstacle: best.obstacle };
  }

  heightAt(x, z, y) {
    return this.ground?.heightAt(x, z, y) ?? this.base;
  }

  /** A block moved over the ground. */
  shifted({ top, bottom }, dx, dz) {
    const mean = (axis) => top.reduce((sum, point) => sum + point[axis], 0) / top.length;
    const dy = this.heightAt(mean("x") + dx, mean("z") + dz, bottom) - bottom;
    return { top: top.map(({ x, y, z }) => ({ x: x + dx, y: y + dy, z: z + dz })), bottom: bottom + dy };
  }

  /** Metres along a ray that are free of blocks. */
  freeAlong(ray) {
    return Math.min(Infinity, ...this.solids.map((block) => blockMeets(ray, block)));
  }

  /** Makes walls between the eye and a point transparent. */
  reveal(eye, point) {
    if (!this.solids.length) return;
    const reach = distance(eye, point);
    const direction = {
      x: (point.x - eye.x) / reach, y: (point.y - eye.y) / reach, z: (point.z - eye.z) / reach,
    };
    const hides = (block) => (
      block.top[0].y > point.y + HEADROOM && blockMeets({ origin: eye, direction }, block) < reach
    );
    const covers = (crown) => crown !== null && crownHides(crown, eye, point);
    this.fixed.fade(new Set(this.solids.flatMap((block, k) => (covers(this.crowns[k]) || hides(block) ? [k] : []))));
  }

  #drawGround(vertices, triangles) {
    const corners = Float32Array.from(triangles.flat().flatMap((k) => [vertices[k].x, vertices[k].y + 0.003, vertices[k].z]));
    replace(this.floor, corners);
    this.floor.geometry.computeVertexNormals();
    const laid = new Float32Array((corners.length / 3) * 2);
    for (let k = 0; k < laid.length / 2; k += 1) laid.set([corners[3 * k] / STONES, corners[3 * k + 2] / STONES], 2 * k);
    this.floor.geometry.setAttribute("uv", new BufferAttribute(laid, 2));
    replace(this.rim, outlineOf(vertices, triangles).map((value, k) => (k % 3 === 1 ? value + 0.008 : value)));
  }

  #setModel(model) {
    if (this.model) this.group.remove(this.model);
    this.model?.traverse((node) => {
      node.geometry?.dispose();
      for (const material of [node.material ?? []].flat()) material.dispose();
    });
    this.model = model;
    if (model) this.group.add(model);
  }
}

/** The colour by size: a bench or a rim, a post, a wall. */
function colourOf({ top, bottom }, number) {
  if (top[0].y - bottom < LOW) return STONE;
  const across = Math.max(...["x", "z"].map((axis) => Math.max(...top.map((p) => p[axis])) - Math.min(...top.map((p) => p[axis]))));
  return across < THIN ? POST : WALLS[number % WALLS.length];
}

/** Many blocks in one mesh, with lines along their edges. */
class Blocks {
  constructor() {
    this.group = new Group();
    this.mesh = new Mesh(new BufferGeometry(), new MeshLambertMaterial({
      vertexColors: true, alphaHash: true,
    }));
    this.mesh.material.emissive = LAMPLIGHT; // black by day
    this.mesh.material.onBeforeCompile = glowing;
    this.mesh.castShadow = this.mesh.receiveShadow = true;
    this.edges = new LineSegments(new BufferGeometry(), new LineBasicMaterial({ color: EDGE, transparent: true, opacity: 0.35 }));
    this.group.add(this.mesh, this.edges);
    this.starts = [0];
    this.faded = new Set();
  }

  show(blocks, colourOf) {
    const { corners, normals, lines, starts, dressed, paints } = blockMesh(blocks, triangulate, dressingOf);
    this.starts = starts;
    this.faded = new Set();
    const colours = new Float32Array(4 * (corners.length / 3)).fill(1);
    const glows = new Float32Array(corners.length / 3);
    let painted = 0;
    blocks.forEach((block, k) => {
      for (let vertex = dressed[k]; vertex < starts[k + 1]; vertex += 3, painted += 1) {
        const { colour, light, glow = 0 } = paints[painted];
        glows.fill(glow, vertex, vertex + 3);
        const { r, g, b } = new Color(colour);
        for (let corner = vertex; corner < vertex + 3; corner += 1) colours.set([light * r, light * g, light * b], 4 * corner);
      }
      const { r, g, b } = new Color(colourOf(block, k));
      for (let vertex = starts[k]; vertex < dressed[k]; vertex += 1) {
        const light = corners[3 * vertex + 1] < block.bottom + 0.01 ? SHADE : 1;
        colours.set([light * r, light * g, light * b], 4 * vertex);
      }
    });
    replace(this.mesh, corners);
    this.mesh.geometry.setAttribute("normal", new BufferAttribute(normals, 3));
    this.mesh.geometry.setAttribute("color", new BufferAttribute(colours, 4));
    this.mesh.geometry.setAttribute("glow", new BufferAttribute(glows, 1));
    replace(this.edges, lines);
    this.group.visible = blocks.length > 0;
  }

  /** Makes the blocks of these numbers transparent, and all others opaque. */
  fade(numbers) {
    if (numbers.size === this.faded.size && [...numbers].every((k) => this.faded.has(k))) return;
    const colours = this.mesh.geometry.getAttribute("color");
    for (const k of new Set([...this.faded, ...numbers])) {
      for (let vertex = this.starts[k]; vertex < this.starts[k + 1]; vertex += 1) {
        colours.setW(vertex, numbers.has(k) ? SEE_THROUGH : 1);
      }
    }
    colours.needsUpdate = true;
    this.faded = numbers;
  }
}

/** Makes a material shine by the attribute `glow` of its corners. */
function glowing(shader) {
  const given = "varying float shines;\n";
  shader.vertexShader = `attribute float glow;\n${given}${shader.vertexShader}`.replace("#include <begin_vertex>", "#include <begin_vertex>\nshines = glow;");
  shader.fragmentShader = `${given}${shader.fragmentShader}`
    .replace("#include <emissivemap_fragment>", "#include <emissivemap_fragment>\ntotalEmissiveRadiance *= shines;");
}

/** Another geometry of these points. */
function replace(object, points) {
  object.geometry.dispose();
  object.geometry = new BufferGeometry();
  object.geometry.setAttribute("position", new BufferAttribute(points, 3));
}

const triangulate = (ring) => ShapeUtils.triangulateShape(ring.map(({ x, z }) => new Vector2(x, z)), []);
const distance = (a, b) => Math.hypot(a.x - b.x, a.y - b.y, a.z - b.z);
const same = (a, b) => a.length === b.length && JSON.stringify(a) === JSON.stringify(b);
