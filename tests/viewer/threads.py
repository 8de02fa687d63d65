"""CPU time of a page's threads, as the kernel counts it (Linux): other processes do not matter."""

from pathlib import Path

from tests.viewer.chromium import Page

NO_DRAWING = """{
  const { prototype } = WebGL2RenderingContext;
  for (const name of Object.getOwnPropertyNames(prototype)) {
    if (/^(draw(Arrays|Elements)|clear$|texSubImage2D)/.test(name)) prototype[name] = () => {};
  }
}"""
"""A script that leaves out the graphics card's work."""


def main_thread(page: Page) -> Path:
    """The kernel's counters of a page's main thread: the thread that a script keeps busy."""
    parents, found = {}, []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            number = int(folder.name)
            parents[number] = int((folder / "stat").read_text().rpartition(")")[2].split()[1])
            if b"--type=renderer" in (folder / "cmdline").read_bytes():
                found.append(number)
        except OSError:
            continue  # it has ended
    below = [number for number in found if page.process_id in ancestors(number, parents)]
    counts = [Path(f"/proc/{number}/task/{number}/schedstat") for number in below]
    before = [cpu_ms(count) for count in counts]
    page.evaluate("{ const end = performance.now() + 300; while (performance.now() < end); }")
    rises = [cpu_ms(count) - start for count, start in zip(counts, before, strict=True)]
    return counts[rises.index(max(rises))]


def ancestors(process: int, parents: dict[int, int]) -> set[int]:
    """The ancestors of a process."""
    found: set[int] = set()
    while process in parents:
        process = parents[process]
        found.add(process)
    return found


def cpu_ms(thread: Path) -> float:
    """Milliseconds that a thread has run."""
    return int(thread.read_text().split()[0]) / 1e6


def worker_threads(main: Path) -> list[Path]:
    """The workers of this main thread's page; the one that has run longest comes first."""
    names = main.parents[1].glob("*/comm")
    workers = [name.parent / "schedstat" for name in names if "Dedicated" in name.read_text()]
    return sorted(workers, key=cpu_ms, reverse=True)
