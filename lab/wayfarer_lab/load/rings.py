"""Levels of detail of a simulated client's stream: rings around a viewpoint that walks through the
crowd, as the camera of a game does.
"""

import asyncio
import math
import time
from collections.abc import AsyncIterator, Callable, Mapping
from typing import Final, NamedTuple

from wayfarer.errors import InvalidArgument
from wayfarer.v1 import common_pb2, control_pb2, motion_pb2

PART_BONES: Final = (
    *("pelvis", "left_hip", "right_hip", "left_knee", "right_knee", "spine1", "spine2", "spine3"),
    *("neck", "left_shoulder", "right_shoulder", "left_elbow", "right_elbow"),
)

FORMATS: Final[Mapping[str, motion_pb2.PoseFormat | None]] = {
    "full": None,  # as the stream: 22 bones in float32, 40 frames a second
    "part": motion_pb2.PoseFormat(
        encoding=motion_pb2.POSE_ENCODING_SMALLEST_THREE,
        profile=motion_pb2.POSE_PROFILE_BONES,
        bones=PART_BONES,
        fps=20,
    ),
    "root": motion_pb2.PoseFormat(encoding=motion_pb2.POSE_ENCODING_ROOT),
}
"""How the people of a ring come, by its detail."""

MAX_RINGS: Final = 8
MAX_RADIUS: Final = 20_000.0
"""Radius in metres of a last ring for which none is given."""

EYES: Final = 1.7
"""Metres of the viewpoint above the ground."""

VIEWPOINTS_PER_S: Final = 10
"""Times a second that the viewpoint is sent: chunks last 0.2 s."""

Place = Callable[[], common_pb2.Vector3]


class LoadRing(NamedTuple):
    """The people within a distance of the viewpoint, and how they come."""

    detail: str  # of `FORMATS`
    radius: float = MAX_RADIUS  # metres

    @property
    def name(self) -> str:
        """As the options of the command have it."""
        return self.detail if self.radius == MAX_RADIUS else f"{self.detail}:{self.radius:g}"


def parse_rings(text: str) -> tuple[LoadRing, ...]:
    """Rings out of "full:3.4,part:6.7,root"; none out of nothing. Raises InvalidArgument."""
    return check_rings(tuple(map(_ring, text.split(",")))) if text else ()


def check_rings(rings: tuple[LoadRing, ...]) -> tuple[LoadRing, ...]:
    """The rings. Raises InvalidArgument where a server would refuse them."""
    if len(rings) > MAX_RINGS:
        raise InvalidArgument(f"{len(rings)} are too many; allowed: {MAX_RINGS}", "rings")
    before = 0.0
    for ring in rings:
        if not before < ring.radius <= MAX_RADIUS:
            within = ", that of the ring within it," if before else ""
            raise InvalidArgument(
                f"the radius of {ring.name} must be above {before:g} m{within} and at most "
                f"{MAX_RADIUS:g} m; only the last ring may have none",
                "rings",
            )
        before = ring.radius
    return rings


def _ring(text: str) -> LoadRing:
    detail, colon, radius = text.strip().partition(":")
    try:
        if detail in FORMATS:
            return LoadRing(detail, float(radius)) if colon else LoadRing(detail)
    except ValueError:
        pass
    raise InvalidArgument(
        f"{text!r} is no ring; write DETAIL:METRES, where DETAIL is one of "
        f"{', '.join(FORMATS)}, as in full:3.4,part:6.7,root",
        "rings",
    )


class WalkingViewpoint:
    """A viewpoint that walks from place to place, and the rings around it."""

    def __init__(
        self,
        rings: tuple[LoadRing, ...],
        speed: float,
        place: Place,
        refused: Callable[[str], None],
    ) -> None:
        """`speed`: metres per second. `place` gives where it begins, and where it goes next.
        `refused` hears the status of what the server refuses.
        """
        self._rings = rings
        self._speed, self._place = speed, place
        self.refused = refused
        self._at, self._next = place(), place()
        self._since = time.monotonic()

    async def requests(self, session_id: str) -> AsyncIterator[control_pb2.ControlRequest]:
        """Yields a client's requests over Control: the opening, then the moving viewpoint."""
        self._walk()
        opening = motion_pb2.StreamMotionRequest(session_id=session_id, interest=self._interest())
        yield control_pb2.ControlRequest(open=opening)
        while self._speed:
            await asyncio.sleep(1 / VIEWPOINTS_PER_S)
            self._walk()
            viewpoints = motion_pb2.Viewpoints(viewpoints=[self._viewpoint()])
            yield control_pb2.ControlRequest(viewpoints=viewpoints)

    def _interest(self) -> motion_pb2.Interest:
        rings = [
            motion_pb2.InterestRing(radius=ring.radius, format=FORMATS[ring.detail])
            for ring in self._rings
        ]
        return motion_pb2.Interest(rings=rings, viewpoints=[self._viewpoint()])

    def _viewpoint(self) -> motion_pb2.Viewpoint:
        place = common_pb2.Vector3(x=self._at.x, y=EYES, z=self._at.z)
        return motion_pb2.Viewpoint(position=place)

    def _walk(self) -> None:
        """Moves the viewpoint to where it is by now."""
        now = time.monotonic()
        way, self._since = self._speed * (now - self._since), now
        while (left := math.hypot(self._next.x - self._at.x, self._next.z - self._at.z)) < way:
            way -= left
            self._at, self._next = self._next, self._place()
        if left:
            self._at = common_pb2.Vector3(
                x=self._at.x + (self._next.x - self._at.x) * way / left,
                z=self._at.z + (self._next.z - self._at.z) * way / left,
            )
