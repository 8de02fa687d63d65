// The view of the timeline: buttons, slider, and a strip of the selected person's speed and steps.

import { byId } from "./hud.js";
import { FRAME } from "./timeline.js";

const DRAW_SECONDS = 0.2;
const FASTEST = 2.4; // m/s at the upper edge of the strip

export class TimelineBar {
  /** `person()` returns the person whose strip is shown, or null. */
  constructor(timeline, history, person) {
    Object.assign(this, { timeline, history, person });
    this.drawn = -Infinity;
    this.asked = false; // whether the user paused to see it
    byId("pause").onclick = () => this.toggle();
    byId("frame-back").onclick = () => timeline.step(-1);
    byId("frame-on").onclick = () => timeline.step(1);
    byId("live").onclick = () => timeline.goLive();
    byId("moment").oninput = ({ target }) => timeline.scrub(Number(target.value) / Number(target.max));
    byId("rate").onchange = ({ target }) => timeline.setRate(Number(target.value));
  }

  /** Pauses or resumes. */
  toggle() {
    const { timeline } = this;
    if (timeline.live || timeline.playing) timeline.pause();
    else timeline.play();
  }

  /** Called once per picture, at local time `now`; `open`: all controls are shown. */
  frame(now, open) {
    const { timeline, history } = this;
    const shown = open || !timeline.live;
    if (byId("timeline").hidden === shown) byId("timeline").hidden = !shown;
    if (!shown || now - this.drawn < DRAW_SECONDS) return;
    this.drawn = now;
    const paused = !timeline.live && !timeline.playing;
    byId("pause").textContent = paused ? "Go on" : "Pause";
    byId("live").disabled = timeline.live;
    byId("rate").value = String(timeline.rate);
    const behind = timeline.live ? 0 : history.last - timeline.moment;
    byId("moment").value = String(Math.round(timeline.share * Number(byId("moment").max)));
    byId("moment").setAttribute("aria-valuetext", timeline.live ? "live" : `${behind.toFixed(1)} seconds ago`);
    byId("moment-shown").textContent = timeline.live ? "live" : `−${behind.toFixed(1)} s`;
    this.#draw(this.person());
  }

  /** Draws the speed as a line; below it, when the left and the right foot were on the ground. */
  #draw(person) {
    const canvas = byId("strip");
    const legend = byId("strip-legend");
    const text = person ? `${person.agent.name || "selected"}: speed up to ${FASTEST} m/s; left and right foot on the ground` : "Select a person to see speed and steps";
    if (legend.textContent !== text) legend.textContent = text;
    canvas.hidden = !person;
    if (!person) return;
    const width = canvas.width = Math.max(1, canvas.clientWidth), height = canvas.height = Math.max(1, canvas.clientHeight);
    const { first, last } = this.history;
    if (!(last - first > FRAME)) return;
    const pen = canvas.getContext("2d", { willReadFrequently: true });
    const style = getComputedStyle(canvas);
    const { speeds, contacts } = this.history.strip(person.agent.alias, first, last, width);
    const floor = height - 12;
    pen.fillStyle = style.getPropertyValue("--faint");
    for (let x = 0; x < width; x += 1) {
      if (contacts[x] & 1) pen.fillRect(x, floor + 2, 1, 4);
      if (contacts[x] & 2) pen.fillRect(x, floor + 8, 1, 4);
    }
    pen.strokeStyle = style.getPropertyValue("--accent");
    pen.lineWidth = 1.5;
    pen.beginPath();
    let down = false;
    speeds.forEach((speed, x) => {
      if (Number.isNaN(speed)) {
        down = false;
        return;
      }
      const y = floor - 2 - Math.min(1, speed / FASTEST) * (floor - 4);
      if (down) pen.lineTo(x, y);
      else pen.moveTo(x, y);
      down = true;
    });
    pen.stroke();
    pen.fillStyle = style.getPropertyValue("--bad");
    pen.fillRect(Math.round(this.timeline.share * (width - 2)), 0, 2, height);
  }
}
