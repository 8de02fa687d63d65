"""Run all performance benchmarks, and record results, machine and time.

    python -m benchmarks.record [--name default] [--only step service] [--quick]

Writes benchmarks/results/performance_NAME.json (machine, date, commit, versions, and each
benchmark's rows and ratios), then performance.md from all such files. Each benchmark runs in a
separate process. A failed one is listed with its last output, and the record ends with 1. Leave
the machine alone meanwhile: about 30 minutes, or 10 with `--quick`, which is a first look and no
record to publish. `--only` runs some and keeps the file's results of the others. With `--agents`
the service is held at this number; otherwise the search for the maximum takes half an hour each.

Against an older record: python -m benchmarks.compare OLD NEW
"""

import argparse
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from benchmarks import performance_page
from benchmarks.bench import meta
from benchmarks.models import ENGINES

RESULTS = Path(__file__).parent / "results"

PARTS: dict[str, tuple[str, ...]] = {
    "step": ("step",),
    "quantised": ("quantised",),
    **{
        f"{name}_{engine}": (name, "--engine", engine)
        for name in ("paper_s3", "startup", "memory")
        for engine in ENGINES
    },
    "transport": ("transport",),
    "overhead": ("runtime_overhead",),
    "gpu": ("gpu",),
    "navigation": ("navigation",),
    **{
        f"service_{engine}_k{candidates}": (
            *("service", "--engine", engine, "--candidates", str(candidates)),
            *("--most", str(most)),
        )
        for engine in ENGINES
        for candidates, most in ((1, 2048), (8, 512))
    },
}
"""Name: module and options."""

LONG = ("--seconds", "60")
LONGEST = ("--seconds", "300")
SECONDS_LEFT = 1800.0
"""Seconds after which a benchmark counts as hanging."""


def command(part: str, quick: bool, agents: int | None = None) -> list[str]:
    """The command of a part, without its output file."""
    words = list(PARTS[part])
    if part.startswith("service") and agents:
        words += ("--agents", str(agents), "--transports", "grpc")
    if quick:
        words.append("--quick")
    elif part.startswith("service"):
        words += LONGEST if part.endswith("_k1") else LONG
    return ["python", "-m", f"benchmarks.{words[0]}", *words[1:]]


def measured(part: str, quick: bool, agents: int | None = None) -> dict[str, Any]:
    """The document of one benchmark, or its last output if it failed."""
    words, began = command(part, quick, agents), time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "found.json"
        try:
            run = subprocess.run(
                [sys.executable, *words[1:], "--json", str(path)],
                stderr=subprocess.PIPE,
                text=True,
                timeout=SECONDS_LEFT,
                check=False,
            )
            failure = run.stderr[-2000:] if run.returncode else ""
        except subprocess.TimeoutExpired:
            failure = f"it took longer than {SECONDS_LEFT:g} s"
        found: dict[str, Any] = json.loads(path.read_text()) if path.exists() else {}
    found.pop("meta", None)
    about = {"command": " ".join(words), "took_s": round(time.monotonic() - began, 1)}
    return about | ({"failure": failure} if failure else {}) | found


def main() -> int:
    """Runs, writes and draws the page; 1 when a benchmark failed."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--name", default="default", help="of the record: of the machine, say")
    parser.add_argument("--only", nargs="+", choices=PARTS, default=list(PARTS))
    parser.add_argument(
        "--agents", type=int, help="in the service parts, over gRPC, in place of a search"
    )
    parser.add_argument("--quick", action="store_true", help="less of everything: a first look")
    parser.add_argument("--folder", type=Path, default=RESULTS, help="where to write, if elsewhere")
    asked = parser.parse_args()
    path = asked.folder / f"performance_{asked.name}.json"
    parts = json.loads(path.read_text())["parts"] if path.exists() else {}
    failed = []
    for part in asked.only:
        print(f"── {part}", flush=True)
        parts[part] = measured(part, asked.quick, asked.agents) | {"meta": meta(quick=asked.quick)}
        if "failure" in parts[part]:
            failed.append(part)
            print(parts[part]["failure"], file=sys.stderr)
        ordered = {name: parts[name] for name in PARTS if name in parts}
        path.write_text(json.dumps({"parts": ordered}, indent=1) + "\n")
    if asked.folder == RESULTS:
        performance_page.main()
    print(f"{path}: {len(parts)} parts; failed: {', '.join(failed) or 'none'}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
