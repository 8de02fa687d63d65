"""The stage of the page, as a test needs it."""

from tests.viewer.chromium import Page

PEOPLE = "globalThis.wayfarer.crowd.people"
NAMES = f"{PEOPLE}.map(({{ agent }}) => agent.name).sort()"
SHOWN = f"{PEOPLE}.filter(({{ shown }}) => shown).length"

SIZES = ((1440, 900), (844, 390), (390, 844))
"""Sizes of the windows in which the page is tested: a desk's, and a phone's."""

FIRST_SECONDS = """(() => {
  const at = globalThis.firstSeen = {};
  (function look() {
    const { stage, session, crowd } = globalThis.wayfarer ?? {};
    const now = performance.now() / 1000;
    if (crowd) at["page runs"] ??= now;
    if (session) at["session is open"] ??= now;
    if (stage?.renderer) at["stage is made"] ??= now;
    const shown = crowd?.people.filter((person) => person.shown) ?? [];
    if (shown.length) at["somebody is there"] ??= now;
    if (shown.some(({ played }) => played.state === "walking")) {
      const gl = stage.renderer.getContext(); // waits until the picture is finished
      gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
      at["people walk in a finished picture"] = performance.now() / 1000;
    } else setTimeout(look, 20);
  })();
})()"""
"""A script: when each step of the first seconds was done, in `firstSeen`."""

FREE_SPOT = """(() => {
  const { camera } = wayfarer.stage;
  for (let x = -6; x <= 6; x += 0.5) for (let z = 3; z <= 9; z += 0.5) {
    const y = wayfarer.level.ground.heightAt(x, z, 0);
    const gaps = wayfarer.crowd.people.map((one) => Math.hypot(one.x - x, one.z - z));
    if (y === null || Math.min(...gaps) < 1.5) continue;
    const p = camera.position.clone().set(x, y, z).project(camera);
    const [u, v] = [(p.x + 1) / 2 * innerWidth, (1 - p.y) / 2 * innerHeight];
    const on = document.elementFromPoint(u, v)?.id === "view";
    // nobody is before it, or will be in a moment
    const ray = (du) => wayfarer.stage.ray({ clientX: u + du, clientY: v });
    if ([-60, -30, 0, 30, 60].some((du) => wayfarer.tools.personAt(ray(du)))) continue;
    const met = on && wayfarer.level.meets(wayfarer.stage.ray({ clientX: u, clientY: v }));
    if (met && Math.hypot(met.point.x - x, met.point.z - z) < 0.2) return [u, v];
  }
  return null;
})()"""
"""A point of the window over free ground, with nothing in front and nobody near; or null."""


def on_screen(page: Page, x: float, y: float, z: float) -> tuple[float, float]:
    """Where a point of the scene is seen, CSS pixels."""
    page.evaluate("wayfarer.stage.controls.update(); wayfarer.stage.render()")
    right, up = page.evaluate(
        "(() => { const { camera } = wayfarer.stage;"
        f" const p = camera.position.clone().set({x}, {y}, {z}).project(camera);"
        " return [p.x, p.y]; })()"
    )
    width, height = page.evaluate("[innerWidth, innerHeight]")
    return (right + 1) / 2 * width, (1 - up) / 2 * height


def look_down(page: Page, x: float, z: float, height: float) -> None:
    """Looks from straight above, so that nothing hides the ground."""
    page.evaluate(
        f"wayfarer.stage.glide({{ x: {x}, y: {height}, z: {z} + 0.01 }},"
        f" {{ x: {x}, y: 0, z: {z} }}, 1)"
    )


def press(page: Page, key: str) -> None:
    for kind in ("keyDown", "keyUp"):
        page.call("Input.dispatchKeyEvent", type=kind, key=key)
