"""Times of the web client in Chromium: `python -m benchmarks.page_speed [DEMO]`.

The core: 64 agents are decoded, sampled and put on characters, 60 pictures a second. With DEMO, a
folder that `make demo` has written, also people who walk without a server: the time until they are
there at the first visit and at later ones, from the browser's cache, and the load of 30 and 50 of
them. Except for the visits, CPU time of the page's threads is counted; nothing is drawn.
"""

import argparse
import os
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from tests.viewer.chromium import Page
from tests.viewer.threads import NO_DRAWING, cpu_ms, main_thread, worker_threads
from tests.web_host import Files, web_host

ROOT = Path(__file__).parents[1]
SECONDS = 20
VISITS = 5
THERE = (
    "globalThis.demo?.people.size === 10"
    " && [...demo.people.values()].every(({ played, body }) => played.shown && body)"
)
MORE_UNTIL = "demo.people.size >= {} || (document.querySelector('#more').click(), false)"
WATCH = f"""(function look() {{
  if (globalThis.demo) globalThis.readyAt ??= performance.now();
  if ({THERE}) globalThis.thereAt = performance.now();
  else setTimeout(look, 10);
}})()"""


class KeptFiles(Files):
    """Files, kept by the browser as a web host's are."""

    def end_headers(self) -> None:
        """Add how long they are kept."""
        self.send_header("cache-control", "max-age=3600")
        super().end_headers()


def core(page: Page) -> str:
    """Milliseconds of a picture of 64 agents."""
    with web_host(ROOT, KeptFiles) as url:
        page.call("Page.navigate", url=f"{url}/clients/web/test/speed_page.html")
        page.wait_for("Boolean(globalThis.speed)", 120)
    thread = main_thread(page)
    before = cpu_ms(thread)
    pictures = page.evaluate("speed.play(speed.counted, speed.begun)")
    assert isinstance(pictures, int)
    each = (cpu_ms(thread) - before) / pictures
    return f"64 agents decoded, sampled, retargeted: {each:.2f} ms of CPU per picture"


def local(page: Page, folder: Path) -> Iterator[str]:
    """Time until people are there, and the load of 30 and 50 of them."""
    page.call("Page.addScriptToEvaluateOnNewDocument", source=NO_DRAWING)
    page.call("Page.addScriptToEvaluateOnNewDocument", source=WATCH)
    with web_host(folder, KeptFiles) as url:
        for _ in range(VISITS + 1):
            yield visit(page, url)
        main = main_thread(page)
        for count in (30, 50):
            page.wait_for(MORE_UNTIL.format(count), 60)
            yield work(page, main)


def visit(page: Page, url: str) -> str:
    """Time until people are there, by the clock and in CPU time of the page and its workers."""
    page.call("Page.navigate", url=f"{url}/bodies/looks.json")  # of this origin: the process stays
    main = main_thread(page)
    before, others = cpu_ms(main), worker_threads(main)  # of pages in the browser's history
    page.call("Page.navigate", url=url)
    page.wait_for("globalThis.thereAt", 120)
    workers = [worker for worker in worker_threads(main) if worker not in others]
    took = [cpu_ms(main) - before, *map(cpu_ms, workers)]
    ready, there = page.evaluate("[readyAt / 1000, thereAt / 1000]")
    return (
        f"ready after {ready:.1f} s, ten people there after {there:.1f}; CPU until then: page "
        f"{took[0] / 1000:.2f} s, workers {' and '.join(f'{ms / 1000:.2f}' for ms in took[1:])} s; "
        f"load {os.getloadavg()[0]:.0f}"
    )


def work(page: Page, main: Path) -> str:
    """The load of the demo's people."""
    time.sleep(5)  # they have set off
    workers = worker_threads(main)
    count, before = page.evaluate("demo.people.size"), page.evaluate("demo.session.figures()")
    cpu, shown, began = sum(map(cpu_ms, workers)), cpu_ms(main), time.monotonic()
    time.sleep(SECONDS)
    passed = time.monotonic() - began
    each = (sum(map(cpu_ms, workers)) - cpu, cpu_ms(main) - shown)
    after = page.evaluate("demo.session.figures()")
    rows = after["rows"] - before["rows"]
    waited = after["waited"] - before["waited"]
    share, page_share = (each[k] / 10 / passed for k in (0, 1))
    return (
        f"{count} people for {passed:.0f} s: {each[0] / rows:.2f} ms of CPU per person and 0.2 s "
        f"in the workers, {share:.0f} % of a core ({200 * rows / each[0]:.0f} people per core); "
        f"the page itself {page_share:.0f} %; time waited {waited:.1f} s"
    )


def say(line: str) -> None:
    """Prints a line at once."""
    sys.stdout.write(line + "\n")
    sys.stdout.flush()


def main(folder: Path | None) -> None:
    """Print the times."""
    with Page(Path(tempfile.mkdtemp())) as page:
        say(core(page))
        for line in local(page, folder) if folder else ():
            say(line)
    say(f"{os.getloadavg()[0]:.1f} processes ran beside")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("demo", type=Path, nargs="?", help="a folder that `make demo` has written")
    main(parser.parse_args().demo)
