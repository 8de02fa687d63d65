"""Damaged mesh files into the readers: are all of them read or refused, in bounded time and memory?

    python -m benchmarks.fuzz_meshes --files 100000 --seed 1

N files of each format, each made from a sound one by changing bytes, numbers, lines, and values of
glTF's JSON. The process has the memory limit of the baking process (`limits.bake_mb`). Ends with 1
when a reader raised anything but InvalidArgument for `mesh.data`, gave invalid triangles,
or took long for one file; such files are written to --out.
"""

import argparse
import resource
import sys
import time
from pathlib import Path

from tests.fuzz.meshes import FORMATS, fuzz

from wayfarer.config.limits import Limits
from wayfarer.navigation.scene_spec import MeshFormat
from wayfarer.world.scenes.bake_process import bound_memory

SLOW = 5.0
"""Seconds for one file, of at most 200 kB."""


def main() -> int:
    """Runs it; returns 0 if all is well."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--files", type=int, default=100_000, help="of each format")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--formats", nargs="+", choices=FORMATS, default=FORMATS)
    parser.add_argument("--out", type=Path, default=Path("runs/fuzz_meshes"))
    asked = parser.parse_args()
    bound_memory(Limits().bake_mb)
    return max(shown(form, asked.files, asked.seed, asked.out) for form in asked.formats)


def shown(form: MeshFormat, files: int, seed: int, out: Path) -> int:
    """Runs one format and prints the result; 0 when all is well."""
    began = time.monotonic()
    report = fuzz(form, files, seed)
    seconds, refused = time.monotonic() - began, sum(report.refused.values())
    print(
        f"{form}: {report.files:,} files in {seconds:.0f} s, {report.read:,} read, "
        f"{refused:,} refused for {len(report.refused)} reasons, {len(report.failures)} failures; "
        f"slowest {report.slowest * 1000:.0f} ms, memory at most "
        f"{resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f} MB",
        flush=True,
    )
    for number, (why, data) in enumerate(report.failures[:20]):
        out.mkdir(parents=True, exist_ok=True)
        path = out / f"{form}-{number}.{form}"
        path.write_bytes(data)
        print(f"FAULT {path}: {why}")
    return int(bool(report.failures) or report.slowest > SLOW)


if __name__ == "__main__":
    sys.exit(main())
