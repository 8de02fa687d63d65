"""JavaScript time of a displayed frame: `python -m tests.viewer.frame_time [PEOPLE]`.

In a real browser against a real server. What the graphics card would do is left out: the calls that
draw are made, and nothing waits for them.
"""

import sys
import tempfile
from pathlib import Path

import numpy as np

from tests.serving import Service
from tests.viewer.chromium import CONNECTION, Page, find_chromium

FRAMES = 300
MEASURE = f"""(async () => {{
  const {{ stage, frame }} = wayfarer;
  stage.renderer.setAnimationLoop(null);
  const {{ prototype }} = WebGL2RenderingContext;
  for (const name of Object.getOwnPropertyNames(prototype)) {{
    if (/^(draw(Arrays|Elements)|clear$|texSubImage2D)/.test(name)) prototype[name] = () => {{}};
  }}
  const times = [];
  for (let k = 0; k < {FRAMES}; k += 1) {{
    await new Promise((go) => setTimeout(go, 15));
    const begun = performance.now();
    frame();
    times.push(performance.now() - begun);
  }}
  return times;
}})()"""


def main(people: int) -> None:
    """Print median and 95th percentile."""
    executable = find_chromium()
    if executable is None:
        sys.exit("there is no Chromium here: apt-get install chromium")
    profile = Path(tempfile.mkdtemp())
    with Service() as service, Page(executable, profile, (1440, 900)) as page:
        page.call("Page.navigate", url=f"{service.url}/?scene=&detail=low")
        page.wait_for(f"globalThis.wayfarer?.stage.renderer && {CONNECTION} === 'open'", 60)
        for first in range(0, people, 50):
            page.evaluate(f"wayfarer.arrivals.roamers({min(50, people - first)})")
        page.evaluate("document.querySelector('#labels').click()")
        shown = "wayfarer.crowd.people.filter((person) => person.shown).length"
        page.wait_for(f"{shown} === {people}", 300)
        times = np.array(page.evaluate(MEASURE))
        median, p95 = np.percentile(times, (50, 95))
        sys.stdout.write(
            f"{people} people, names shown: {median:.2f} ms a frame (median), {p95:.2f} ms (p95)\n"
        )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 100)
