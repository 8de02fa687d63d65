"""The fake service's scenes are real; tests make small ones, in which nobody walks."""

from itertools import count

from tests.transport.samples import NOW
from wayfarer.config.limits import Limits
from wayfarer.runtime.move_locks import MoveLocks
from wayfarer.runtime.persistence.persistence import Persistence
from wayfarer.runtime.scenes import SceneService
from wayfarer.world.scenes.messages import Crowd, CrowdState
from wayfarer.world.scenes.populate import CrowdPeople
from wayfarer.world.scenes.scene_registry import SceneRegistry


class FakeScenes(SceneService):
    """A crowd comes at once, and nobody of it is there."""

    def __init__(self) -> None:
        numbers, limits = count(1), Limits()
        super().__init__(
            registry=SceneRegistry(limits, lambda: f"{next(numbers):012x}"),
            persistence=Persistence(None, limits),
            homes=None,
            clock=lambda: NOW,
            move_locks=MoveLocks(),
        )
        self.crowds: list[tuple[str, Crowd]] = []
        self.people: list[str] = []  # ids of agents that came without a call

    async def populate(self, session_id: str, crowd: Crowd) -> CrowdState:
        self.crowds.append((session_id, crowd))
        return CrowdState(crowd.count, 0)

    async def crowd(self, session_id: str) -> CrowdPeople | None:
        crowds = [crowd for name, crowd in self.crowds if name == session_id]
        return CrowdPeople(crowds[-1], 0.0, leaves_at=dict.fromkeys(self.people, 0.0))
