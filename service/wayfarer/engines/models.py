"""The motion models of a server, side by side, and the model of each agent.

Agents hold the number of their model in their slot; a number is never used twice. All worlds of a
server share one `LoadedModels`, and each has its own `Roster`.
"""

import threading
from collections import Counter
from dataclasses import dataclass
from hashlib import sha256
from typing import Final
from weakref import WeakSet

from wayfarer.engines.engine import Engine
from wayfarer.errors import AlreadyExists, FailedPrecondition, NotFound, ResourceExhausted
from wayfarer.spec import GENDERS, PRIMITIVE_FRAMES, SEED_FRAMES

MOST: Final = 4
"""Models at a time: each takes memory for its weights and its batches."""


@dataclass(frozen=True, slots=True)
class ModelInfo:
    """A loaded motion model."""

    name: str
    genders: tuple[str, ...]  # of the bodies that it can move
    seed_frames: int
    primitive_frames: int
    sha256: tuple[str, ...]  # of each graph, in the order of `genders`
    in_use: bool  # new agents are moved by it


@dataclass(frozen=True, slots=True)
class Loaded:
    """A model that can move agents."""

    number: int
    engine: Engine
    stamp: str  # name and what it is: two of the same stamp give the same motion

    @classmethod
    def of(cls, number: int, engine: Engine) -> "Loaded":
        """The model of an engine, with its stamp."""
        graphs = sha256("".join(engine.graphs).encode()).hexdigest()
        return cls(number, engine, f"{engine.name}@{graphs[:16]}")

    @property
    def name(self) -> str:
        """The name of the model."""
        return self.engine.name


class LoadedModels:
    """Engines by number. Safe to use from several threads."""

    def __init__(self, engine: Engine) -> None:
        """`engine` is in use first."""
        self._lock = threading.Lock()
        # Replaced as a whole, never changed: threads read it without the lock.
        self._loaded: tuple[Loaded, ...] = (Loaded.of(0, engine),)
        self._in_use = self._loaded[0]
        self._last_number = 0
        self._rosters: WeakSet[Roster] = WeakSet()  # of the worlds that live

    @property
    def stamps(self) -> tuple[str, ...]:
        """Descriptions of all loaded models."""
        return tuple(model.stamp for model in self._loaded)

    def infos(self) -> list[ModelInfo]:
        """Stamps of all loaded models, in order of loading."""
        return [
            ModelInfo(
                name=model.name,
                genders=GENDERS,
                seed_frames=SEED_FRAMES,
                primitive_frames=PRIMITIVE_FRAMES,
                sha256=model.engine.graphs,
                in_use=model is self._in_use,
            )
            for model in self._loaded
        ]

    def numbered(self, number: int) -> Loaded:
        """The model of an agent's slot."""
        return next(model for model in self._loaded if model.number == number)

    def named(self, name: str) -> Loaded:
        """Raises NotFound."""
        for model in self._loaded:
            if model.name == name:
                return model
        names = ", ".join(repr(model.name) for model in self._loaded)
        raise NotFound(f"no model {name!r} is loaded; loaded are {names}")

    def stamped(self, stamp: str) -> Loaded:
        """Raises FailedPrecondition."""
        for model in self._loaded:
            if model.stamp == stamp:
                return model
        raise FailedPrecondition(f"no model {stamp} is loaded; loaded are {', '.join(self.stamps)}")

    def copy(self) -> "LoadedModels":
        """A copy that later changes do not affect, for worlds that end soon."""
        with self._lock:
            other = LoadedModels(self._in_use.engine)
            other._loaded, other._in_use = self._loaded, self._in_use
            return other

    def check_new(self, name: str) -> None:
        """Raises AlreadyExists, or ResourceExhausted when no more can be loaded."""
        if any(model.name == name for model in self._loaded):
            raise AlreadyExists(f"model {name!r} is loaded already")
        if len(self._loaded) >= MOST:
            raise ResourceExhausted(f"{MOST} models are loaded, and no more can be; unload one")

    def add(self, engine: Engine) -> None:
        """Adds an engine. Raises AlreadyExists, ResourceExhausted."""
        with self._lock:
            self.check_new(engine.name)
            self._last_number += 1
            self._loaded = (*self._loaded, Loaded.of(self._last_number, engine))

    def use(self, name: str) -> Loaded:
        """Moves new agents with this model. Raises NotFound."""
        with self._lock:
            self._in_use = self.named(name)
            return self._in_use

    def remove(self, name: str) -> None:
        """Raises NotFound, and FailedPrecondition while the model is in use or moves an agent."""
        with self._lock:
            model = self.named(name)
            if model is self._in_use:
                raise FailedPrecondition(f"model {name!r} is in use: use another model first")
            agents = sum(roster.agents[model.number] for roster in self._rosters)
            if agents:
                raise FailedPrecondition(
                    f"model {name!r} moves {agents} agents: move them to another, or delete them"
                )
            self._loaded = tuple(other for other in self._loaded if other is not model)

    def roster(self) -> "Roster":
        """Makes an empty roster for a world."""
        with self._lock:
            roster = Roster()
            self._rosters.add(roster)
            return roster

    def enter(self, roster: "Roster", stamp: str = "") -> int:
        """An agent enters. Returns the number of its model.

        That is the one of the stamp, or one of that name (a stamp may be a name alone), or the
        one in use.
        """
        name = stamp.partition("@")[0]
        with self._lock:
            model = next(
                (m for m in self._loaded if m.stamp == stamp),
                next((m for m in self._loaded if m.name == name), self._in_use),
            )
            roster.agents[model.number] += 1
            return model.number

    def leave(self, roster: "Roster", number: int) -> None:
        """An agent of this model ends."""
        with self._lock:
            roster.agents[number] -= 1

    def change(self, roster: "Roster", number: int, model: Loaded) -> None:
        """Gives an agent of model `number` another model. Raises NotFound."""
        with self._lock:
            if model not in self._loaded:
                raise NotFound(f"model {model.name!r} is not loaded any more")
            roster.agents[number] -= 1
            roster.agents[model.number] += 1


class Roster:
    """The number of agents of one world for each model. Forgotten with its world."""

    def __init__(self) -> None:
        self.agents: Counter[int] = Counter()  # by number of the model
