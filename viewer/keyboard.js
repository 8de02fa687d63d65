// Keys on the stage; outside of it, letters belong to the user.

const STEP = 0.25; // metres
const ARROWS = { ArrowUp: [0, -STEP], ArrowDown: [0, STEP], ArrowLeft: [-STEP, 0], ArrowRight: [STEP, 0] };

/** `arrow(dx, dz)` in metres, `enter()`, `held(key)`: whether a letter drives a person, `keys`: actions of other keys by name in small letters. */
export function watchKeys(view, { arrow, enter, held, keys }) {
  view.addEventListener("keydown", (event) => {
    if (event.key in ARROWS) {
      arrow(...ARROWS[event.key]);
      event.preventDefault();
    } else if (event.key === "Enter") {
      enter();
    }
  });
  // the page gives the stage the focus when it opens, so browsers frame it before a key has been pressed
  addEventListener("pointerdown", () => view.classList.remove("keys"), { capture: true });
  addEventListener("keydown", (event) => {
    view.classList.add("keys");
    const meant = event.target === view || (event.key.length > 1 && !event.target.matches?.("select, input"));
    const key = event.key.toLowerCase();
    if (meant && !event.ctrlKey && !event.metaKey && !event.altKey && !held(key)) keys[key]?.();
  });
}
