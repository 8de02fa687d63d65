"""Films: a camera follows each clip, side by side, or stands before a crowd."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import ceil, cos, pi, sin, sqrt
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from wayfarer.clips.clip import Clip
from wayfarer_lab.evaluation.pictures.camera import Size
from wayfarer_lab.evaluation.pictures.floor import ring
from wayfarer_lab.evaluation.pictures.framing import check_view, following, marks, wide
from wayfarer_lab.evaluation.pictures.paper import FONT, GOAL, INK, PAPER
from wayfarer_lab.evaluation.pictures.scene import ClipActor, picture

Array = NDArray[np.floating[Any]]

APART: Final = 0.9  # metres between the hips of two people of a crowd, at least


@dataclass(frozen=True)
class Film:
    """Pictures at a steady rate, drawn when they are asked for."""

    pictures: int
    fps: float
    size: Size
    draw: Callable[[int], Image.Image]

    @property
    def seconds(self) -> float:
        """Length."""
        return self.pictures / self.fps


def follow_film(
    actors: Sequence[ClipActor],
    captions: Sequence[str],
    size: int,
    fps: float,
    view: str = "quarter",
) -> Film:
    """A square of `size` pixels for each clip, in rows; ended clips hold their last frame."""
    check_view(view)
    cameras = [following(actor, view, (size, size)) for actor in actors]
    across = ceil(sqrt(len(actors)))
    whole = (across * size, ceil(len(actors) / across) * size)

    def draw(number: int) -> Image.Image:
        sheet = Image.new("RGB", whole, PAPER)
        for index, (actor, caption) in enumerate(zip(actors, captions, strict=True)):
            frame = _frame_at(actor.clip, number / fps)
            square = picture(cameras[index][frame], [(actor, frame)], marks(actor, frame))
            ImageDraw.Draw(square).text((8, 6), caption, INK, FONT)
            sheet.paste(square, (index % across * size, index // across * size))
        return sheet

    return Film(_length(actors, fps), fps, whole, draw)


def crowd_film(actors: Sequence[ClipActor], height: int, fps: float) -> Film:
    """All clips on one floor, where they are in the world, before a fixed camera.

    Its pictures are 16 : 9.
    """
    size = (round(height * 16 / 9), height)
    camera = wide(actors, size)
    rings = [ring(goal, 0.3, 0.06, GOAL) for actor in actors for goal in actor.clip.goals]

    def draw(number: int) -> Image.Image:
        poses = [(actor, _frame_at(actor.clip, number / fps)) for actor in actors]
        return picture(camera, poses, rings)

    return Film(_length(actors, fps), fps, size, draw)


def gathered(clips: Sequence[Clip]) -> list[Clip]:
    """The clips moved close together, with all people at least 0.9 m apart.

    Each clip is moved as a whole, its goals with it: the motion is untouched.
    """
    placed: list[Clip] = []
    for clip in clips:
        centre = (clip.translation[:, :2].min(0) + clip.translation[:, :2].max(0)) / 2
        # places on a spiral from the middle outwards, 0.3 m apart: the first free one is taken
        for turn in range(100_000):
            radius, angle = 0.3 * sqrt(turn), turn * pi * (3 - sqrt(5))
            spot = np.array([radius * cos(angle), radius * sin(angle)])
            moved = _moved(clip, spot - centre)
            if all(_nearest(moved, other) >= APART for other in placed):
                break
        placed.append(moved)
    return placed


def _moved(clip: Clip, by: Array) -> Clip:
    step = np.array([by[0], by[1], 0.0])
    goals = tuple((x + float(by[0]), y + float(by[1]), z) for x, y, z in clip.goals)
    return replace(clip, translation=clip.translation + step, goals=goals)


def _nearest(a: Clip, b: Clip) -> float:
    """Least horizontal distance of two people's hips; ended clips hold their last frame."""
    times = np.arange(0, max(a.seconds, b.seconds), 0.1)
    ways = [c.translation[[_frame_at(c, float(t)) for t in times], :2] for c in (a, b)]
    return float(np.linalg.norm(ways[0] - ways[1], axis=-1).min())


def _frame_at(clip: Clip, seconds: float) -> int:
    return min(round(seconds * clip.fps), clip.frames - 1)


def _length(actors: Sequence[ClipActor], fps: float) -> int:
    return max(1, round(max(actor.clip.seconds for actor in actors) * fps))
