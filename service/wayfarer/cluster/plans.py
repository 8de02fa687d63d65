"""The plan of each node of `wayfarer serve --workers N`: its ports, cores and state folder."""

import sys
from itertools import pairwise
from typing import Final

from wayfarer.cluster.messages import NodePlan
from wayfarer.config.settings import Settings
from wayfarer.errors import InvalidArgument
from wayfarer.process.processor import core_numbers, cores
from wayfarer.runtime.persistence.journal_file import NAME

FOLDER: Final = "worker-"


def node_plans(settings: Settings) -> list[NodePlan]:
    """A plan for each node. Raises InvalidArgument."""
    if sys.platform == "win32":
        raise InvalidArgument(
            "setting workers: several need pipes and clocks that Windows has not; set 1", "workers"
        )
    shares = shares_of(core_numbers(), settings.workers)
    return [
        NodePlan(
            name=f"node{number}",
            number=number,
            host="",
            cores=shares[number] if settings.pin_workers else (),
            settings=settings.model_copy(
                update={
                    "workers": 1,
                    "grpc_port": _port(settings.grpc_port, number),
                    "http_port": _port(settings.http_port, number),
                    "threads": threads_of(settings),
                    "state_dir": settings.state_dir and settings.state_dir / f"{FOLDER}{number}",
                }
            ),
        )
        for number in range(settings.workers)
    ]


def shares_of(cores: list[int], nodes: int) -> list[tuple[int, ...]]:
    """Neighbouring cores for each node, as evenly as can be; shared where there are too few."""
    if len(cores) < nodes:
        return [(cores[i % len(cores)],) for i in range(nodes)]
    bounds = [i * len(cores) // nodes for i in range(nodes + 1)]
    return [tuple(cores[a:b]) for a, b in pairwise(bounds)]


def threads_of(settings: Settings) -> int:
    """Threads of each node's engine: the cores of the node that has the fewest, by affinity and
    quota.
    """
    return settings.threads or max(cores() // settings.workers, 1)


def check_state(settings: Settings) -> None:
    """Raises InvalidArgument when the state folder holds sessions that would not come back."""
    folder, workers = settings.state_dir, settings.workers
    if folder is None or not folder.is_dir():
        return
    several = sum(1 for path in folder.glob(f"{FOLDER}*") if path.is_dir())
    kept = 1 if (folder / NAME).exists() else several
    if kept > workers or (kept == 1 and workers > 1):
        enough = f"{kept} or more" if kept > 1 else "1"
        raise InvalidArgument(
            f"setting state_dir: {folder} holds the sessions of --workers {kept}, and this is "
            f"--workers {workers}; start it with {enough} once more and let the sessions end, or "
            "export them, or take another folder",
            "state_dir",
        )


def _port(public: int, number: int) -> int:
    """A port that follows the server's own, so that a firewall can name it; 0 (any) for 0."""
    return public and public + 1 + number
