"""Keeping away from an agent or a place."""

from collections.abc import Callable
from dataclasses import dataclass
from math import cos, dist, pi, sin
from typing import Annotated, ClassVar, Final, Literal

import numpy as np
from numpy.typing import NDArray

from wayfarer.config.limits import Limits
from wayfarer.errors import InvalidArgument, Metres, MetresPerSecond
from wayfarer.world.agents.behaviour import (
    STAND,
    Aim,
    BehavingAgent,
    Behaviour,
    BodyState,
    Start,
    Vector,
)
from wayfarer.world.agents.checks import check_agent_id
from wayfarer.world.agents.goal import SPEED
from wayfarer.world.ranges import check_place, check_range

DISTANCE: Final = (0.5, 50.0)
"""Range of the distance to keep, in metres."""

LOOKAHEAD: Final = 3.0
"""Metres of free ground that are checked in each direction."""

CORNERED: Final = 0.6
"""With fewer metres of free ground in every direction, the agent stays in place."""

CALM: Final = 1.25
"""Multiple of the distance to keep at which it stands again."""

_RUNS: Final = np.arange(0.3, LOOKAHEAD + 0.01, 0.3)
_TURNS: Final = np.array([(cos(k * pi / 12), sin(k * pi / 12)) for k in range(24)])

Room = Callable[[NDArray[np.float64]], NDArray[np.float64]]
"""How far points [D, R, 2] are inside walkable ground [D, R], metres; negative: outside."""


@dataclass(frozen=True, slots=True)
class KeepAway(Behaviour):
    """Standing until an agent, or a place, is nearer than `distance`; then walking away from it.

    Exactly one of `agent_id` and `place` is given. It ends when the other agent is deleted.
    """

    agent_id: str = ""
    place: tuple[float, float] | None = None  # metres, on the floor
    # metres; the agent stops when it is a quarter farther away
    distance: Annotated[float, DISTANCE] = 4.0
    speed: Annotated[float, SPEED] = 1.6  # m/s
    kind: Literal["keep_away"] = "keep_away"

    NEEDS_OTHERS: ClassVar[bool] = True

    @property
    def named_agent(self) -> str:
        """The agent to keep away from, if it is one."""
        return self.agent_id

    def check(self, start: Start, limits: Limits, where: str) -> None:
        """Implements `Behaviour`."""
        if (self.place is None) != bool(self.agent_id):
            raise InvalidArgument(
                "keep away from an agent or from a place: give exactly one of the two", where
            )
        if self.place is None:
            check_agent_id(self.agent_id, f"{where}.agent_id")
        else:
            check_place(self.place, f"{where}.place")
        check_range([self.distance], *DISTANCE, f"{where}.distance", Metres)
        check_range([self.speed], *SPEED, f"{where}.speed", MetresPerSecond)

    def update(self, actor: BehavingAgent) -> None:
        """Implements `Behaviour`."""
        threat = self.place
        if threat is None:
            other = actor.look_at(self.agent_id)
            if other is None:
                return
            threat = other.place
        actor.aim(keep_away(self, actor.body, threat, actor.is_moving, _room(actor)))


def _room(actor: BehavingAgent) -> Room | None:
    if (scene := actor.scene) is None:
        return None
    height, radius = actor.height, scene.spec.walkable.radius

    def room(points: NDArray[np.float64]) -> NDArray[np.float64]:
        lifted = np.concatenate([points, np.full((*points.shape[:2], 1), height)], -1)
        return np.asarray(scene.distance(lifted) - radius)

    return room


def keep_away(
    behaviour: KeepAway,
    me: BodyState,
    threat: Vector,
    flees: bool,
    room: Room | None,
) -> Aim:
    """The aim away from `threat` if it is too near, and while it `flees` until it is far enough.

    `room` None: all ground can be walked on.
    """
    apart = dist(me.place, threat)
    if apart > behaviour.distance * (CALM if flees else 1.0):
        return STAND
    place = np.array(me.place)
    free = np.full(len(_TURNS), LOOKAHEAD)
    if room is not None:
        points = place + _TURNS[:, None] * _RUNS[:, None]
        shut = room(points) < 0
        free = np.where(shut.any(1), _RUNS[shut.argmax(1)] - _RUNS[0], LOOKAHEAD)
    ends = place + _TURNS * free[:, None]
    gain = np.hypot(*(ends - threat).T) + 0.3 * (_TURNS @ me.velocity) / max(me.speed, 1.0)
    gain[free < CORNERED] = -np.inf
    best = int(gain.argmax())
    if gain[best] <= apart:
        return STAND
    x, y = ends[best].tolist()
    way = float(_TURNS[best, 0]), float(_TURNS[best, 1])
    return Aim((x, y), speed=behaviour.speed, onward=way)
