"""A newcomer's first ten seconds: `python -m benchmarks.newcomer FOLDER [WIDTHxHEIGHT …]`.

With `--openings 20`, the page is only opened, 20 times, at the first size: median and 95th
percentile of the seconds until each step.
With VIEWER_URL it visits a server that runs, such as that of `make serve`.

On windows of a desk and of a phone: the page is opened, people walk, and a click or a touch sends
one of them. Prints when each happened, in seconds since the navigation began; leaves pictures.
"""

import argparse
import os
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path

import numpy as np
from tests.serving import Service
from tests.viewer.chromium import Page
from tests.viewer.stage import FIRST_SECONDS, FREE_SPOT, SIZES

WALKING = "globalThis.firstSeen?.['people walk in a finished picture']"
SENT = "wayfarer.crowd.people.find(({ ahead, passed }) => ahead.length + passed)"
GOES = (
    f"(({{ played, ahead: [goal] }}) => played.state === 'walking' && goal &&"
    f" performance.now() / 1000)({SENT})"
)


def visit(page: Page, url: str, size: tuple[int, int], folder: Path, scheme: str) -> str:
    """One newcomer."""
    page.resize(*size)
    page.call(
        "Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}]
    )
    page.call("Page.navigate", url="about:blank")
    page.call("Page.navigate", url=url)
    page.wait_for(WALKING, 120)
    seen = page.evaluate("firstSeen")
    assert isinstance(seen, dict)
    name = f"{size[0]}x{size[1]}-{scheme}"
    time.sleep(1)
    (folder / f"{name}-open.png").write_bytes(page.screenshot())
    x, y = page.wait_for(FREE_SPOT, 60)
    clicked = page.evaluate("performance.now() / 1000")
    page.click(x, y)
    page.wait_for(f"Boolean({SENT})", 30)
    goes = page.wait_for(GOES, 60)
    assert isinstance(clicked, float) and isinstance(goes, float)
    time.sleep(1)
    (folder / f"{name}-sent.png").write_bytes(page.screenshot())
    page.evaluate("document.querySelector('#more').click()")
    time.sleep(1)
    (folder / f"{name}-more.png").write_bytes(page.screenshot())
    page.evaluate("document.querySelector('#more').click()")
    told = ", ".join(f"{what} {when:.2f}" for what, when in seen.items())
    return (
        f"{name}: {told}; who was clicked for walks there {goes - clicked:.2f} s after the click;"
        f" load {os.getloadavg()[0]:.0f}"
    )


def openings(page: Page, url: str, count: int) -> str:
    """The page opened again and again; the browser keeps its files."""
    found: dict[str, list[float]] = {}
    for _ in range(count):
        page.call("Page.navigate", url="about:blank")  # its people go
        time.sleep(1)
        page.call("Page.navigate", url=url)
        page.wait_for(WALKING, 120)
        seen = page.evaluate("firstSeen")
        assert isinstance(seen, dict)
        for what, when in seen.items():
            found.setdefault(what, []).append(when)
    rows = ((what, *np.percentile(when, (50, 95))) for what, when in found.items())
    told = "\n".join(
        f"{what}: {median:.2f} s (median), {p95:.2f} (p95)" for what, median, p95 in rows
    )
    return f"{told}\nof {count} openings; load {os.getloadavg()[0]:.0f}"


def main(folder: Path, sizes: tuple[tuple[int, int], ...], count: int = 0) -> None:
    """Print the times."""
    folder.mkdir(parents=True, exist_ok=True)
    with ExitStack() as held:
        url = os.environ.get("VIEWER_URL") or held.enter_context(Service()).url
        page = held.enter_context(Page(Path(tempfile.mkdtemp())))
        page.call("Page.addScriptToEvaluateOnNewDocument", source=FIRST_SECONDS)
        page.call("Page.navigate", url=url)  # the first visit bakes the scene
        page.wait_for(WALKING, 120)
        if count:
            page.resize(*sizes[0])
            sys.stdout.write(openings(page, url, count) + "\n")
            return
        for size in sizes:
            for scheme in ("light", "dark"):
                line = visit(page, url, size, folder, scheme)
                sys.stdout.write(line + "\n")
                sys.stdout.flush()


def size_of(text: str) -> tuple[int, int]:
    """Parses WIDTHxHEIGHT."""
    width, height = map(int, text.split("x"))
    return width, height


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, help="for the pictures")
    parser.add_argument("sizes", type=size_of, nargs="*", default=SIZES, metavar="WIDTHxHEIGHT")
    parser.add_argument("--openings", type=int, default=0)
    asked = parser.parse_args()
    main(asked.folder, tuple(asked.sizes), asked.openings)
