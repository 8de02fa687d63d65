// A stick on the screen for a thumb: how far it is pushed, and in which direction.

/** `well`: the element of the stick, whose first child is the knob. `pushed(right, forward)`, each −1 to 1, is called when it moves. */
export function watchStick(well, pushed) {
  const knob = well.firstElementChild;
  let pointer = null;
  const push = (right, forward) => {
    knob.style.transform = `translate(${right * 100}%, ${-forward * 100}%)`;
    pushed(right, forward);
  };
  const follow = ({ clientX, clientY }) => {
    const { left, top, width, height } = well.getBoundingClientRect();
    const right = (2 * (clientX - left)) / width - 1, forward = 1 - (2 * (clientY - top)) / height;
    const reach = Math.max(1, Math.hypot(right, forward));
    push(right / reach, forward / reach);
  };
  well.addEventListener("pointerdown", (event) => {
    if (pointer !== null) return;
    pointer = event.pointerId;
    well.setPointerCapture(pointer);
    follow(event);
  });
  well.addEventListener("pointermove", (event) => event.pointerId === pointer && follow(event));
  for (const end of ["pointerup", "pointercancel", "lostpointercapture"]) {
    well.addEventListener(end, (event) => {
      if (event.pointerId !== pointer) return;
      pointer = null;
      push(0, 0);
    });
  }
}
