"""The paper's pictures of motion (Fig. 4, S1, S2), drawn as stick figures from `motion.Figures`."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from wayfarer.body.skeleton import joint_names, parents
from wayfarer_lab.evaluation.paper.motion import DrawnMotion, Figures, Seeded
from wayfarer_lab.evaluation.pictures.paper import FAINT, FONT, GOAL, INK, LEFT, PAPER, RIGHT, TRAIL

Array = NDArray[np.floating[Any]]

SMOOTH: Final = 3  # points drawn per pixel, each way
SCALE: Final = 70  # pixels per metre
TILT: Final = 0.3  # metres of picture height per metre of depth
CELL: Final = (120, 150)
"""Pixels of a body of Fig. S1."""
LABEL: Final = 96
"""Pixels left of a row for its name."""
TALL: Final = 2.0
"""Metres above the floor that a row shows."""

_BONES: Final = [(j, p) for j, p in enumerate(parents()[:22]) if p >= 0]
_SIDES: Final = [name.partition("_")[0] for name in joint_names()[:22]]

Project = Callable[[Array], Array]
"""Metres [..., 3] → pixels [..., 2]."""


def pictures(figures: Figures) -> dict[str, Image.Image]:
    """Pictures by name; those without a motion are left out."""
    made = {}
    if figures["fig_s1"]:
        made["fig_s1"] = primitives(figures["fig_s1"])
    for name, walks in (("fig_4", figures["fig_4"]), ("fig_s2", figures["fig_s2"])):
        if walks:
            made[name] = ways(walks)
    return made


def primitives(rows: Sequence[Seeded]) -> Image.Image:
    """A row per predictor: the seed (green), then the last frames of its primitives (red)."""
    columns = 1 + max(len(row["ends"]) for row in rows)
    canvas = _Canvas(LABEL + columns * CELL[0], len(rows) * CELL[1])
    for line, row in enumerate(rows):
        seed = np.array(row["seed"])
        side = _turned(seed[-1, 2] - seed[-1, 1], by=0.6)
        bodies = [seed[-1], *np.array(row["ends"])]
        for column, body in enumerate(bodies):
            middle = LABEL + (column + 0.5) * CELL[0]
            floor = (line + 1) * CELL[1] - 14

            at = partial(_flat, side=side, middle=middle, floor=floor)
            placed = body - seed[-1, 0] * [1, 1, 0]
            canvas.body(placed, at, dict.fromkeys(_COLOURS, GOAL if column == 0 else LEFT))
        canvas.write((6, line * CELL[1] + CELL[1] / 2 - 7), row["name"])
    return canvas.picture()


def ways(rows: Sequence[DrawnMotion]) -> Image.Image:
    """A row per motion, seen from its side: bodies each 0.8 s, the last one dark, the goal a ring.

    A motion that did not reach its goal says so.
    """
    bodies = [np.array(row["joints"]) for row in rows]
    sides = [_side(row, body) for row, body in zip(rows, bodies, strict=True)]
    spans = []
    for row, body, side in zip(rows, bodies, sides, strict=True):
        points = body.reshape(-1, 3) if row["goal"] is None else _with_goal(body, row["goal"])
        spans.append((points @ side).tolist())
    low, high = min(min(s) for s in spans) - 0.35, max(max(s) for s in spans) + 0.35
    height = round((TALL + 0.5) * SCALE)
    canvas = _Canvas(LABEL + round((high - low) * SCALE), len(rows) * height)
    for line, (row, body, side) in enumerate(zip(rows, bodies, sides, strict=True)):
        floor = (line + 1) * height - round(0.4 * SCALE)
        at = partial(_flat, side=side, middle=LABEL - low * SCALE, floor=floor)
        canvas.line(np.array([[LABEL, floor], [canvas.width, floor]]), FAINT, 1)
        if row["goal"] is not None:
            canvas.ring(at(np.array([*row["goal"], 0.0])), 0.3 * SCALE, GOAL)
        for joints in body[:-1]:
            canvas.body(joints, at, dict.fromkeys(_COLOURS, FAINT))
        canvas.line(at(body[:, 0] * [1, 1, 0]), TRAIL, 1)
        canvas.body(body[-1], at, _COLOURS)
        label = row["name"] if row["reached"] else f"{row['name']}\n(not there)"
        canvas.write((6, floor - height / 2), label)
    return canvas.picture()


_COLOURS: Final[Mapping[str, str]] = {"left": LEFT, "right": RIGHT, "": INK}
"""Inks of a body's bones by side."""


class _Canvas:
    """Strokes and letters on paper."""

    def __init__(self, width: int, height: int) -> None:
        self.width = width
        self._picture = Image.new("RGB", (width * SMOOTH, height * SMOOTH), PAPER)
        self._draw = ImageDraw.Draw(self._picture)
        self._letters: list[tuple[tuple[float, float], str]] = []

    def body(self, joints: Array, at: Project, inks: Mapping[str, str]) -> None:
        """A stick figure of joints [22, 3]; `inks` has the colours of left, right, and neither."""
        places = at(joints)
        for joint, parent in _BONES:
            ink = inks.get(_SIDES[joint], inks[""])
            self.line(places[[parent, joint]], ink, 2.2)
        x, y = places[15] * SMOOTH  # the head's joint is its base
        radius = 0.09 * SCALE * SMOOTH
        top = [x - radius, y - 2.2 * radius, x + radius, y - 0.2 * radius]
        self._draw.ellipse(top, outline=inks[""], width=2 * SMOOTH)

    def line(self, way: Array, ink: str, width: float) -> None:
        """Pixels [N, 2]."""
        points = [tuple(point) for point in (way * SMOOTH).tolist()]
        self._draw.line(points, ink, max(round(width * SMOOTH), 1), joint="curve")

    def ring(self, place: Array, radius: float, ink: str) -> None:
        """A circle on the floor, as the picture sees it."""
        x, y = place * SMOOTH
        wide, high = radius * SMOOTH, radius * TILT * SMOOTH
        self._draw.ellipse([x - wide, y - high, x + wide, y + high], outline=ink, width=2 * SMOOTH)

    def write(self, place: tuple[float, float], text: str) -> None:
        """Letters from pixel `place` on."""
        self._letters.append((place, text))

    def picture(self) -> Image.Image:
        """The finished drawing."""
        small = self._picture.reduce(SMOOTH)
        draw = ImageDraw.Draw(small)
        for place, text in self._letters:
            draw.text(place, text, INK, FONT)
        return small


def _flat(points: Array, side: Array, middle: float, floor: float) -> Array:
    """Along `side` to the right; what lies behind the way is a little higher."""
    depth = np.array([-side[1], side[0], 0.0])
    up = points[..., 2] + TILT * (points @ depth)
    return np.stack([middle + SCALE * (points @ side), floor - SCALE * up], -1)


def _side(row: DrawnMotion, body: Array) -> Array:
    """The horizontal direction from the first hips to the goal, or to the last hips."""
    end = np.array([*row["goal"], 0.0]) if row["goal"] is not None else body[-1, 0]
    return _turned(end - body[0, 0])


def _turned(way: Array, by: float = 0.0) -> Array:
    """The horizontal part of a way, turned by radians, of length 1 [3]."""
    flat = way[:2] / max(float(np.linalg.norm(way[:2])), 1e-9)
    cos, sin = np.cos(by), np.sin(by)
    return np.array([cos * flat[0] - sin * flat[1], sin * flat[0] + cos * flat[1], 0.0])


def _with_goal(body: Array, goal: Sequence[float]) -> Array:
    return np.concatenate([body.reshape(-1, 3), [[*goal, 0.0]]])
