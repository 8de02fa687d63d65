"""The stage of the page, as a test needs it."""

from tests.viewer.chromium import Page


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
    """From straight above, so that nothing hides the ground."""
    page.evaluate(
        f"wayfarer.stage.glide({{ x: {x}, y: {height}, z: {z} + 0.01 }},"
        f" {{ x: {x}, y: 0, z: {z} }}, 1)"
    )
