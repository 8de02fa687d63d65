"""The transport's record of each scene: owner, basis, lease."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Final

from wayfarer.config.limits import Limits
from wayfarer.errors import ResourceExhausted
from wayfarer.transport import schema
from wayfarer.transport.conversion import scene_convert
from wayfarer.transport.conversion.basis import Axes
from wayfarer.transport.edge.caller import Caller
from wayfarer.transport.gateway.leases import Leased, Leases, counted
from wayfarer.transport.gateway.session_locator import SessionLocator
from wayfarer.world.scenes.messages import SceneInfo

SCENE_LEASE_S: Final = 3600.0
"""Lease of a scene whose request names none."""


@dataclass
class OpenScene(Leased):
    """A scene of the runtime, as its clients see it."""

    scene_id: str

    @property
    def axes(self) -> Axes:
        """The axes of its basis."""
        return self.basis.axes

    def describe(self, info: SceneInfo) -> schema.Scene:
        """Describes it for its client; `info` is its present state in the runtime."""
        return scene_convert.scene(info, self.basis, self.lease_s, self.endpoint)


class SceneAccess(Leases[OpenScene]):
    """All scenes, and the rights of callers to them."""

    def __init__(self, limits: Limits, clock: Callable[[], float], locator: SessionLocator) -> None:
        super().__init__("scene", limits, clock, locator)

    def open(self, info: SceneInfo) -> OpenScene:
        """Enters a scene of the runtime by its attributes, with a fresh lease.

        Raises InvalidArgument if the attributes were not made by the transport.
        """
        scene = OpenScene(**vars(self._lease(info.attributes)), scene_id=info.scene_id)
        self._open[info.scene_id] = scene
        return scene

    def scene(self, scene_id: str) -> OpenScene:
        """Returns the caller's scene and renews its lease. Raises NotFound, Misdirected."""
        found = self._checked(self._open.get(scene_id), "scene", scene_id)
        self.renew(found)
        return found

    @contextmanager
    def room(self, caller: Caller) -> Iterator[None]:
        """Reserves room for a scene that is being made. Raises ResourceExhausted."""
        own = sum(scene.owner == caller.name for scene in self._open.values())
        most = self._limits.scenes_per_caller
        if own + self._coming[caller.name] >= most:
            raise ResourceExhausted(
                f"{caller.name!r} has {own} scenes and may have {most}; delete one first"
            )
        with counted(self._coming, caller.name):
            yield
