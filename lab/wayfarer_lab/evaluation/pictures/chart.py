"""The feet over time: height and horizontal speed of each sole, and the contact flags."""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from wayfarer.body.model import BodyModel
from wayfarer_lab.evaluation.metrics.feet import runs
from wayfarer_lab.evaluation.pictures.paper import FAINT, FEET, FONT, INK, PAPER
from wayfarer_lab.evaluation.pictures.scene import ClipActor

Array = NDArray[np.floating[Any]]

HEIGHT: Final = 190
LANES: Final = {"cm": (8, 92, -4.0, 16.0), "m/s": (100, 168, 0.0, 3.0)}
"""Unit → top and bottom in pixels, least and greatest value."""

EDGES: Final = (60, 8)  # pixels left and right of the curves
SMOOTH: Final = 2


def foot_chart(actor: ClipActor, width: int) -> Image.Image:
    """Sole height and horizontal speed of its lowest point, so that rolling is not sliding."""
    picture = Image.new("RGB", (width * SMOOTH, HEIGHT * SMOOTH), PAPER)
    draw = ImageDraw.Draw(picture)
    frames = np.arange(actor.clip.frames)
    span = width - sum(EDGES)
    x = EDGES[0] + span * frames / max(len(frames) - 1, 1)
    for top, bottom, low, high in LANES.values():
        for level in (0.0, high / 2, high):
            y = (bottom - (bottom - top) * (level - low) / (high - low)) * SMOOTH
            ink = INK if level == 0 else FAINT
            draw.line([EDGES[0] * SMOOTH, y, (width - EDGES[1]) * SMOOTH, y], ink)
    for foot, (soles, ink) in enumerate(zip(sole_vertices(actor.body), FEET, strict=True)):
        for values, lane in zip(_curves(actor, soles), LANES.values(), strict=True):
            top, bottom, low, high = lane
            levels = bottom - (bottom - top) * (np.clip(values, low, high) - low) / (high - low)
            points = (np.stack([x, levels], -1) * SMOOTH).ravel().tolist()
            draw.line(points, ink, round(1.5 * SMOOTH), joint="curve")
        contact_lane(draw, actor.clip.contacts[:, foot], x[0], x[-1], 174 + 7 * foot, ink, SMOOTH)
    picture = picture.reduce(SMOOTH)
    letters = ImageDraw.Draw(picture)
    for name, (top, bottom, low, high) in LANES.items():
        letters.text((4, (top + bottom) / 2 - 7), name, INK, FONT)
        for level in (0.0, high / 2, high):
            y = bottom - (bottom - top) * (level - low) / (high - low)
            letters.text((EDGES[0] - 24, y - 7), f"{level:g}", INK, FONT)
    return picture


def contact_lane(
    draw: ImageDraw.ImageDraw,
    contacts: NDArray[np.bool_],
    left: float,
    right: float,
    top: float,
    ink: str,
    smooth: int = 1,
    height: float = 4,
) -> None:
    """A bar from pixel `left` to `right` for the clip's time, filled where a foot [N] touches."""
    scale = (right - left) / len(contacts)
    for run in runs(contacts):
        start, stop = left + scale * run.start, left + scale * run.stop
        box = np.array([start, top, max(stop, start + 1), top + height]) * smooth
        draw.rectangle(box.tolist(), fill=ink)


def sole_vertices(body: BodyModel) -> list[NDArray[np.int64]]:
    """Vertices under the left and the right foot in the rest pose."""
    found = []
    owner = np.take_along_axis(body.skin_joints, body.skin_weights.argmax(-1)[:, None], -1)[:, 0]
    for side in ("left", "right"):
        feet = [body.joint_names.index(f"{side}_{part}") for part in ("ankle", "foot")]
        mine = np.flatnonzero(np.isin(owner, feet))
        level = body.bind_vertices[mine, 2]
        found.append(mine[level < level.min() + 0.02])
    return found


def _curves(actor: ClipActor, soles: NDArray[np.int64]) -> tuple[Array, Array]:
    """Centimetres over the floor [N], metres per second [N], of the sole's lowest vertex."""
    betas = np.asarray(actor.clip.betas)
    points = actor.body.skin(betas, *actor.pose, soles)
    lowest = np.argmin(points[..., 2], axis=1)
    frames = np.arange(len(points))
    speed = np.zeros(len(points))
    steps = (points[1:] - points[:-1])[frames[:-1], lowest[1:], :2]
    speed[1:] = np.linalg.norm(steps, axis=-1) * actor.clip.fps
    return points[frames, lowest, 2] * 100, speed
