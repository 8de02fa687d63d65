"""Shared parts of benchmarks: a command line, best-of-n timing, and a record of the machine."""

import argparse
import json
import os
import time
from collections.abc import Callable, Iterable
from importlib.metadata import PackageNotFoundError, version
from itertools import groupby
from pathlib import Path
from typing import Any

import psutil
from rich.console import Console
from rich.table import Table

from wayfarer.process.processor import cores
from wayfarer_lab.evaluation.report import meta as report_meta

Row = dict[str, Any]

FLAGS = ("avx2", "avx512f", "avx512_vnni", "avx512_bf16", "amx_bf16", "amx_int8", "amx_tile")
"""Instruction sets that determine the speed of matrix products."""

PACKAGES = ("numpy", "onnxruntime", "openvino", "torch", "grpcio", "protobuf", "uvloop")


WIDE = 12
"""Rows with more columns are printed as columns."""


def ratio(value: float, better: str) -> dict[str, Any]:
    """A figure that can be compared between runs and machines; `better`: "lower" or "higher"."""
    return {"value": round(value, 4), "better": better}


def parser(doc: str | None) -> argparse.ArgumentParser:
    """A parser with the options that every benchmark has; its help is the module's docstring."""
    made = argparse.ArgumentParser(
        description=doc, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    made.add_argument("--json", type=Path, help="write the figures to this file")
    made.add_argument("--quick", action="store_true", help="less of everything: a first look")
    return made


def finish(asked: argparse.Namespace, rows: list[Row], **more: Any) -> None:
    """Prints the rows and, if asked, writes `{"rows": …, "ratios": …, "meta": …}`."""
    show(rows)
    for name, found in more.get("ratios", {}).items():
        print(f"ratio  {name}: {found['value']:.3g} ({found['better']} is better)")
    if asked.json:
        document = {"rows": rows, **more, "meta": meta(quick=asked.quick)}
        asked.json.write_text(json.dumps(document, indent=1) + "\n")


def show(rows: list[Row]) -> None:
    """Prints a table for each run of rows that have the same columns."""
    console = Console(width=160)
    for columns, group in groupby(rows, key=tuple):
        cells = [list(columns), *([text(value) for value in row.values()] for row in group)]
        if len(columns) > WIDE:
            cells = [list(line) for line in zip(*cells, strict=True)]
        table = Table(*cells[0])
        for line in cells[1:]:
            table.add_row(*line)
        console.print(table)


def text(value: object) -> str:
    """A figure with as many digits as are worth reading."""
    if value is None:
        return "–"
    if isinstance(value, float):
        return f"{value:.3g}" if abs(value) < 1000 else f"{value:.0f}"
    return str(value)


def best(call: Callable[[], object], seconds: float, clock: Callable[[], float]) -> float:
    """The shortest of the calls that fit into `seconds`, at least three, after a warm-up call.

    Other work on the machine can only lengthen a call: the shortest is closest to its cost.
    """
    call()
    found: list[float] = []
    until = time.monotonic() + seconds
    while len(found) < 3 or time.monotonic() < until:
        started = clock()
        call()
        found.append(clock() - started)
    return min(found)


def clock_of(threads: int) -> Callable[[], float]:
    """CPU time for one thread, which other work hardly lengthens; otherwise real time.

    It is the whole process's CPU time, since an engine may use a thread next to the caller's.
    """
    return time.process_time if threads == 1 else time.perf_counter


def meta(**about: Any) -> dict[str, Any]:
    """Date, machine, commit and versions of the figures."""
    made = report_meta(about)
    del made["metrics_version"]  # of quality, not of time
    made["machine"] |= {
        "cores": cores(),
        "flags": _flags(),
        "ram_gb": round(psutil.virtual_memory().total / 1e9, 1),
        "load": round(os.getloadavg()[0], 2),  # of other processes, if it is high when a run begins
    }
    made["versions"] |= {name: number for name in PACKAGES if (number := _installed(name))}
    return made


def _flags() -> list[str]:
    info = Path("/proc/cpuinfo")
    lines = info.read_text().splitlines() if info.exists() else []
    found: Iterable[str] = next((line.split() for line in lines if line.startswith("flags")), [])
    return [flag for flag in FLAGS if flag in set(found)]


def _installed(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None
