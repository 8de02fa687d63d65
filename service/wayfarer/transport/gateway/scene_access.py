"""The transport's record of each scene: owner, basis, lease."""

from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Final

from wayfarer.config.limits import Limits
from wayfarer.errors import NotFound, ResourceExhausted
from wayfarer.transport import schema
from wayfarer.transport.conversion import scene_convert
from wayfarer.transport.conversion.basis import Axes, Basis
from wayfarer.transport.edge.caller import Caller, current_caller
from wayfarer.transport.gateway.leases import counted, read_attributes
from wayfarer.transport.gateway.session_locator import SessionLocator
from wayfarer.world.scenes.messages import SceneInfo

SCENE_LEASE_S: Final = 3600.0
"""Lease of a scene whose request names none."""

ID_LENGTH: Final = schema.ID_LENGTH


@dataclass
class OpenScene:
    """A scene of the runtime, as its clients see it."""

    scene_id: str
    owner: str
    basis: Basis
    lease_s: float
    expires_at: float  # clock's seconds, without regard to sessions
    endpoint: schema.Endpoint | None = None

    @property
    def axes(self) -> Axes:
        """The axes of its basis."""
        return self.basis.axes

    def describe(self, info: SceneInfo) -> schema.Scene:
        """Describes it for its client; `info` is its present state in the runtime."""
        return scene_convert.scene(info, self.basis, self.lease_s, self.endpoint)


class SceneAccess:
    """All scenes, and the rights of callers to them."""

    def __init__(self, limits: Limits, clock: Callable[[], float], locator: SessionLocator) -> None:
        self._limits = limits
        self._clock = clock
        self._locator = locator
        self._scenes: dict[str, OpenScene] = {}
        self._coming: Counter[str] = Counter()  # scenes being made, by owner

    def open(self, info: SceneInfo) -> OpenScene:
        """Enters a scene of the runtime by its attributes, with a fresh lease.

        Raises InvalidArgument if the attributes were not made by the transport.
        """
        owner, basis, lease_s = read_attributes("scene", info.attributes, self._limits)
        expires_at = self._clock() + lease_s
        scene = OpenScene(info.scene_id, owner, basis, lease_s, expires_at, self._locator.own)
        self._scenes[info.scene_id] = scene
        return scene

    def ids(self) -> list[str]:
        """Ids of all scenes."""
        return list(self._scenes)

    def forget(self, scene_id: str) -> None:
        """Like `close`, for any owner."""
        self._scenes.pop(scene_id, None)

    def close(self, scene: OpenScene) -> None:
        """Forgets a scene. Safe to call twice, even if a new scene has the same id by then."""
        if self._scenes.get(scene.scene_id) is scene:
            del self._scenes[scene.scene_id]

    def scene(self, scene_id: str) -> OpenScene:
        """Returns the caller's scene and renews its lease. Raises NotFound, Misdirected."""
        found, caller = self._scenes.get(scene_id), current_caller()
        if found is None:
            self._locator.require_own(scene_id[:ID_LENGTH])
        if found is None or (found.owner != caller.name and not caller.is_admin):
            name = scene_id[:ID_LENGTH]
            raise NotFound(f"there is no scene {name!r}", "scene", name)
        self.renew(found)
        return found

    def renew(self, scene: OpenScene) -> None:
        """Restarts its lease."""
        scene.expires_at = self._clock() + scene.lease_s

    def owned(self, caller: Caller) -> list[OpenScene]:
        """The caller's scenes, oldest first; an admin sees all."""
        return [s for s in self._scenes.values() if s.owner == caller.name or caller.is_admin]

    def expired(self) -> list[OpenScene]:
        """Scenes without sessions whose lease has expired."""
        now = self._clock()
        return [scene for scene in self._scenes.values() if scene.expires_at < now]

    @contextmanager
    def room(self, caller: Caller) -> Iterator[None]:
        """Reserves room for a scene that is being made. Raises ResourceExhausted."""
        own = sum(scene.owner == caller.name for scene in self._scenes.values())
        most = self._limits.scenes_per_caller
        if own + self._coming[caller.name] >= most:
            raise ResourceExhausted(
                f"{caller.name!r} has {own} scenes and may have {most}; delete one first"
            )
        with counted(self._coming, caller.name):
            yield
