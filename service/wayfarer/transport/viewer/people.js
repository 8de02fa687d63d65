// People on the stage: a skinned body, its marks on the floor, its trail and name.

import {
  BufferAttribute, BufferGeometry, CanvasTexture, DynamicDrawUsage, GLTFLoader, Group, Line,
  LineBasicMaterial, Mesh, MeshBasicMaterial, RingGeometry, SRGBColorSpace, Sprite, SpriteMaterial,
} from "./vendor/three.min.js";

const TRAIL_POINTS = 200;
const TRAIL_STEP = 0.12; // metres between two points
const ACCENT = "#0b7285";

/** A flat ring on the floor, or the arc of it around a heading. */
export function floorRing(inner, outer, colour, opacity = 0.9, { heading = 0, width = 2 * Math.PI } = {}) {
  const material = new MeshBasicMaterial({
    color: colour, transparent: true, opacity, depthWrite: false,
    polygonOffset: true, polygonOffsetFactor: -2,
  });
  const ring = new Mesh(new RingGeometry(inner, outer, 48, 1, heading - (Math.PI + width) / 2, width), material);
  ring.rotation.x = -Math.PI / 2;
  ring.position.y = 0.006;
  return ring;
}

/** What is seen of one agent. `boneNames` gives the order of the rotations in a frame. */
export class Person {
  constructor(agent, boneNames) {
    this.agent = agent;
    this.boneNames = boneNames;
    this.x = 0;
    this.z = 0;
    this.height = 1.75; // metres, of the name above the head; set from the mesh
    this.bones = null;
    this.group = new Group();
    this.marker = floorRing(0.36, 0.42, ACCENT);
    this.marker.visible = false;
    this.path = new Group(); // a mark for each goal ahead
    this.ahead = []; // { x, z, heading? … }
    this.passed = 0; // goals of its path that are behind it
    this.revision = 0; // of its path, as far as the server has told
    this.wanders = false; // where to, only the server knows
    this.trail = new Trail(colourOf(agent.alias));
    this.label = label(agent.name);
    this.label.visible = false;
    this.group.add(this.marker, this.path, this.trail.line, this.label);
  }

  /** Load the mesh; the person appears with its first pose. */
  async load(url, headers = {}) {
    const loader = new GLTFLoader().setRequestHeader(headers);
    const { scene } = await loader.loadAsync(url);
    scene.traverse((node) => {
      if (!node.isSkinnedMesh) return;
      node.castShadow = true;
      node.frustumCulled = false; // its bounds are those of the bind pose, at the origin
      node.geometry.computeBoundingBox();
      const { min, max } = node.geometry.boundingBox;
      this.height = max.y - min.y;
    });
    const bones = this.boneNames.map((name) => scene.getObjectByName(name));
    const missing = this.boneNames.filter((_, index) => !bones[index]);
    if (missing.length) throw new Error(`the body has no bone ${missing.join(", ")}`);
    scene.visible = false;
    this.body = scene;
    this.bones = bones;
    this.group.add(scene);
  }

  /** Show a frame: hips x, y, z, then x, y, z, w per bone. */
  pose(frame) {
    [this.x, , this.z] = frame;
    this.marker.position.x = this.label.position.x = this.x;
    this.marker.position.z = this.label.position.z = this.z;
    this.label.position.y = this.height + 0.22;
    this.trail.add(this.x, this.z);
    if (!this.bones) return;
    this.body.visible = true;
    this.bones[0].position.set(frame[0], frame[1], frame[2]);
    for (let bone = 0; bone < this.bones.length; bone += 1) {
      this.bones[bone].quaternion.fromArray(frame, 3 + 4 * bone);
    }
  }

  /** Show goals ahead; what is reached counts again once their `revision` is known. */
  showPath(goals) {
    discard(this.path.children);
    this.ahead = goals;
    this.passed = 0;
    this.revision = Infinity;
    this.path.add(...goals.map((goal) => goalMark(goal, colourOf(this.agent.alias))));
  }

  /** Show goals that were added to the end of the path. */
  extendPath(goals) {
    this.ahead = [...this.ahead, ...goals];
    this.path.add(...goals.map((goal) => goalMark(goal, colourOf(this.agent.alias))));
  }

  /** Goal `waypoint` of the path of a revision was reached. */
  reach(revision, waypoint) {
    const count = waypoint + 1 - this.passed;
    if (this.wanders || revision < this.revision || count <= 0) return; // of a path before this one
    this.passed = waypoint + 1;
    this.ahead = this.ahead.slice(count);
    discard(this.path.children.slice(0, count));
  }

  dispose() {
    discard([this.group]);
  }
}

function discard(objects) {
  for (const object of [...objects]) {
    object.removeFromParent();
    object.traverse((node) => {
      node.geometry?.dispose();
      node.skeleton?.dispose();
      node.material?.map?.dispose();
      node.material?.dispose();
    });
  }
}

/** A ring, with an arc before it where a heading is to be faced. */
function goalMark({ x, z, heading }, colour) {
  const mark = new Group();
  mark.position.set(x, 0, z);
  mark.add(floorRing(0.24, 0.3, colour));
  if (heading !== undefined) mark.add(floorRing(0.36, 0.46, colour, 0.9, { heading, width: 0.8 }));
  return mark;
}

class Trail {
  constructor(colour) {
    this.points = new Float32Array(3 * TRAIL_POINTS);
    this.count = 0;
    this.geometry = new BufferGeometry();
    this.attribute = new BufferAttribute(this.points, 3).setUsage(DynamicDrawUsage);
    this.geometry.setAttribute("position", this.attribute);
    this.line = new Line(this.geometry, new LineBasicMaterial({ color: colour }));
    this.line.frustumCulled = false;
    this.line.visible = false;
  }

  add(x, z) {
    const last = 3 * (this.count - 1);
    if (this.count && Math.hypot(x - this.points[last], z - this.points[last + 2]) < TRAIL_STEP) return;
    if (this.count === TRAIL_POINTS) {
      this.points.copyWithin(0, 3);
      this.count -= 1;
    }
    this.points.set([x, 0.012, z], 3 * this.count);
    this.count += 1;
    this.attribute.needsUpdate = true;
    this.geometry.setDrawRange(0, this.count);
  }
}

/** Well spread hues: steps of the golden angle. */
function colourOf(alias) {
  return `hsl(${Math.round((alias * 137.5) % 360)}, 62%, 42%)`;
}

function label(text) {
  const canvas = document.createElement("canvas");
  canvas.width = 256;
  canvas.height = 64;
  const pen = canvas.getContext("2d");
  pen.font = "600 34px system-ui, sans-serif";
  const width = Math.min(250, pen.measureText(text).width + 36);
  pen.fillStyle = "rgb(255 255 255 / 85%)";
  pen.beginPath();
  pen.roundRect((256 - width) / 2, 6, width, 52, 18);
  pen.fill();
  pen.fillStyle = "#22303a";
  pen.textAlign = "center";
  pen.textBaseline = "middle";
  pen.fillText(text, 128, 34, 220);
  const map = new CanvasTexture(canvas);
  map.colorSpace = SRGBColorSpace;
  // the same size on the screen however far
  const sprite = new Sprite(new SpriteMaterial({ map, depthTest: false, sizeAttenuation: false }));
  sprite.scale.set(0.12, 0.03, 1);
  return sprite;
}
