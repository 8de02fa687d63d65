"""Time of a displayed frame of the page: `python -m benchmarks.frame_time [PEOPLE [SCENE]]`.

In a real browser against a real server, with the best look (shadows, fine bodies) and names shown.
The work of the graphics card is left out: draw calls are made, but nothing waits for them.

The server steps at most 30 people. The others are copies with their own bodies, for which the page
reads the same messages again.

The figure is the CPU time of the page's main thread from one displayed frame to the next: decoding
messages, the frame, garbage collection. The wall time is printed too; it includes the time of other
processes.
"""

import argparse
import os
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from tests.serving import Service
from tests.viewer.chromium import CONNECTION, Page
from tests.viewer.threads import NO_DRAWING, cpu_ms, main_thread

FRAMES = 600
FPS = 60
STEPPED = 30
COPIES = """(async (copies, client) => {
  const { MotionPlayer } = await import(client);
  const { player, crowd } = wayfarer;
  const players = Array.from({ length: copies }, (_, copy) => {
    const on = crowd.handlers(() => performance.now() / 1000);
    const added = (played) => {
      played.agent = { ...played.agent, alias: played.agent.alias + 10000 * (copy + 1) };
      on.added(played);
    };
    return new MotionPlayer({ ...on, added });
  });
  for (const name of ["begin", "receive", "advance"]) {
    const own = player[name].bind(player);
    player[name] = (...given) => {
      for (const other of players) other[name](...given);
      return own(...given);
    };
  }
  wayfarer.stream.reconnect(); // a connection begins with its header
})"""
BY_HAND = """
  wayfarer.stage.renderer.setAnimationLoop(null);
  globalThis.walls = [];
  globalThis.displayed = () => {
    const begun = performance.now();
    wayfarer.frame();
    walls.push(performance.now() - begun);
  };"""


def main(people: int, scene: str) -> None:
    """Print median and 95th percentile."""
    profile = Path(tempfile.mkdtemp())
    with Service() as service, Page(profile, (1440, 900)) as page:
        page.call("Page.addScriptToEvaluateOnNewDocument", source=NO_DRAWING)
        page.call("Page.navigate", url=f"{service.url}/?scene={scene}&people=0&look=0")
        page.wait_for(f"globalThis.wayfarer?.stage.renderer && {CONNECTION} === 'open'", 60)
        stepped = min(people, STEPPED)
        page.evaluate(f"{COPIES}({-(-people // stepped) - 1}, '{service.url}/client/index.js')")
        page.wait_for(f"{CONNECTION} === 'open'", 60)
        page.evaluate(f"wayfarer.arrivals.roamers({stepped})")
        page.evaluate("document.querySelector('#labels').click()")
        shown = "wayfarer.crowd.people.filter((person) => person.shown).length"
        page.wait_for(f"{shown} >= {people}", 300)
        fine = "wayfarer.crowd.people.filter((person) => person.fine).length"
        page.wait_for(f"{fine} >= {min(people, 24)} && !wayfarer.crowd.refining", 120)
        time.sleep(10)  # names have been drawn, shaders and functions are compiled
        page.evaluate(f"{{{BY_HAND}}}")
        thread = main_thread(page)
        counts = [cpu_ms(thread)]
        due = time.monotonic()
        for _ in range(FRAMES):
            due = max(time.monotonic(), due + 1 / FPS)
            time.sleep(max(0.0, due - time.monotonic()))
            page.evaluate("displayed()")
            counts.append(cpu_ms(thread))
        walls = np.array(page.evaluate("walls"))
        asked = [cpu_ms(thread)]
        for _ in range(FRAMES // 4):
            page.evaluate("0")
            asked.append(cpu_ms(thread))
    median, p95 = np.percentile(np.diff(counts), (50, 95))
    by_clock = np.percentile(walls, (50, 95))
    sys.stdout.write(
        f"{people} people, names shown: {median:.2f} ms of CPU a frame (median), {p95:.2f} ms "
        f"(p95), of which asking for it {np.median(np.diff(asked)):.2f}; by the clock "
        f"{by_clock[0]:.2f} and {by_clock[1]:.2f} ms, {os.getloadavg()[0]:.1f} processes ran\n"
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("people", type=int, nargs="?", default=100)
    parser.add_argument("scene", nargs="?", default="", help="an example scene, as town_square")
    asked = parser.parse_args()
    main(asked.people, asked.scene)
