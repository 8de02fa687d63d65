"""The scenes of a server: baked once for equal content, changed version by version.

A scene never changes (`navigation/scene.py`); its name comes to stand for another version. So
readers on any thread take the present version and keep it as long as they like. Bakes and changes
take milliseconds to seconds, so they belong on a worker thread.
"""

import time
from collections.abc import Callable, Iterable, Iterator, Mapping
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

    def create(self, source: SceneSource, now: float, scene_id: str = "") -> SceneInfo:
        """Bakes it, unless there is one of equal content. Takes time. `scene_id`: empty for a new
        one.

        Raises InvalidArgument that names the field, AlreadyExists, ResourceExhausted.
        """
        check_name(source.name, "name", least=0)
        self._check_room()
        started = time.perf_counter()
        scene = self._alike(source.spec) or self._baked(source.spec)
        scene_id = scene_id or new_scene_id(self._new_group())
        return self._add(scene_id, source, scene, now, time.perf_counter() - started)

    def restore(
        self,
        scene_id: str,
        source: SceneSource,
        created_at: float,
        version: int,
        obstacles: Mapping[str, Obstacle],
        *,
        reported: bool = True,
        baked: Scene | None = None,
    ) -> None:
        """Restores a kept scene, also beyond `limits.scenes`, since people are in it. Takes time.

        Not `reported`: the listener does not know it yet. `baked`: as another server made it.
        Raises as `create` and `put`.
        """
        started = time.perf_counter()
        baked = self._alike(source.spec) or baked or self._baked(source.spec)
        scene = baked
        for name, obstacle in obstacles.items():
            scene = scene.put(name, obstacle)
        took = time.perf_counter() - started
        entry = SceneEntry(
            scene_id, source, baked, replace(scene, version=version), created_at, took
        )
        with self._lock:
            self._enter(entry)
            if self._listener is not None and not reported:
                self._listener.put_scene(entry)
                self._listener.put_obstacles(entry)

    def add(self, scene: Scene, now: float = 0.0, name: str = "") -> SceneInfo:
        """Keeps a scene that has been baked already. Raises ResourceExhausted."""
        scene_id = new_scene_id(self._new_group())
        return self._add(scene_id, SceneSource(scene.spec, name), scene, now, 0.0)

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

    def scene(self, scene_id: str) -> Scene:
        """The present version. Raises NotFound."""
        return self.entry(scene_id).scene

    def current(self, scene_ids: Iterable[str]) -> Mapping[str, Scene]:
        """The present versions of the scenes that still exist."""
        return {name: self._entries[name].scene for name in scene_ids if name in self._entries}

    def entry(self, scene_id: str) -> SceneEntry:
        """The entry of a scene. Raises NotFound."""
        try:
            return self._entries[scene_id]
        except KeyError:
            raise NotFound(f"no scene {scene_id!r}", "scene", scene_id) from None

    def info(self, scene_id: str) -> SceneInfo:
        """Raises NotFound."""
        return self.entry(scene_id).info()

    def infos(self) -> list[SceneInfo]:
        """All scenes, oldest first."""
        with self._lock:
            entries = list(self._entries.values())
        return [entry.info() for entry in entries]

    # Sessions

    def enter(self, scene_id: str, session_id: str) -> Scene:
        """Notes that a session is opened in it, so that it cannot be deleted. Raises NotFound."""
        with self._lock:
            entry = self.entry(scene_id)
            entry.sessions.append(session_id)
            return entry.scene

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

    def _alike(self, spec: SceneSpec) -> Scene | None:
        """The baked scene of equal content, if there is one."""
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

    def _add(
        self, scene_id: str, source: SceneSource, scene: Scene, now: float, bake_s: float
    ) -> SceneInfo:
        entry = SceneEntry(scene_id, source, scene, scene, now, bake_s)
        with self._lock:
            self._check_room()
            self._enter(entry)
            if self._listener is not None:
                self._listener.put_scene(entry)
        return entry.info()

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
