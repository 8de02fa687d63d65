"""Following: a place relative to another agent."""

from dataclasses import dataclass
from math import dist, hypot
from typing import Annotated, ClassVar, Final, Literal

from wayfarer.config.limits import Limits
from wayfarer.errors import InvalidArgument, Metres
from wayfarer.world.agents.behaviour import (
    Agent,
    Aim,
    BehavingAgent,
    Behaviour,
    BodyState,
    Others,
    Start,
    Vector,
)
from wayfarer.world.agents.checks import check_agent_id
from wayfarer.world.ranges import check_range

BESIDE: Final = (-10.0, 10.0)
"""Range of the distance behind or to the right, in metres."""

MIN_APART: Final = 0.5
"""Minimum metres between the follower's place and its leader."""

WALKING: Final = 0.35
"""m/s below which a leader stands, for its followers."""

AHEAD: Final = 1.2
"""Metres before its place that a follower aims at, so that it walks along and not to a point."""

JOINED: Final = 1.5
"""Metres from its place within which a follower walks along; a farther one catches up."""

SLACK: Final = 0.6
"""Maximum metres between a standing follower and its place before it takes another."""

CATCH_UP: Final = 0.8
"""1/s: gain of the speed on the distance to its place."""

FASTEST: Final = 2.2
SLOWEST: Final = 0.4


@dataclass(frozen=True, slots=True)
class Follow(Behaviour):
    """Keeping to a place relative to another agent: walking as it walks, standing as it stands.

    Agents that follow one another are a group and do not avoid each other like strangers. It ends,
    and the agent stops, when the other is deleted.
    """

    agent_id: str
    behind: Annotated[float, BESIDE] = 1.2  # metres behind it; negative means before it
    right: Annotated[float, BESIDE] = 0.0  # metres to its right; negative means to its left
    kind: Literal["follow"] = "follow"

    NEEDS_OTHERS: ClassVar[bool] = True

    @property
    def named_agent(self) -> str:
        """The leader."""
        return self.agent_id

    def check(self, start: Start, limits: Limits, where: str) -> None:
        """Implements `Behaviour`."""
        check_agent_id(self.agent_id, f"{where}.agent_id")
        for name in ("behind", "right"):
            check_range([getattr(self, name)], *BESIDE, f"{where}.{name}", Metres)
        if (apart := hypot(self.behind, self.right)) < MIN_APART:
            raise InvalidArgument(
                "its place is {} from whom it follows; allowed: {} or more",
                f"{where}.behind",
                Metres(round(apart, 2)),
                Metres(MIN_APART),
            )

    def check_others(self, agent: Agent, others: Others) -> None:
        """Refuses a circle: the leader must not follow the agent, directly or not."""
        leader, passed = others.agent(self.agent_id), list[Agent]()
        while leader is not None and leader not in passed:
            passed.append(leader)
            doing = others.doing(leader)
            leader = others.agent(doing.agent_id) if isinstance(doing, Follow) else None
        if any(one.agent_id == agent.agent_id for one in passed):
            raise InvalidArgument(
                "agents would follow each other in a circle", "behaviour.agent_id"
            )

    def update(self, actor: BehavingAgent) -> None:
        """Implements `Behaviour`."""
        leader = actor.look_at(self.agent_id)
        if leader is not None:
            actor.walk_with(self.agent_id)
            aim = follow(self, actor.body, leader, actor.stood_at)
            actor.aim(aim, on_floor_of=self.agent_id)


def follow(behaviour: Follow, me: BodyState, leader: BodyState, last: Vector | None) -> Aim:
    """The aim at a place relative to `leader`; `last` is that place while the leader stood."""
    if leader.speed < WALKING:
        place = _beside(behaviour, leader.place, leader.facing)
        reach = hypot(behaviour.behind, behaviour.right) + SLACK
        if last is not None and 0.5 < dist(last, leader.place) < reach:
            place = last  # the leader turned, or sways: no reason to walk around it
        return Aim(place, facing=leader.facing)
    x, y = leader.velocity
    way = x / leader.speed, y / leader.speed
    place = _beside(behaviour, leader.place, way)
    off = place[0] - me.place[0], place[1] - me.place[1]
    if hypot(*off) > JOINED:
        return Aim(place, speed=min(max(leader.speed + 0.6, 1.4), FASTEST), onward=way)
    along = off[0] * way[0] + off[1] * way[1]
    speed = min(max(leader.speed + CATCH_UP * along, SLOWEST), FASTEST)
    aim = place[0] + AHEAD * way[0], place[1] + AHEAD * way[1]
    return Aim(aim, speed=speed, onward=way)


def _beside(behaviour: Follow, place: Vector, way: Vector) -> Vector:
    """The place behind and to the right of an agent that faces along `way`."""
    x, y = way
    return (
        place[0] - behaviour.behind * x + behaviour.right * y,
        place[1] - behaviour.behind * y - behaviour.right * x,
    )
