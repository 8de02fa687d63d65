// The scene of this page's session: the choice of scenes, its contents, and their changes. No DOM.

import { Latest } from "./latest_call.js";

const CRATE = { side: 1, height: 0.9 }; // metres

/** Converts the answer of GET /v1/scenes/{id}/outlines to points { x, y, z } and blocks. */
export function outlinesOf({ vertices, triangles, solids, obstacles, version }) {
  const block = ({ top, bottom }) => ({ top: pointsOf(top), bottom });
  return {
    version,
    vertices: pointsOf(vertices),
    triangles: threes(triangles),
    solids: solids.map(block),
    obstacles: new Map(obstacles.map((obstacle) => [obstacle.name, block(obstacle)])),
  };
}

/** The choices [{ value, text, example?, scene? }]; an example that exists already is joined. */
export function choicesOf(examples, scenes) {
  const there = new Map(scenes.map((scene) => [scene.name, scene]));
  const names = new Set(examples.map(({ name }) => name));
  const others = scenes.filter(({ name }) => !names.has(name));
  return [
    ...examples.map(({ name, summary }) => ({
      value: name, text: name.replaceAll("_", " "), summary, example: name, scene: there.get(name)?.scene_id,
    })),
    ...others.map(({ scene_id: scene, name }) => ({ value: scene, text: name || scene, scene })),
  ];
}

/** A crate that stands on a point of the ground, as a block { top, bottom }. */
export function crateOn({ x, y, z }) {
  const half = CRATE.side / 2;
  const corners = [[half, half], [half, -half], [-half, -half], [-half, half]];
  return { top: corners.map(([dx, dz]) => ({ x: x + dx, y: y + CRATE.height, z: z + dz })), bottom: y };
}

/** A block in the form of the API. */
export function prismOf({ top, bottom }) {
  return { prism: { outline: top, bottom, height: top[0].y - bottom } };
}

/** The file formats that a level may have, by a file's name; or null. */
export function meshFormat(fileName) {
  const ending = fileName.toLowerCase().split(".").at(-1);
  return ["glb", "obj", "ply"].includes(ending) ? ending : null;
}

/**
 * The scene that is shown. `on` has changed(outlines) for other ground or obstacles than before, moved(obstacles) while an obstacle
 * moves, gone() for a deleted scene, and failed(error).
 */
export class SceneBook {
  constructor(api, on) {
    this.api = api;
    this.on = on;
    this.id = "";
    this.version = -1;
    this.opening = false;
    this.obstacles = new Map(); // name → block, as shown
    this.refreshing = new Latest((id) => this.#refresh(id), (error) => this.#failed(error));
    this.moving = new Map(); // name → Latest
    this.crates = 0;
  }

  /** Shows another scene, or with "" none. */
  async open(id) {
    this.id = id;
    this.version = -1;
    this.obstacles = new Map();
    this.moving.clear();
    this.opening = true; // a poll would ask for the same outlines again
    try {
      if (id) await this.#refresh(id);
    } finally {
      this.opening = false;
    }
  }

  /** Looks for changes by others. */
  async poll() {
    const { id } = this;
    if (!id || this.moving.size || this.opening) return;
    try {
      const { version } = await this.api.scene(id);
      if (id === this.id && version !== this.version) await this.refreshing.push(id);
    } catch (error) {
      this.#failed(error);
    }
  }

  /** A new crate; a promise of its name. */
  async addCrate(point, random = Math.random) {
    this.crates += 1;
    const name = `crate ${this.crates} ${Math.floor(random() * 36 ** 4).toString(36)}`;
    await this.move(name, crateOn(point));
    return name;
  }

  /** Moves an obstacle: shown at once, and sent to the server as fast as it accepts it. */
  move(name, block) {
    const { id } = this;
    this.obstacles = new Map(this.obstacles).set(name, block);
    this.on.moved(this.obstacles);
    let mover = this.moving.get(name);
    if (!mover) {
      mover = new Latest((latest) => this.api.putObstacle(id, name, prismOf(latest)), (error) => this.on.failed(error));
      this.moving.set(name, mover);
    }
    return mover.push(block).then(() => this.#settle(id, name, mover));
  }

  async remove(name) {
    const { id } = this;
    await this.api.removeObstacle(id, name);
    await this.refreshing.push(id);
  }

  /** Takes the server's answer as its place. */
  async #settle(id, name, mover) {
    if (this.moving.get(name) === mover) this.moving.delete(name);
    if (id === this.id) await this.refreshing.push(id);
  }

  async #refresh(id) {
    const outlines = outlinesOf(await this.api.sceneOutlines(id));
    if (id !== this.id) return;
    this.version = outlines.version;
    // the dragged crate stays where the pointer is
    for (const name of this.moving.keys()) {
      if (this.obstacles.has(name)) outlines.obstacles.set(name, this.obstacles.get(name));
    }
    this.obstacles = outlines.obstacles;
    this.on.changed(outlines);
  }

  #failed(error) {
    if (error.status === 404) this.on.gone();
    else this.on.failed(error);
  }
}

function pointsOf(numbers) {
  return threes(numbers).map(([x, y, z]) => ({ x, y, z }));
}

function threes(numbers) {
  return Array.from({ length: numbers.length / 3 }, (_, k) => [numbers[3 * k], numbers[3 * k + 1], numbers[3 * k + 2]]);
}
