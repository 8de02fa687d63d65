"""What a load run does."""

import math
from dataclasses import dataclass
from typing import Final

from wayfarer.errors import InvalidArgument
from wayfarer.v1 import common_pb2, motion_pb2

TRANSPORTS = ("grpc", "websocket")

MOST_RINGS: Final = 8

MIDDLE: Final = motion_pb2.PoseFormat(fps=20)
FAR: Final = motion_pb2.PoseFormat(encoding=motion_pb2.POSE_ENCODING_ROOT)


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
    rings: tuple[float, ...] = ()  # metres: radii of the levels of detail of each stream

    def __post_init__(self) -> None:
        for name in ("sessions", "agents"):
            if getattr(self, name) < 1:
                raise InvalidArgument(f"{name} must be 1 or more", name)
        for name in ("slow", "vanishing", "goal_rate", "warm_up"):
            if getattr(self, name) < 0:
                raise InvalidArgument(f"{name} must be 0 or more", name)
        if self.seconds <= 0:
            raise InvalidArgument("seconds must be positive", "seconds")
        if self.transport not in TRANSPORTS:
            raise InvalidArgument(f"transport must be one of {', '.join(TRANSPORTS)}", "transport")
        ascending = all(a < b for a, b in zip((0.0, *self.rings), self.rings, strict=False))
        if len(self.rings) > MOST_RINGS or not ascending or not all(map(math.isfinite, self.rings)):
            raise InvalidArgument(
                f"at most {MOST_RINGS} radii in metres, above 0 and ascending", "rings"
            )

    def interest(self) -> motion_pb2.Interest | None:
        """What each stream asks for, seen from the middle of its session: full poses in the first
        ring, roots in the last of several, 20 frames a second between them. None: all in full.
        """
        if not self.rings:
            return None
        formats = [None, *[MIDDLE] * (len(self.rings) - 2), FAR][: len(self.rings)]
        rings = [
            motion_pb2.InterestRing(radius=radius, format=each)
            for radius, each in zip(self.rings, formats, strict=True)
        ]
        middle = motion_pb2.Viewpoint(position=common_pb2.Vector3())
        return motion_pb2.Interest(rings=rings, viewpoints=[middle])
