"""What a supervisor and its workers tell each other: a line of JSON each, over the worker's pipes.

Down, on stdin: one `Assignment`, and then nothing; the end of the pipe is that of the supervisor.
Up, on stdout: a `Report` several times a second.
"""

from pathlib import Path

from pydantic import BaseModel, ConfigDict

from wayfarer.config import Settings
from wayfarer.endpoint import Endpoint
from wayfarer.transport.worker_sockets import WorkerSockets
from wayfarer.workers.shares import WorkerShares


class Assignment(BaseModel):
    """What a worker is to be."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    index: int
    endpoints: tuple[Endpoint, ...]  # of all workers, in order
    folder: Path  # of the sockets through which the front comes in
    cores: tuple[int, ...] = ()  # those it may run on; none: all
    settings: Settings  # its own ports, state folder and threads are in them

    @property
    def shares(self) -> WorkerShares:
        """What lives in which worker."""
        return WorkerShares(self.index, self.endpoints)

    @property
    def inside(self) -> WorkerSockets:
        """Where the front comes in."""
        return WorkerSockets(self.folder)


class Report(BaseModel):
    """How a worker is."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    alive: bool = False  # its motion loop runs
    ready: bool = False  # new work is welcome
    started: bool = False  # it has been ready
    agents: int = 0
    sessions: int = 0


DOWN = Report()
"""The report of a worker that does not run."""
