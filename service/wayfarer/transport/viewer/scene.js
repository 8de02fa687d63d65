// The stage: camera, light, ground. Y up, metres, people face +Z at heading 0.

import {
  CanvasTexture, Color, DirectionalLight, Fog, HemisphereLight, Mesh, MeshStandardMaterial,
  OrbitControls, PCFShadowMap, PerspectiveCamera, Plane, PlaneGeometry, Raycaster, RepeatWrapping,
  SRGBColorSpace, Scene, Vector2, Vector3, WebGLRenderer,
} from "./vendor/three.min.js";

const SKY = new Color("#dfe6ea");
const FLOOR_SIZE = 240; // metres
const SUN = new Vector3(5, 11, 6);
const LOOKS = [
  { pixels: 2, shadows: true },
  { pixels: 1, shadows: true },
  { pixels: 0.75, shadows: false },
]; // from the best to what a machine without a graphics card can do
const SLOW_FPS = 20;
const PATIENCE = 4; // slow readings in a row before the look is made lighter
const SHADED = 14; // metres around the point looked at that have shadows

export class Stage {
  constructor(canvas) {
    this.canvas = canvas;
    this.renderer = new WebGLRenderer({ canvas, antialias: true });
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.type = PCFShadowMap;
    this.scene = new Scene();
    this.scene.background = SKY;
    this.scene.fog = new Fog(SKY, 25, 90);
    this.camera = new PerspectiveCamera(42, 1, 0.1, 200);
    this.camera.position.set(5.5, 3.6, 8.5);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.target.set(0, 0.9, 0);
    this.controls.enableDamping = true;
    this.controls.minDistance = 1.5;
    this.controls.maxDistance = 60;
    this.controls.maxPolarAngle = Math.PI / 2 - 0.03;
    this.#addLight();
    this.#addFloor();
    this.look = 0;
    this.slow = 0;
    new ResizeObserver(() => this.resize()).observe(canvas);
    this.resize();
  }

  add(object) {
    this.scene.add(object);
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    this.renderer.setPixelRatio(Math.min(globalThis.devicePixelRatio, LOOKS[this.look].pixels));
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / Math.max(1, height);
    this.camera.updateProjectionMatrix();
  }

  /** Make the look lighter on a machine that is too slow for it. */
  keepUp(fps) {
    this.slow = fps < SLOW_FPS ? this.slow + 1 : 0;
    if (this.slow < PATIENCE || this.look === LOOKS.length - 1) return;
    this.slow = 0;
    this.look += 1;
    this.sun.castShadow = LOOKS[this.look].shadows;
    this.resize();
  }

  /** Let the camera travel with a point of the floor, keeping its angle. */
  follow(x, z, seconds) {
    const share = 1 - Math.exp(-4 * seconds);
    const move = new Vector3(x, 0.9, z).sub(this.controls.target).multiplyScalar(share);
    this.controls.target.add(move);
    this.camera.position.add(move);
  }

  render() {
    this.controls.update();
    // the shadow map covers what is looked at; whole metres, so that its texels do not swim
    const { x, z } = this.controls.target;
    this.sun.target.position.set(Math.round(x), 0, Math.round(z));
    this.sun.position.copy(this.sun.target.position).add(SUN);
    this.renderer.render(this.scene, this.camera);
  }

  /** Ray through a pointer event. */
  ray(event) {
    const box = this.canvas.getBoundingClientRect();
    const x = ((event.clientX - box.left) / box.width) * 2 - 1;
    const y = 1 - ((event.clientY - box.top) / box.height) * 2;
    const caster = new Raycaster();
    caster.setFromCamera(new Vector2(x, y), this.camera);
    return caster.ray;
  }

  /** Where a ray meets the floor, or null (sky, or too far). */
  floorPoint(ray) {
    const point = ray.intersectPlane(new Plane(new Vector3(0, 1, 0), 0), new Vector3());
    return point && point.distanceTo(this.camera.position) < 100 ? point : null;
  }

  #addLight() {
    this.scene.add(new HemisphereLight("#ffffff", "#c9bda8", 1.5));
    this.sun = new DirectionalLight("#fff3e0", 2.2);
    this.sun.castShadow = true;
    this.sun.shadow.mapSize.set(2048, 2048);
    this.sun.shadow.radius = 3;
    this.sun.shadow.normalBias = 0.02;
    Object.assign(this.sun.shadow.camera, {
      left: -SHADED, right: SHADED, top: SHADED, bottom: -SHADED, near: 1, far: 40,
    });
    this.scene.add(this.sun, this.sun.target);
  }

  #addFloor() {
    const material = new MeshStandardMaterial({ map: floorTexture(), roughness: 1 });
    material.map.repeat.set(FLOOR_SIZE / 5, FLOOR_SIZE / 5);
    material.map.anisotropy = this.renderer.capabilities.getMaxAnisotropy();
    const floor = new Mesh(new PlaneGeometry(FLOOR_SIZE, FLOOR_SIZE), material);
    floor.rotation.x = -Math.PI / 2;
    floor.receiveShadow = true;
    this.scene.add(floor);
  }
}

/** A tile of 5 × 5 m: thin lines each metre, a stronger one at the edge. */
function floorTexture() {
  const size = 1024;
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = size;
  const pen = canvas.getContext("2d");
  pen.fillStyle = "#d9d6cf";
  pen.fillRect(0, 0, size, size);
  for (let metre = 0; metre <= 5; metre += 1) {
    const strong = metre % 5 === 0;
    pen.fillStyle = strong ? "#aaa79e" : "#c4c1b8";
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
