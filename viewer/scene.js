// The stage: camera, light, ground. Y up, metres, people face +Z at heading 0.

import {
  ACESFilmicToneMapping, BackSide, Color, DirectionalLight, Fog, HemisphereLight, Mesh, MeshBasicMaterial, MeshLambertMaterial,
  OrbitControls, PCFShadowMap, PerspectiveCamera, PlaneGeometry, Raycaster, Scene, SphereGeometry, Vector2, Vector3, WebGLRenderer,
} from "./vendor/three.min.js";
import { floorTexture, skyTexture } from "./textures.js";
import { vantageOf } from "./vantage.js";

const TIMES = { // of day: as the page is light or dark
  day: { sky: ["#7fb2d6", "#dfeaf0"], haze: "#dfeaf0", sun: "#fff0d8", strength: 2.9, above: "#dbeaf7", below: "#b3a78f", fill: 1.5, floor: "#ffffff", lamps: "#000000" },
  night: { sky: ["#0b1526", "#24344d"], haze: "#24344d", sun: "#c9d8ff", strength: 1.7, above: "#9db2d8", below: "#5a6274", fill: 1.7, floor: "#e2e5ec", lamps: "#ffc46b" },
};
const SKY_RADIUS = 450; // metres
const FLOOR_SIZE = 1000; // metres
const HOME = [5.5, 3.6, 8.5]; // of the camera without a scene
const OPENING = { wide: 42, tall: 58 }; // vertical opening of the camera in degrees: greater if the picture is narrow
const SUN = new Vector3(5, 11, 6);
const LOOKS = [
  { pixels: 2, shadows: true, sharpness: 16 },
  { pixels: 1, shadows: true, sharpness: 16 },
  { pixels: 0.6, shadows: false, sharpness: 1 },
]; // from the best to what a machine without a graphics card can do; `sharpness`: anisotropy of the ground, most of its cost there
const SOFTWARE = /swiftshader|llvmpipe|softpipe|software|basic render/i; // names of renderers without a graphics card
const SLOW_FPS = 20;
const PATIENCE = 4; // slow readings in a row before the look is made lighter
const SHADED = [14, 48]; // metres around the point looked at that have shadows: from near, from afar
const FAR = [45, 160]; // metres: where fog begins and ends when the camera is near; farther if it is far
const LEANING = 0.72; // steepness of a view of the whole scene: 0 level, 1 straight down

/** Light of lamps and windows by the time of day. */
export const LAMPLIGHT = new Color();

/** The browser shows no 3D. */
export class NoPicture extends Error {}

export class Stage {
  constructor(canvas) {
    this.canvas = canvas;
    this.renderer = null; // until `begin`
    this.scene = new Scene();
    this.scene.matrixAutoUpdate = false; // it does not move, or the matrices of all that is in it would be computed each time
    this.scene.fog = new Fog("#dfeaf0", ...FAR);
    this.camera = new PerspectiveCamera(OPENING.wide, 1, 0.15, 600);
    this.controls = new OrbitControls(this.camera, canvas);
    this.overlook(null);
    this.controls.enableDamping = true;
    this.controls.minDistance = 1.5;
    this.controls.maxDistance = 150;
    this.controls.maxPolarAngle = Math.PI / 2 - 0.03;
    this.#addLight();
    this.#addFloor();
    this.#addSky();
    const dark = matchMedia("(prefers-color-scheme: dark)");
    const follow = () => this.#turn(dark.matches ? TIMES.night : TIMES.day);
    dark.addEventListener("change", follow);
    follow();
    this.look = 0;
    this.slow = 0;
  }

  /**
   * Begins to draw, with `frame()` before each picture. It takes long, so requests to the server should be sent before. `look`: number
   * of the look to begin with and keep, or the nearest that exists; by default, the best for the machine. Throws NoPicture.
   */
  begin(frame, look = null) {
    if (this.renderer) return;
    const least = look === null && drawnBySoftware() ? LOOKS.length - 1 : 0;
    // smooth edges cannot be switched off later, and double the time of a picture without a graphics card
    const context = this.canvas.getContext("webgl2", { antialias: least === 0 });
    if (!context) throw new NoPicture();
    this.renderer = new WebGLRenderer({ canvas: this.canvas, context });
    this.renderer.debug.checkShaderErrors = false; // the page would wait for each shader
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.type = PCFShadowMap;
    this.renderer.toneMapping = ACESFilmicToneMapping;
    this.renderer.toneMappingExposure = 1.05;
    this.steady = look !== null;
    this.#take(look === null ? least : Math.min(LOOKS.length - 1, Math.max(0, Math.round(look) || 0)));
    new ResizeObserver(() => this.resize()).observe(this.canvas);
    this.resize();
    this.#compile()
      .catch((error) => console.error("The shaders are made with the first picture:", error))
      .then(() => this.renderer.setAnimationLoop(frame));
  }

  /** Makes the shaders, in the background if the browser can. */
  async #compile() {
    const { renderer, scene, camera } = this;
    if (renderer.extensions.has("KHR_parallel_shader_compile")) await renderer.compileAsync(scene, camera);
    else renderer.compile(scene, camera);
  }

  /** Takes the look of a number. */
  #take(look) {
    this.look = look;
    const { shadows, sharpness } = LOOKS[look];
    this.sun.castShadow = shadows;
    this.scene.traverse(({ material }) => {
      if (!material?.map || material.map.anisotropy === sharpness) return;
      material.map.anisotropy = sharpness;
      material.map.needsUpdate = true;
    });
  }

  add(object) {
    this.scene.add(object);
  }

  remove(object) {
    this.scene.remove(object);
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    this.renderer?.setPixelRatio(Math.min(globalThis.devicePixelRatio, LOOKS[this.look].pixels));
    this.renderer?.setSize(width, height, false);
    this.camera.aspect = width / Math.max(1, height);
    this.camera.fov = width < height ? OPENING.tall : OPENING.wide;
    this.camera.updateProjectionMatrix();
  }

  /** Makes the look lighter on a machine that is too slow for it. */
  keepUp(fps) {
    this.slow = fps < SLOW_FPS ? this.slow + 1 : 0;
    if (this.slow < PATIENCE || this.look === LOOKS.length - 1 || this.steady) return;
    this.slow = 0;
    this.#take(this.look + 1);
    this.resize();
  }

  /** Moves the camera with a point of the ground, at the same angle. */
  follow({ x, y, z }, seconds) {
    const share = 1 - Math.exp(-4 * seconds);
    const move = new Vector3(x, y + 0.9, z).sub(this.controls.target).multiplyScalar(share);
    this.controls.target.add(move);
    this.camera.position.add(move);
  }

  /** Looks at a whole place { x, z, size }; without one, at the middle of the floor. */
  overlook(place) {
    const target = new Vector3(place?.x ?? 0, 0.9, place?.z ?? 0);
    const eye = new Vector3(...HOME);
    if (place) {
      const away = Math.max(8, (0.62 * place.size) / Math.tan((this.camera.fov * Math.PI) / 360));
      eye.set(0.35, LEANING, 1 - LEANING / 2).normalize().multiplyScalar(away).add(target);
    }
    this.#move(eye, target, 1);
  }

  /** Looks at a level from so near that people are recognised. Returns how many should walk there, and where: { count, area }. */
  approach(level) {
    const { clientWidth: width, clientHeight: height } = this.canvas; // the camera's aspect comes with the first picture
    const tall = width < height, up = Math.tan((OPENING[tall ? "tall" : "wide"] * Math.PI) / 360);
    const { eye, target, area, count } = vantageOf(level, level.extent, { opening: (up * width) / Math.max(1, height), tall });
    this.glide(eye, target, 1);
    return { area, count };
  }

  /** Looks from the place `eye` at the place `target`, each [x, y, z]. */
  lookFrom({ eye, target }) {
    this.#move(new Vector3(...eye), new Vector3(...target), 1);
  }

  /** Brings the camera nearer to a place and its target. */
  glide(eye, target, share) {
    this.#move(new Vector3(eye.x, eye.y, eye.z), new Vector3(target.x, target.y, target.z), share);
    this.camera.lookAt(this.controls.target);
  }

  /** The height of the endless floor. */
  lower(height) {
    this.floor.position.y = height;
  }

  render() {
    if (this.controls.enabled) this.controls.update();
    this.#cover();
    this.renderer.render(this.scene, this.camera);
  }

  #move(eye, target, share) {
    this.camera.position.lerp(eye, share);
    this.controls.target.lerp(target, share);
  }

  /** Sets the shadows around the target and the fog behind it, in whole metres, so that texels do not swim. */
  #cover() {
    const { target } = this.controls;
    this.sky.position.copy(this.camera.position);
    const away = this.camera.position.distanceTo(target);
    this.scene.fog.near = Math.max(FAR[0], 1.6 * away);
    this.scene.fog.far = Math.max(FAR[1], 5 * away);
    const reach = Math.min(SHADED[1], Math.max(SHADED[0], 4 * Math.ceil(away / 4)));
    if (reach !== this.shaded) {
      this.shaded = reach;
      Object.assign(this.sun.shadow.camera, {
        left: -reach, right: reach, top: reach, bottom: -reach, near: 1, far: 4 * reach + 40,
      });
      this.sun.shadow.camera.updateProjectionMatrix();
      this.sun.shadow.normalBias = 0.0015 * reach;
    }
    this.sun.target.position.set(Math.round(target.x), 0, Math.round(target.z));
    this.sun.position.copy(SUN).multiplyScalar(1 + reach / 6).add(this.sun.target.position);
  }

  /** Where a point { x, y, z } appears, as pointer events have it; null behind the camera. */
  seenAt({ x, y, z }) {
    const at = new Vector3(x, y, z).project(this.camera);
    const box = this.canvas.getBoundingClientRect();
    return at.z < 1 ? { x: box.left + ((at.x + 1) / 2) * box.width, y: box.top + ((1 - at.y) / 2) * box.height } : null;
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

  #addLight() {
    this.fill = new HemisphereLight("#ffffff", "#c9bda8", 1.5);
    this.scene.add(this.fill);
    this.sun = new DirectionalLight("#fff3e0", 2.2);
    this.sun.castShadow = true;
    this.sun.shadow.mapSize.set(2048, 2048);
    this.sun.shadow.radius = 3;
    this.scene.add(this.sun, this.sun.target);
  }

  #addSky() {
    const material = new MeshBasicMaterial({ side: BackSide, fog: false, depthWrite: false, toneMapped: false });
    this.sky = new Mesh(new SphereGeometry(SKY_RADIUS, 24, 16), material);
    this.sky.renderOrder = -1;
    this.scene.add(this.sky);
  }

  /** Light, sky and haze of a time of day. */
  #turn({ sky, haze, sun, strength, above, below, fill, floor, lamps }) {
    LAMPLIGHT.set(lamps);
    this.sky.material.map?.dispose();
    this.sky.material.map = skyTexture(...sky);
    this.sky.material.needsUpdate = true;
    this.scene.fog.color.set(haze);
    this.sun.color.set(sun);
    this.sun.intensity = strength;
    this.fill.color.set(above);
    this.fill.groundColor.set(below);
    this.fill.intensity = fill;
    this.floor.material.color.set(floor);
  }

  #addFloor() {
    const material = new MeshLambertMaterial({ map: floorTexture() });
    material.map.repeat.set(FLOOR_SIZE / 5, FLOOR_SIZE / 5);
    this.floor = new Mesh(new PlaneGeometry(FLOOR_SIZE, FLOOR_SIZE), material);
    this.floor.rotation.x = -Math.PI / 2;
    this.floor.receiveShadow = true;
    this.scene.add(this.floor);
  }
}

/** Whether this browser draws without a graphics card, as far as it reveals that. */
function drawnBySoftware() {
  const probe = document.createElement("canvas").getContext("webgl2");
  const named = probe?.getExtension("WEBGL_debug_renderer_info");
  const found = Boolean(named) && SOFTWARE.test(probe.getParameter(named.UNMASKED_RENDERER_WEBGL));
  probe?.getExtension("WEBGL_lose_context")?.loseContext();
  return found;
}
