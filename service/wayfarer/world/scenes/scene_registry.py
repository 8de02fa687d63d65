"""The scenes of a server: baked once for equal content, changed version by version.

A scene never changes (`navigation/scene.py`); its name comes to stand for another version. So
readers on any thread take the present version and keep it as long as they like. Bakes and changes
take milliseconds to seconds, so they belong on a worker thread.
"""

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from threading import BoundedSemaphore, Lock
from typing import Final, Protocol

from wayfarer.config.limits import Limits
from wayfarer.errors import (
    AlreadyExists,
    FailedPrecondition,
    InvalidArgument,
    NotFound,
    ResourceExhausted,
)
from wayfarer.ids import new_group
from wayfarer.ids import scene_id as new_scene_id
from wayfarer.navigation.scene import Scene, bake
from wayfarer.navigation.scene_spec import Obstacle, SceneSpec
from wayfarer.world.scenes.messages import SceneInfo, SceneSource

NAME: Final = 64
"""Maximum characters of the names of scenes and obstacles."""

NAMED: Final = 3
"""Maximum number of sessions named by the refusal to delete a scene."""

RETRY_AFTER: Final = 2.0

MAX_BAKES: Final = 5
"""Bakes at a time: one is made, the others wait for it."""


@dataclass(frozen=True, slots=True)
class SceneRecord:
    """A scene at rest."""

    scene_id: str
    source: SceneSource
    created_at: float
    version: int
    obstacles: Mapping[str, Obstacle]
    baked: Scene | None = None  # without obstacles; None: it has still to be baked


@dataclass(slots=True)
class SceneEntry:
    """A scene under its id. `scene` is replaced as a whole."""

    scene_id: str
    source: SceneSource
    baked: Scene  # without obstacles
    scene: Scene  # the present version
    created_at: float
    bake_s: float
    sessions: list[str] = field(default_factory=list)  # ids of those in it, oldest first
    changing: Lock = field(default_factory=Lock)  # one change at a time

    def info(self) -> SceneInfo:
        """Its present description."""
        scene = self.scene
        return SceneInfo(
            scene_id=self.scene_id,
            name=self.source.name,
            content_hash=scene.content_hash,
            version=scene.version,
            area=scene.area,
            islands=scene.islands,
            bounds=scene.bounds,
            obstacles=dict(scene.obstacles),
            sessions=len(self.sessions),
            created_at=self.created_at,
            bake_s=self.bake_s,
            attributes=self.source.attributes,
            notes=scene.notes,
        )


class SceneListener(Protocol):
    """Receives the changes of a registry, in order."""

    def put_scene(self, entry: SceneEntry) -> None:
        """A scene was created."""
        ...

    def put_obstacles(self, entry: SceneEntry) -> None:
        """Its obstacles have changed."""
        ...

    def drop_scene(self, scene_id: str) -> None:
        """A scene was deleted."""
        ...


class SceneRegistry:
    """Scenes by id. Thread-safe. Methods that take time say so."""

    def __init__(
        self,
        limits: Limits = Limits(),
        new_group: Callable[[], str] = new_group,
        bake: Callable[[SceneSpec], Scene] = bake,
        listener: SceneListener | None = None,
    ) -> None:
        self._limits = limits
        self._new_group = new_group
        self._bake = bake
        self._listener = listener
        self._entries: dict[str, SceneEntry] = {}
        self._lock = Lock()
        self._queue = BoundedSemaphore(MAX_BAKES)
        self._baking = Lock()

    # Life of a scene

    def create(
        self, source: SceneSource, now: float = 0.0, scene_id: str = "", baked: Scene | None = None
    ) -> SceneInfo:
        """Bakes it, unless it is `baked`, or there is one of equal content. Takes time. `scene_id`:
        empty for a new one.

        Raises InvalidArgument that names the field, AlreadyExists, ResourceExhausted.
        """
        check_name(source.name, "name", least=0)
        self._check_room()
        started = time.perf_counter()
        scene = self._found(source.spec, baked)
        took = time.perf_counter() - started
        scene_id = scene_id or new_scene_id(self._new_group())
        entry = SceneEntry(scene_id, source, scene, scene, now, took)
        with self._lock:
            self._check_room()
            self._enter(entry)
            if self._listener is not None:
                self._listener.put_scene(entry)
        return entry.info()

    def restore(self, record: SceneRecord, *, reported: bool = True) -> SceneInfo:
        """Restores a kept scene, also beyond `limits.scenes`, since people are in it. Takes time.

        Not `reported`: the listener does not know it yet. Raises as `create` and `put`.
        """
        started = time.perf_counter()
        scene = baked = self._found(record.source.spec, record.baked)
        for name, obstacle in record.obstacles.items():
            scene = scene.put(name, obstacle)
        took = time.perf_counter() - started
        scene = replace(scene, version=record.version)
        entry = SceneEntry(record.scene_id, record.source, baked, scene, record.created_at, took)
        with self._lock:
            self._enter(entry)
            if self._listener is not None and not reported:
                self._listener.put_scene(entry)
                self._listener.put_obstacles(entry)
        return entry.info()

    def delete(self, scene_id: str) -> None:
        """Raises NotFound, FailedPrecondition while sessions are in it."""
        with self._lock:
            entry = self.entry(scene_id)
            if entry.sessions:
                names = ", ".join(map(repr, entry.sessions[:NAMED]))
                more = len(entry.sessions) - NAMED
                raise FailedPrecondition(
                    f"scene {scene_id!r} is in use; delete its sessions first: {names}"
                    + (f" and {more} more" if more > 0 else "")
                )
            del self._entries[scene_id]
            if self._listener is not None:
                self._listener.drop_scene(scene_id)

    def put(self, scene_id: str, name: str, obstacle: Obstacle) -> SceneInfo:
        """Adds an obstacle, or moves an existing one. Takes time.

        Raises NotFound, InvalidArgument, ResourceExhausted, FailedPrecondition.
        """
        check_name(name, "name")
        return self._change(scene_id, lambda scene: scene.put(name, obstacle))

    def remove(self, scene_id: str, name: str) -> SceneInfo:
        """Removes an obstacle. Takes time. Raises NotFound."""
        return self._change(scene_id, lambda scene: scene.remove(name))

    # Readers

    def entry(self, scene_id: str) -> SceneEntry:
        """Its present version is `entry(scene_id).scene`. Raises NotFound."""
        try:
            return self._entries[scene_id]
        except KeyError:
            raise NotFound(f"no scene {scene_id!r}", "scene", scene_id) from None

    def infos(self) -> list[SceneInfo]:
        """All scenes, oldest first."""
        with self._lock:
            entries = list(self._entries.values())
        return [entry.info() for entry in entries]

    # Sessions

    def enter(self, scene_id: str, session_id: str) -> SceneEntry:
        """Notes that a session is opened in it, so that it cannot be deleted. Raises NotFound."""
        with self._lock:
            entry = self.entry(scene_id)
            entry.sessions.append(session_id)
            return entry

    def leave(self, scene_id: str, session_id: str) -> None:
        """Notes that a session in it has ended."""
        with self._lock:
            self.entry(scene_id).sessions.remove(session_id)

    # Private

    def _check_room(self) -> None:
        if len(self._entries) >= self._limits.scenes:
            raise ResourceExhausted(
                f"all {self._limits.scenes} scenes are taken; delete one that nobody is in"
            )

    def _found(self, spec: SceneSpec, baked: Scene | None) -> Scene:
        """The baked scene of equal content, if there is one; otherwise `baked`, or a new one."""
        return self._alike(spec) or baked or self._baked(spec)

    def _alike(self, spec: SceneSpec) -> Scene | None:
        content, entries = spec.content_hash, list(self._entries.values())
        return next((one.baked for one in entries if one.baked.content_hash == content), None)

    def _baked(self, spec: SceneSpec) -> Scene:
        with self._turn():
            return self._alike(spec) or self._bake(spec)

    @contextmanager
    def _turn(self) -> Iterator[None]:
        if not self._queue.acquire(blocking=False):
            raise ResourceExhausted(
                f"{MAX_BAKES} scenes are being baked or wait for it; try again",
                RETRY_AFTER,
            )
        try:
            with self._baking:
                yield
        finally:
            self._queue.release()

    def _enter(self, entry: SceneEntry) -> None:
        if entry.scene_id in self._entries:
            raise AlreadyExists(f"scene {entry.scene_id!r} exists already")
        self._entries[entry.scene_id] = entry

    def _change(self, scene_id: str, change: Callable[[Scene], Scene]) -> SceneInfo:
        entry = self.entry(scene_id)
        with entry.changing:
            entry.scene = change(entry.scene)
            with self._lock:
                if self._listener is not None and scene_id in self._entries:
                    self._listener.put_obstacles(entry)
            return entry.info()


def check_name(name: str, field: str, least: int = 1) -> None:
    """Raises InvalidArgument."""
    if not (least <= len(name) <= NAME and name.isprintable()):
        raise InvalidArgument(
            f"{field} must be {least} to {NAME} printable characters, got {len(name)}", field
        )
