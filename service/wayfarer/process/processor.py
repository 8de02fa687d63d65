"""How many cores the process may use: those of its affinity, or fewer if a quota says so.

A container's quota of processor time (`docker run --cpus`, `resources.limits.cpu` in Kubernetes)
does not show in the affinity. Control groups keep it, version 1 or 2, and the groups above a group
limit it as well. Threads beyond the quota are stopped in the middle of a step.
"""

import os
import re
from collections.abc import Iterator
from math import ceil
from pathlib import Path
from typing import Final

ROOT: Final = Path("/")


def cores(root: Path = ROOT) -> int:
    """Cores that the process may use; a fraction counts as one. At least 1.

    `root`: where `/proc` and the mounted control groups are.
    """
    most = min((ceil(quota) for quota in _quotas(root)), default=len(core_numbers()))
    return max(min(len(core_numbers()), most), 1)


def core_numbers() -> list[int]:
    """Numbers of the cores on which the process may run, whatever its quota is."""
    if hasattr(os, "sched_getaffinity"):
        return sorted(os.sched_getaffinity(0))
    return list(range(os.cpu_count() or 1))


def _quotas(root: Path) -> Iterator[float]:
    """The quotas, in cores, of the process's group and of those above it."""
    groups = _groups(root)
    for version, mounted, point in _mounts(root):
        group = groups.get(version)
        if group is None:
            continue
        # inside a container, a group may not lie below the mounted one
        below = Path(group).relative_to(mounted) if Path(group).is_relative_to(mounted) else Path()
        top = root / point.lstrip("/")
        for folder in (below, *below.parents):
            if (quota := _quota(version, top / folder)) is not None:
                yield quota


def _groups(root: Path) -> dict[int, str]:
    """The control group of the process, by version."""
    found = {}
    for line in _text(root / "proc/self/cgroup").splitlines():
        number, controllers, group = line.split(":", 2)
        if number == "0" and not controllers:
            found[2] = group
        elif "cpu" in controllers.split(","):
            found[1] = group
    return found


def _mounts(root: Path) -> Iterator[tuple[int, str, str]]:
    """Mounted control groups: version, which group is mounted, and where."""
    for line in _text(root / "proc/self/mountinfo").splitlines():
        before, _, after = line.partition(" - ")
        fields, kind = before.split(), after.split()
        if len(fields) < 5 or len(kind) < 3:
            continue
        mounted, point = _unescaped(fields[3]), _unescaped(fields[4])
        if kind[0] == "cgroup2":
            yield 2, mounted, point
        elif kind[0] == "cgroup" and "cpu" in kind[2].split(","):
            yield 1, mounted, point


def _quota(version: int, folder: Path) -> float | None:
    """Cores that a group's processes may use together; None: no limit."""
    if version == 2:
        quota, _, period = _text(folder / "cpu.max").partition(" ")
    else:
        quota, period = (_text(folder / f"cpu.cfs_{name}_us") for name in ("quota", "period"))
    try:
        most, of = int(quota), int(period)
    except ValueError:  # "max", or no such file
        return None
    return most / of if most > 0 and of > 0 else None


def _unescaped(path: str) -> str:
    return re.sub(r"\\(\d{3})", lambda found: chr(int(found[1], 8)), path)


def _text(file: Path) -> str:
    try:
        return file.read_text().strip()
    except (OSError, UnicodeDecodeError):
        return ""
