"""The assignment of each worker, and checks that folder and machine fit their number."""

import os
import socket
import sys
from itertools import pairwise
from pathlib import Path
from typing import Final

from wayfarer.config import Settings
from wayfarer.endpoint import Endpoint
from wayfarer.errors import InvalidArgument
from wayfarer.workers.messages import Assignment

JOURNAL: Final = "journal.sqlite3"
FOLDER: Final = "worker-"


def assignments(settings: Settings, folder: Path) -> list[Assignment]:
    """One for each worker. `folder`: for their sockets. Raises InvalidArgument."""
    check_platform()
    check_state(settings)
    endpoints = _endpoints(settings)
    shares = shares_of(_cores(), settings.workers)
    return [
        Assignment(
            index=index,
            endpoints=endpoints,
            folder=_made(folder / str(index)),
            cores=shares[index] if settings.pin_workers else (),
            settings=settings.model_copy(
                update={
                    "grpc_port": endpoints[index].grpc_port,
                    "http_port": endpoints[index].http_port,
                    "threads": threads_of(settings),
                    "state_dir": settings.state_dir and settings.state_dir / f"{FOLDER}{index}",
                }
            ),
        )
        for index in range(settings.workers)
    ]


def shares_of(cores: list[int], workers: int) -> list[tuple[int, ...]]:
    """Neighbouring cores for each worker, as evenly as can be; shared where there are too few."""
    if len(cores) < workers:
        return [(cores[i % len(cores)],) for i in range(workers)]
    bounds = [i * len(cores) // workers for i in range(workers + 1)]
    return [tuple(cores[a:b]) for a, b in pairwise(bounds)]


def threads_of(settings: Settings) -> int:
    """Threads of each worker's engine: the cores of the worker that has the fewest."""
    return settings.threads or len(shares_of(_cores(), settings.workers)[0])


def check_platform() -> None:
    """Raises InvalidArgument where workers cannot be had."""
    if sys.platform == "win32":
        raise InvalidArgument(
            "setting workers: several need Unix sockets, which Windows has not; set 1",
            "workers",
        )


def check_state(settings: Settings) -> None:
    """Raises InvalidArgument when the state folder belongs to another number of workers.

    A session lives where its id says (shares.py), which depends on their number.
    """
    folder, workers = settings.state_dir, settings.workers
    if folder is None or not folder.is_dir():
        return
    kept = sum(1 for path in folder.glob(f"{FOLDER}*") if path.is_dir())
    if (folder / JOURNAL).exists():
        kept = 1
    if kept not in (0, workers):
        raise InvalidArgument(
            f"setting state_dir: {folder} holds the sessions of --workers {kept}, and this is "
            f"--workers {workers}; start it with {kept} once more and let the sessions end, or "
            "export them, or take another folder",
            "state_dir",
        )


def _endpoints(settings: Settings) -> tuple[Endpoint, ...]:
    """Ports that follow the server's own, or free ones where that is any."""
    count = settings.workers
    grpc_ports = _ports(settings, settings.grpc_port, count)
    http_ports = _ports(settings, settings.http_port, count)
    return tuple(
        Endpoint(worker=i, grpc_port=grpc_ports[i], http_port=http_ports[i]) for i in range(count)
    )


def _ports(settings: Settings, public: int, count: int) -> list[int]:
    if public:
        return list(range(public + 1, public + 1 + count))
    family = socket.AF_INET6 if ":" in settings.host else socket.AF_INET
    held = [socket.create_server((settings.host, 0), family=family) for _ in range(count)]
    ports = [one.getsockname()[1] for one in held]
    for one in held:
        one.close()
    return ports


def _cores() -> list[int]:
    """Those that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return sorted(os.sched_getaffinity(0))
    return list(range(os.cpu_count() or 1))


def _made(folder: Path) -> Path:
    folder.mkdir(mode=0o700)
    return folder
