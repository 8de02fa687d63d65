"""Motion models by name: found in folders, opened and warmed while others serve."""

import asyncio
import re
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from pathlib import Path
from threading import Thread
from typing import Final

from wayfarer.engines.engine import Engine
from wayfarer.engines.models import LoadedModels
from wayfarer.engines.row_partitioner import give_way
from wayfarer.engines.warm import WarmEngine
from wayfarer.errors import InvalidArgument, NotFound, ResourceExhausted
from wayfarer.models.artifacts import MANIFEST, ModelFolder

NAME: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}")
RETRY_AFTER: Final = 5.0

NICENESS: Final = 10
"""Added to the niceness of the warm-up thread, on systems with niceness per thread (Linux)."""


@dataclass(eq=False)
class ModelStore:
    """The folders that hold model folders."""

    folders: Sequence[Path]  # the first one that holds a name wins
    check: Callable[[Path], ModelFolder]  # raises ArtifactError for a model that does not fit
    open_engine: Callable[[ModelFolder], WarmEngine]
    agents: int  # engines are warmed for batches of up to this many
    candidates: Sequence[int]

    def find(self, name: str) -> Path:
        """The folder of a model. Raises InvalidArgument, NotFound."""
        if not NAME.fullmatch(name):
            raise InvalidArgument(
                f"model name is {name[:64]!r}; allowed: up to 64 letters, digits, '.', '_' and "
                "'-', a letter or digit first",
                "name",
            )
        for folder in self.folders:
            if (folder / name / MANIFEST).is_file():
                return folder / name
        raise NotFound(f"no model {name!r}; there are {', '.join(self.names()) or 'none'}")

    def names(self) -> list[str]:
        """The names of all models in the folders."""
        manifests = [file for folder in self.folders for file in folder.glob(f"*/{MANIFEST}")]
        return sorted({m.parent.name for m in manifests if NAME.fullmatch(m.parent.name)})

    def open(self, name: str) -> WarmEngine:
        """Checks, loads and warms a model. Called in a separate thread, whose priority falls.

        Raises InvalidArgument, NotFound, ArtifactError.
        """
        engine = self.open_engine(self.check(self.find(name)))
        # Only now: the engine's threads would have inherited the priority.
        give_way(NICENESS)
        engine.warm_up(engine.sizes_for(self.agents), self.candidates, _pause)
        return engine


class ModelLoader:
    """Loads and unloads the models of a server while it serves."""

    def __init__(self, models: LoadedModels, open_engine: Callable[[str], Engine]) -> None:
        """`open_engine(name)` is called in a separate thread."""
        self._models = models
        self._open = open_engine
        self._loading: str | None = None

    async def load(self, name: str) -> None:
        """Returns when the model is usable. If cancelled, loading continues, and its result goes.

        Raises AlreadyExists, ResourceExhausted, and what `open_engine` raises.
        """
        self._models.check_new(name)
        if self._loading is not None:
            raise ResourceExhausted(
                f"model {self._loading!r} is being loaded, and only one can be at a time",
                RETRY_AFTER,
            )
        self._loading = name
        opened: Future[Engine] = Future()
        opened.add_done_callback(self._loaded)
        Thread(target=self._work, args=(name, opened), name="model-load", daemon=True).start()
        self._models.add(await asyncio.wrap_future(opened))

    def _work(self, name: str, opened: "Future[Engine]") -> None:
        opened.set_running_or_notify_cancel()
        try:
            engine = self._open(name)
        except BaseException as error:  # raised again in the task that waits, as an executor does
            opened.set_exception(error)
        else:
            opened.set_result(engine)

    def _loaded(self, _: "Future[Engine]") -> None:
        self._loading = None


def no_model(name: str) -> Engine:
    """The answer of a server that has no store. Raises NotFound."""
    raise NotFound(f"no model {name!r}: this server has no folder of models")


def _pause(agents: int, candidates: int, seconds: float) -> None:
    """Warming takes no more than half of the engine's threads' time."""
    time.sleep(seconds)
