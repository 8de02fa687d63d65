"""The plan of a load run."""

import math
import random
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from wayfarer.errors import InvalidArgument
from wayfarer.v1 import common_pb2
from wayfarer_lab.load.rings import LoadRing, WalkingViewpoint, check_rings

TRANSPORTS = ("grpc", "websocket")

MAX_AREA: Final = 1000.0
"""Metres: largest radius of the disc in which agents walk."""

MAX_SPEED: Final = 100.0
"""Metres per second of a viewpoint."""


@dataclass(frozen=True)
class LoadPlan:
    """One run against one server."""

    sessions: int = 8
    agents: int = 8  # of each session
    seconds: float = 30.0  # measured, after the warm-up
    warm_up: float = 5.0
    transport: str = "grpc"
    goal_rate: float = 0.1  # new goals a second for each agent
    slow: int = 0  # extra streams whose reader takes one message every 5 s
    vanishing: int = 0  # extra streams, each cut off every second or so
    area: float = 15.0  # metres: radius of the disc in which a session's agents walk
    seed: int = 0
    rings: tuple[LoadRing, ...] = ()  # levels of detail of each stream; none: everybody in full
    viewpoint_speed: float = 1.5  # metres per second at which the middle of the rings walks

    def __post_init__(self) -> None:
        for name in ("sessions", "agents"):
            if getattr(self, name) < 1:
                raise InvalidArgument(f"{name} must be 1 or more", name)
        for name in ("slow", "vanishing", "goal_rate", "warm_up"):
            if getattr(self, name) < 0:
                raise InvalidArgument(f"{name} must be 0 or more", name)
        if not 0 < self.area <= MAX_AREA:
            raise InvalidArgument(
                f"area is {self.area:g}; allowed: above 0, to {MAX_AREA:g} m", "area"
            )
        if not 0 <= self.viewpoint_speed <= MAX_SPEED:
            raise InvalidArgument(
                f"viewpoint_speed is {self.viewpoint_speed:g}; allowed: 0 to {MAX_SPEED:g} m/s",
                "viewpoint_speed",
            )
        if self.seconds <= 0:
            raise InvalidArgument("seconds must be positive", "seconds")
        if self.transport not in TRANSPORTS:
            raise InvalidArgument(f"transport must be one of {', '.join(TRANSPORTS)}", "transport")
        check_rings(self.rings)

    def place(self, chance: random.Random) -> common_pb2.Vector3:
        """Somewhere in the disc, in the basis of the session."""
        angle = chance.uniform(0, 2 * math.pi)
        reach = self.area * math.sqrt(chance.random())
        return common_pb2.Vector3(x=reach * math.sin(angle), z=reach * math.cos(angle))

    def viewpoint(self, number: int, refused: Callable[[str], None]) -> WalkingViewpoint | None:
        """Rings and a walking viewpoint for one stream; None: it gets everybody in full.

        The same seed and `number` give the same way. See `WalkingViewpoint` for `refused`.
        """
        if not self.rings:
            return None
        chance = random.Random(self.seed * 100_019 + number)
        return WalkingViewpoint(
            self.rings, self.viewpoint_speed, lambda: self.place(chance), refused
        )
