"""Motion seen from above: where bodies and feet went, and which way they looked."""

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
import shapely
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from wayfarer_lab.evaluation.pictures.camera import Size
from wayfarer_lab.evaluation.pictures.paper import FAINT, FEET, FONT, GOAL, INK, PAPER, TRAIL
from wayfarer_lab.evaluation.pictures.scene import ClipActor

Array = NDArray[np.floating[Any]]

SMOOTH: Final = 3  # points drawn per pixel, each way
MARGIN: Final = 0.5  # metres around everything
MIN_SPAN: Final = 2.0  # metres that are shown at least: standing is not magnified
TICK: Final = 0.4  # seconds between two facing ticks
TRAILS: Final = (TRAIL, "#b5651d", "#6a4c93", "#00798c", "#8f2d56", "#7a7d1f", "#3d5a80", "#9c6644")


class ScaleDrawing:
    """A drawing to scale, +X right and +Y up. Strokes are soft, letters are set last."""

    def __init__(self, low: Array, high: Array, size: Size) -> None:
        """Shows at least low … high [2] (metres), centred in a picture of `size` pixels."""
        self.size = size
        self.scale = float(min(np.array(size) / (high - low)))  # pixels per metre
        self._middle = (low + high) / 2
        self.low, self.high = (
            self._middle + sign * np.array(size) / self.scale / 2 for sign in (-1, 1)
        )
        self._picture = Image.new("RGB", (size[0] * SMOOTH, size[1] * SMOOTH), PAPER)
        self._draw = ImageDraw.Draw(self._picture)
        self._letters: list[tuple[tuple[float, float], str, str]] = []

    def at(self, points: Array) -> Array:
        """Metres [..., 2] → pixels [..., 2]."""
        return (points - self._middle) * [self.scale, -self.scale] + np.array(self.size) / 2

    def line(self, way: Array, ink: str, width: float = 1.0) -> None:
        """A line [N, 2], `width` pixels wide."""
        points = [tuple(point) for point in self.at(way) * SMOOTH]
        self._draw.line(points, ink, max(round(width * SMOOTH), 1), joint="curve")

    def area(self, area: shapely.Geometry, ink: str, holes: str | None = None) -> None:
        """Filled polygons, their holes in the colour `holes`; without one the holes are filled."""
        for polygon in shapely.get_parts(area):
            rings = [polygon.exterior, *(polygon.interiors if holes else ())]
            for ring, paint in zip(rings, [ink, *[holes] * len(rings)], strict=False):
                spots = self.at(shapely.get_coordinates(ring)) * SMOOTH
                self._draw.polygon([tuple(spot) for spot in spots.tolist()], fill=paint)

    def disc(self, place: Array, radius: float, ink: str, width: float | None = None) -> None:
        """A disc with a radius in pixels, or with `width` a ring."""
        x, y = self.at(place) * SMOOTH
        box = [x - radius * SMOOTH, y - radius * SMOOTH, x + radius * SMOOTH, y + radius * SMOOTH]
        if width is None:
            self._draw.ellipse(box, fill=ink)
        else:
            self._draw.ellipse(box, outline=ink, width=round(width * SMOOTH))

    def write(self, place: Array, shift: tuple[float, float], text: str, ink: str) -> None:
        """Letters at a place, shifted by pixels."""
        x, y = self.at(place)
        self._letters.append(((x + shift[0], y + shift[1]), text, ink))

    def picture(self) -> Image.Image:
        """The finished drawing."""
        small = self._picture.reduce(SMOOTH)
        draw = ImageDraw.Draw(small)
        for where, text, ink in self._letters:
            draw.text(where, text, ink, FONT)
        return small


def top_view(actors: Sequence[ClipActor], size: Size) -> Image.Image:
    """Hips trails from a dot on, facing ticks each 0.4 s, goals as rings in their order.

    Small dots are places where a foot was flagged as touching (red left, blue right): a still
    foot gives one dot, a sliding one a streak.
    """
    everything = np.concatenate([_places(actor) for actor in actors])
    middle = (everything.min(0) + everything.max(0)) / 2
    half = np.maximum((everything.max(0) - everything.min(0)) / 2 + MARGIN, MIN_SPAN / 2)
    plan = ScaleDrawing(middle - half, middle + half, size)
    _grid(plan)
    for number, actor in enumerate(actors):
        for order, goal in enumerate(actor.clip.goals, start=1):
            plan.disc(np.array(goal[:2]), 0.3 * plan.scale, GOAL, 2)
            if len(actor.clip.goals) > 1:
                plan.write(np.array(goal[:2]), (-3, -7), str(order), GOAL)
        _prints(plan, actor)
        plan.line(actor.hips[:, :2], TRAILS[number % len(TRAILS)], 1.6)
        _facing(plan, actor)
        plan.disc(actor.hips[0, :2], 3.5, INK)
        if len(actors) > 1:
            plan.write(actor.hips[0, :2], (6, -7), str(number + 1), INK)
    return plan.picture()


def _places(actor: ClipActor) -> Array:
    goals = np.array([goal[:2] for goal in actor.clip.goals]).reshape(-1, 2)
    return np.concatenate([actor.hips[:, :2], goals])


def _grid(plan: ScaleDrawing) -> None:
    """A line each metre, or at each 1, 2, 5, 10 … where metres would lie too close."""
    apart = next(m for m in (1, 2, 5, 10, 20, 50, 100, 1000) if m * plan.scale >= 14)
    for axis in (0, 1):
        first, last = np.ceil(plan.low[axis] / apart), np.floor(plan.high[axis] / apart)
        for step in range(int(first), int(last) + 1):
            ends = np.array([plan.low, plan.high])
            ends[:, axis] = step * apart
            plan.line(ends, FAINT, 0.7)
            if apart * plan.scale >= 60:
                plan.write(ends[0], (2, -14 if axis == 0 else 0), f"{step * apart} m", FAINT)
    if apart * plan.scale < 60:
        plan.write(plan.low, (3, -15), f"grid {apart} m", TRAIL)


def _prints(plan: ScaleDrawing, actor: ClipActor) -> None:
    names = actor.body.joint_names
    for foot, (side, ink) in enumerate(zip(("left", "right"), FEET, strict=True)):
        balls = actor.pose[1][actor.clip.contacts[:, foot], names.index(f"{side}_foot"), :2]
        for place in np.unique(np.round(balls, 3), axis=0):
            plan.disc(place, max(0.015 * plan.scale, 1.2), ink)


def _facing(plan: ScaleDrawing, actor: ClipActor) -> None:
    forward = actor.pose[0][:, 0, :2, 1]
    forward = forward / np.maximum(np.linalg.norm(forward, axis=-1, keepdims=True), 1e-9)
    for frame in range(0, actor.clip.frames, max(1, round(TICK * actor.clip.fps))):
        start = actor.hips[frame, :2]
        plan.line(np.stack([start, start + 0.2 * forward[frame]]), INK, 1)
