"""`make matrix`: install and start the service with every Python here; an agent walks in each.

For each of Python 3.11 to 3.14 twice, in a throw-away environment and a copy of this tree each:

    pinned   as README says: `make serve`, `pip install ./clients/python`; versions of requirements/
    newest   `pip install . ./clients/python`: the newest versions that pyproject.toml allows

walk.py then streams from it over gRPC and WebSocket. It must end cleanly on request, and must not
have written into the user's home folder. Exit code 1 when anything failed, 2 when nothing
could be tried.
"""

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from itertools import count
from pathlib import Path

from tests.installed.process import PORTS, WALK, StepError, run, serving

ROOT = Path(__file__).resolve().parent.parent.parent
VERSIONS = ("3.11", "3.12", "3.13", "3.14")
KINDS = ("pinned", "newest")


@dataclass
class Cell:
    """One environment."""

    python: Path
    version: str
    kind: str
    folder: Path
    are_pins_found: bool
    """Whether something else says that this Python finds the pinned packages."""
    seconds: float = 0.0
    found: str = ""
    failure: str = ""
    packages: dict[str, str] = field(default_factory=dict)


def main() -> int:
    """Run all, print the table; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--python", action="append", default=[], help="one more interpreter")
    parser.add_argument("--versions", nargs="+", default=VERSIONS, choices=VERSIONS)
    parser.add_argument("--kinds", nargs="+", default=KINDS, choices=KINDS)
    parser.add_argument(
        "--tested",
        help="the version that `make test` runs pinned: the newest packages alone are tried, with "
        "all other Pythons, or with this one if there is no other",
    )
    parser.add_argument("--jobs", type=int, default=2, help="environments at a time [2]")
    parser.add_argument("--limit", type=float, default=600, help="seconds for each one [600]")
    given = parser.parse_args()
    pythons = interpreters(given.versions, given.python)
    others = pythons.keys() - {given.tested} or pythons.keys()
    with tempfile.TemporaryDirectory(prefix="wayfarer-matrix-") as name:
        cells = [
            Cell(
                python,
                version,
                kind,
                Path(name) / f"{version}-{kind}",
                are_pins_found=given.tested in (None, version),
            )
            for kind in given.kinds
            for version, python in pythons.items()
            if not given.tested or (kind == "newest" and version in others)
        ]
        with ThreadPoolExecutor(given.jobs, initializer=partial(stay_on_a_core, count())) as pool:
            for cell in pool.map(lambda cell: tried(cell, given.limit), cells):
                result = f"FAILED\n{cell.failure}" if cell.failure else cell.found
                print(f"Python {cell.version}, {cell.kind}: {result}", flush=True)
    print_table(given.versions, given.kinds, cells)
    if not cells:
        return 2
    return int(any(cell.failure for cell in cells))


def stay_on_a_core(turns: Iterator[int]) -> None:
    """Keeps this thread, and all that it starts, on one core, where the system can. On several, a
    service compiles its rules in two processes. With NUMBA_OPT=0 numba keeps few, so that both
    compile all.
    """
    if hasattr(os, "sched_setaffinity"):  # not on macOS
        cores = sorted(os.sched_getaffinity(0))
        os.sched_setaffinity(0, {cores[next(turns) % len(cores)]})


def interpreters(versions: Sequence[str], more: Sequence[str]) -> dict[str, Path]:
    """The first interpreter of each minor version that can make virtual environments."""
    home = Path.home()
    roots = [Path(os.environ.get("PYENV_ROOT", home / ".pyenv")) / "versions"]
    roots += [home / ".local/share/uv/python", Path("/opt/python")]
    newest_first = sorted(
        (path for root in roots for path in root.glob("*/bin/python3")), key=str, reverse=True
    )
    on_path = [f"python{version}" for version in VERSIONS] + ["python3"]
    system = [Path("/usr/bin") / name for name in on_path]
    candidates = [Path(path) for path in more]
    candidates += [Path(found) for name in on_path if (found := shutil.which(name))]
    candidates += system + newest_first
    found: dict[str, Path] = {}
    for path in candidates:
        version = version_of(path)
        if version in versions and version not in found:
            found[version] = path
    return {version: found[version] for version in versions if version in found}


def version_of(python: Path) -> str:
    """As "3.12"; empty for what is no interpreter, or cannot make virtual environments."""
    ask = "import sys, venv, ensurepip; print('%d.%d' % sys.version_info[:2])"
    try:
        done = subprocess.run(
            [python, "-c", ask], capture_output=True, text=True, check=True, timeout=30
        )
    except (OSError, subprocess.SubprocessError):
        return ""
    return done.stdout.strip()


def tried(cell: Cell, limit: float) -> Cell:
    """Install, start, walk, end; `failure` says what went wrong."""
    begun = time.monotonic()
    try:
        attempt(cell, begun + limit)
    except StepError as error:
        cell.failure = str(error)
    finally:
        shutil.rmtree(cell.folder, ignore_errors=True)
        cell.seconds = time.monotonic() - begun
    return cell


def attempt(cell: Cell, until: float) -> None:
    """Raises StepError."""
    tree, home = cell.folder / "tree", cell.folder / "home"
    home.mkdir(parents=True)
    copy_tree(tree)
    python = tree / ".venv/bin/python"
    pip = [str(python), "-m", "pip", "install", "--quiet"]
    if cell.kind == "pinned":
        # the stamp of `make serve`, which below finds all installed
        run(["make", f"PYTHON={cell.python}", ".venv/.serve"], tree, until)
        run([*pip, "./clients/python"], tree, until)
        serve = ["make", "--silent", "serve", f"ARGS={' '.join(PORTS)}"]
    else:
        run([str(cell.python), "-m", "venv", ".venv"], tree, until)
        if not cell.are_pins_found:
            pins = [f"--requirement=requirements/{name}.txt" for name in ("build", "serve")]
            run([*pip, "--dry-run", "--no-deps", "--require-hashes", *pins], tree, until)
        run([*pip, ".", "./clients/python"], tree, until)
        serve = [str(tree / ".venv/bin/wayfarer"), "serve", *PORTS]
    listed = run([str(python), "-m", "pip", "list", "--format=json"], tree, until)
    versions = {line["name"].lower(): line["version"] for line in json.loads(listed)}
    cell.packages = {name: v for name, v in versions.items() if name not in ("pip", "setuptools")}
    with serving(serve, tree, until, HOME=str(home)) as (http, grpc):
        cell.found = run([str(python), str(WALK), http, grpc], cell.folder, until).strip()
    if left := [str(path.relative_to(home)) for path in home.rglob("*")]:
        raise StepError(f"it wrote into the home folder: {left}")


def copy_tree(target: Path) -> None:
    """Copies the files of this tree that git would commit now."""
    listed = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    for name in filter(None, listed.stdout.split("\0")):
        source = ROOT / name
        if source.is_symlink() or source.is_file():  # not deleted and not committed
            (target / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(source, target / name, follow_symlinks=False)


def print_table(versions: Sequence[str], kinds: Sequence[str], cells: Sequence[Cell]) -> None:
    """Prints the attempts with their results, and the ones that were not made."""
    print(f"\n{'Python':<10}" + "".join(f"{kind:<12}" for kind in kinds))
    by_place = {(cell.version, cell.kind): cell for cell in cells}
    for version in versions:
        row = [by_place.get((version, kind)) for kind in kinds]
        words = ["–" if c is None else "FAILED" if c.failure else "ok" for c in row]
        times = [f" {c.seconds:.0f} s" if c else "" for c in row]
        print(f"{version:<10}" + "".join(f"{w + t:<12}" for w, t in zip(words, times, strict=True)))
    for version in versions:
        pair = [by_place.get((version, kind)) for kind in KINDS]
        if not any(pair):
            print(f"Python {version} was not tried: this machine has none with venv and ensurepip")
        elif all(cell and cell.packages for cell in pair):
            pinned, newest = (cell.packages for cell in pair if cell)
            newer = [f"{n} {v}" for n, v in newest.items() if pinned.get(n, v) != v]
            print(f"Python {version}: newest instead of pinned: {', '.join(newer) or 'the same'}")


if __name__ == "__main__":
    sys.exit(main())
