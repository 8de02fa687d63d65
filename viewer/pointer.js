// Mouse, pen and finger on the stage: presses, clicks and drags. An unclaimed drag turns the camera.

const CLICK_PIXELS = 5; // a pointer that moved more was a drag

/**
 * `on.press(event)` returns what a drag from there moves: { move(event), drop(event), cancel() }, or null for the camera.
 * `on.click(event)` is a press that moved nowhere. `controls` are the camera's.
 */
export function watchPointer(view, controls, on) {
  let pressed = null;
  view.addEventListener("pointerdown", (event) => {
    if (!event.isPrimary || event.button !== 0) return;
    pressed = { x: event.clientX, y: event.clientY, taken: on.press(event), moved: false };
    if (!pressed.taken) return;
    controls.enabled = false;
    view.setPointerCapture(event.pointerId);
  }, { capture: true });
  view.addEventListener("pointermove", (event) => {
    if (!pressed || !event.isPrimary) return;
    pressed.moved ||= Math.hypot(event.clientX - pressed.x, event.clientY - pressed.y) > CLICK_PIXELS;
    if (pressed.moved) pressed.taken?.move?.(event);
  });
  const release = (event, cancelled) => {
    if (!pressed || !event.isPrimary) return;
    const { taken, moved } = pressed;
    pressed = null;
    if (taken) controls.enabled = true;
    if (cancelled) return taken?.cancel?.();
    if (taken && (moved || taken.always)) taken.drop(event);
    else if (!moved) on.click(event);
  };
  view.addEventListener("pointerup", (event) => release(event, false));
  view.addEventListener("pointercancel", (event) => release(event, true));
}
