"""Where to put the camera, for one walker or for many."""

from collections.abc import Sequence
from math import atan2, pi, radians
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from wayfarer.errors import InvalidArgument
from wayfarer_lab.evaluation.pictures.camera import Camera, Size, View
from wayfarer_lab.evaluation.pictures.floor import Mark, ring
from wayfarer_lab.evaluation.pictures.paper import GOAL, TRAIL
from wayfarer_lab.evaluation.pictures.scene import ClipActor

Array = NDArray[np.floating[Any]]

VIEWS: Final = {
    "quarter": (radians(128), radians(15)),
    "side": (pi / 2, radians(6)),
    "front": (pi, radians(10)),
    "back": (0.0, radians(15)),
    "body": (pi / 2, radians(6)),
}
"""Name → the camera's azimuth against the way that the walker goes, and its elevation. In "side"
people walk to the right; "body" is the same, but turns with the body."""

DISTANCE: Final = 6.0  # metres from the body
METRES: Final = 2.35  # of height that a picture of one body shows
MIDDLE: Final = 0.87  # metres over the floor that are in the middle of it
FLOATING: Final = 1.1  # metres: a body whose hips are higher draws the middle up
CALM: Final = 0.5  # seconds over which a following camera smooths the body's way

WIDE_AZIMUTH: Final = radians(-20)
WIDE_ELEVATION: Final = radians(24)
WIDE_ANGLE: Final = radians(32)
HEAD: Final = 1.95  # metres: what must be in the picture over every place
EDGE: Final = 0.94  # share of the picture that may be filled


def check_view(name: str) -> str:
    """The name of a view of one body. Raises InvalidArgument."""
    if name not in VIEWS:
        raise InvalidArgument(f"view is {name!r}; allowed: {', '.join(VIEWS)}", "view")
    return name


def way_heading(actor: ClipActor) -> float:
    """Direction (radians, 0 is +Y) of the whole way, or of a body that stays on its spot."""
    way = actor.hips[-1] - actor.hips[0]
    return body_heading(actor, 0) if np.linalg.norm(way[:2]) < 0.5 else atan2(-way[0], way[1])


def body_heading(actor: ClipActor, frame: int) -> float:
    """Direction in which the hips look in a frame."""
    x, y = actor.pose[0][min(frame, actor.clip.frames - 1), 0, :2, 1]
    return atan2(-x, y)


def view_of(name: str, heading: float, size: Size) -> View:
    """A named view of a person who walks in the direction `heading`."""
    azimuth, elevation = VIEWS[name]
    return View(heading + azimuth, elevation, DISTANCE, METRES, size)


def close_up(actor: ClipActor, frame: int, name: str, size: Size) -> Camera:
    """One body in the middle of the picture."""
    heading = body_heading(actor, frame) if name == "body" else way_heading(actor)
    x, y, z = actor.hips[min(frame, actor.clip.frames - 1)].tolist()
    return Camera(view_of(name, heading, size), (x, y, MIDDLE + max(0.0, z - FLOATING)))


def following(actor: ClipActor, name: str, size: Size) -> list[Camera]:
    """A camera for each frame that goes calmly along with the body."""
    view = view_of(name, way_heading(actor), size)
    return [Camera(view, (x, y, MIDDLE)) for x, y in calm_way(actor.hips, actor.clip.fps).tolist()]


def calm_way(hips: Array, fps: float) -> Array:
    """Horizontal way [N, 2] without its sway: a Gaussian over `CALM` seconds, ends held."""
    way: Array = gaussian_filter1d(hips[:, :2], CALM * fps, axis=0, mode="nearest", truncate=3)
    return way


def wide(actors: Sequence[ClipActor], size: Size) -> Camera:
    """A fixed camera that has all of the ways, from sole to crown, in its picture."""
    head = np.array([0, 0, HEAD])
    floor = np.concatenate([actor.hips * [1, 1, 0] for actor in actors])
    points = np.concatenate([floor, floor + head])
    target = (floor.min(0) + floor.max(0)) / 2 + head / 3
    middle = np.array(size) / 2

    def camera(distance: float) -> Camera:
        view = View.wide(WIDE_AZIMUTH, WIDE_ELEVATION, distance, WIDE_ANGLE, size)
        return Camera(view, (float(target[0]), float(target[1]), float(target[2])))

    def fits(distance: float) -> bool:
        seen = camera(distance).project(points)
        inside = (np.abs(seen[:, :2] - middle) <= EDGE * middle).all()
        return bool(inside and (seen[:, 2] > 0).all())

    low, high = 1.0, 1000.0
    for _ in range(30):
        half = (low * high) ** 0.5
        low, high = (low, half) if fits(half) else (half, high)
    return camera(high)


def marks(actor: ClipActor, until: int) -> list[Mark]:
    """A clip's goals as rings, and the way so far."""
    rings = [ring(goal, 0.3, 0.045, GOAL) for goal in actor.clip.goals]
    way = calm_way(actor.hips[: until + 1], actor.clip.fps)
    return [*rings, Mark(way, 0.025, TRAIL, 0.8)]
