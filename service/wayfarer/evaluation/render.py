"""Pictures of motion for people to judge: film strips, views from above.

`strip` shows the body from the side at intervals with the floor line, and under it the height and
speed of each foot over time, with the stream's contact flags. `top_view` shows where bodies and
feet went. Needs pillow.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from wayfarer.body.library import load_body
from wayfarer.body.model import BodyModel
from wayfarer.clips.clip import Clip
from wayfarer.clips.npz import read_npz
from wayfarer.errors import InvalidArgument
from wayfarer.evaluation.raster import Camera, Canvas

Array = NDArray[np.floating[Any]]

PAPER, INK, FAINT = "#ffffff", "#30343a", "#c9ced6"
LEFT, RIGHT, PATH = "#d1495b", "#2a6fb0", "#5b6470"
EARTH: Array = np.array([0.91, 0.89, 0.86])
SUNK: Array = np.array([0.9, 0.2, 0.15])
SMOOTH = 2  # pixels drawn per pixel kept, each way
FONT = ImageFont.load_default(12)


def strip(
    clip: Clip,
    body: BodyModel,
    every: int = 8,
    view: str = "side",
    columns: int = 10,
    pixels_per_metre: int = 150,
) -> Image.Image:
    """Film strip: one body each `every` frames, and the feet's height and speed over time.

    `view` is "side" (seen from the right of the walking direction), "front" (it walks towards
    you) or "body" (from the body's own right, turning with it). Floor ticks are fixed in the
    world, 0.25 m apart; a red (left) or blue (right) bar under the floor is a contact flag.
    """
    if view not in ("side", "front", "body"):
        raise InvalidArgument(f"view is {view!r}; allowed: side, front, body", "view")
    if every < 1 or columns < 1:
        raise InvalidArgument("every and columns must be 1 or more", "every")
    frames = list(range(0, clip.frames, every))
    rotations, places = clip.pose(body)
    shown = {k: body.skin(np.asarray(clip.betas), rotations[k], places[k]) for k in frames}
    colours = _clay(body)
    cell = (int(1.45 * pixels_per_metre), int(2.25 * pixels_per_metre))
    columns = min(columns, len(frames))
    rows = -(-len(frames) // columns)
    chart = _foot_chart(clip, body, rotations, places, width=max(columns * cell[0], 900))
    sheet = Image.new("RGB", (chart.width, rows * cell[1] + chart.height), PAPER)

    walking = _walking_direction(clip, rotations)
    for index, frame in enumerate(frames):
        forward = rotations[frame, 0] @ [0.0, 1.0, 0.0] if view == "body" else walking
        forward = forward * [1, 1, 0] / np.linalg.norm(forward[:2])
        side = np.array([forward[1], -forward[0], 0.0])  # the walker's right
        right = forward if view != "front" else -side
        camera = Camera(right, np.array([0.0, 0.0, 1.0]), np.zeros(3), pixels_per_metre)
        picture = _body_cell(shown[frame], body.faces, colours, camera, cell, places[frame, 0])
        _annotate_cell(picture, clip, frame, right @ places[frame, 0], pixels_per_metre)
        sheet.paste(picture, (index % columns * cell[0], index // columns * cell[1]))
    sheet.paste(chart, (0, rows * cell[1]))
    return sheet


def top_view(
    clips: Sequence[Clip],
    bodies: Sequence[BodyModel],
    goals: Sequence[Sequence[float]] | None = None,
    size: int = 900,
) -> Image.Image:
    """Seen from above (+X right, +Y up): hips trails, heading ticks each 0.4 s, foot contacts.

    A dot is a place where a foot was flagged as touching (red left, blue right): a still foot
    gives one dot, a sliding one a streak. Rings are goals, by default those of the clips.
    """
    if not clips or len(clips) != len(bodies):
        raise InvalidArgument(
            f"{len(clips)} clips and {len(bodies)} bodies; give one body each", "bodies"
        )
    rings = [goal[:2] for goal in (goals or [goal for clip in clips for goal in clip.goals])]
    trails = [clip.translation[:, :2] for clip in clips]
    everything = np.concatenate([*trails, np.asarray(rings).reshape(-1, 2)])
    low, high = everything.min(0) - 0.6, everything.max(0) + 0.6
    scale = size / max(high - low)
    width, height = np.ceil((high - low) * scale).astype(int)

    def at(point: Array) -> tuple[float, float]:
        return float((point[0] - low[0]) * scale), float(height - (point[1] - low[1]) * scale)

    picture = Image.new("RGB", (int(width), int(height)), PAPER)
    draw = ImageDraw.Draw(picture)
    for axis in (0, 1):
        for metre in range(int(np.ceil(low[axis])), int(np.floor(high[axis])) + 1):
            ends = np.array([low, high])
            ends[:, axis] = metre
            draw.line([at(ends[0]), at(ends[1])], fill=FAINT if metre else PATH)
            where = at(ends[0])
            draw.text(
                (where[0] + 2, where[1] - 14 if axis == 0 else where[1]), f"{metre} m", FAINT, FONT
            )
    for index, ring in enumerate(rings):
        x, y = at(np.asarray(ring))
        r = 0.3 * scale
        draw.ellipse([x - r, y - r, x + r, y + r], outline="#2f9e44", width=3)
        draw.text((x + 4, y - 6), str(index + 1), "#2f9e44", FONT)
    for clip, body, trail in zip(clips, bodies, trails, strict=True):
        rotations, places = clip.pose(body)
        ankle = [body.joint_names.index("left_foot"), body.joint_names.index("right_foot")]
        for foot, colour in enumerate((LEFT, RIGHT)):
            for place in places[clip.contacts[:, foot], ankle[foot]]:
                x, y = at(place)
                draw.ellipse([x - 2, y - 2, x + 2, y + 2], fill=colour)
        draw.line([at(point) for point in trail], fill=PATH, width=2)
        for frame in range(0, clip.frames, max(1, round(0.4 * clip.fps))):
            forward = rotations[frame, 0] @ [0.0, 1.0, 0.0]
            tip = trail[frame] + 0.18 * forward[:2] / np.linalg.norm(forward[:2])
            draw.line([at(trail[frame]), at(tip)], fill=INK, width=2)
        x, y = at(trail[0])
        draw.rectangle([x - 4, y - 4, x + 4, y + 4], fill=INK)
    return picture


def _walking_direction(clip: Clip, rotations: Array) -> Array:
    """Horizontal unit direction of the whole way, or of the body where it stays on a spot."""
    way = (clip.translation[-1] - clip.translation[0]) * [1, 1, 0]
    if np.linalg.norm(way) < 0.5:
        way = rotations[0, 0] @ [0.0, 1.0, 0.0] * [1, 1, 0]
    return way / np.linalg.norm(way)


def _body_cell(
    vertices: Array,
    faces: NDArray[np.int64],
    colours: Array,
    camera: Camera,
    size: tuple[int, int],
    hips: Array,
) -> Image.Image:
    """One body and its shadow before white sky and earth below z = 0."""
    width, height = size[0] * SMOOTH, size[1] * SMOOTH
    ppm = camera.pixels_per_metre * SMOOTH
    floor_row = int(height * 0.90)
    centre = np.array([hips[0], hips[1], (floor_row - height / 2) / ppm])
    camera = Camera(camera.right, camera.up, centre, ppm)
    canvas = Canvas(width, height, np.ones(3))
    canvas.pixels[floor_row:] = EARTH
    canvas.draw_mesh(camera, vertices, faces, colours)
    under = canvas.pixels[floor_row:]  # what is below the floor is seen, tinted red
    touched = canvas.nearness.reshape(height, width)[floor_row:] > -np.inf
    under[touched] = 0.35 * under[touched] + 0.65 * SUNK
    canvas.pixels[floor_row : floor_row + SMOOTH] = 0.25
    return Image.fromarray(canvas.image(SMOOTH))


def _annotate_cell(picture: Image.Image, clip: Clip, frame: int, along: float, ppm: float) -> None:
    """Time, world-fixed floor ticks and contact bars. `along` = hips along the picture's right."""
    draw = ImageDraw.Draw(picture)
    floor = int(picture.height * SMOOTH * 0.90) // SMOOTH
    reach = picture.width / 2 / ppm
    for tick in range(int(np.ceil((along - reach) / 0.25)), int((along + reach) // 0.25) + 1):
        x = picture.width / 2 + (tick * 0.25 - along) * ppm
        draw.line([x, floor, x, floor + (8 if tick % 4 == 0 else 4)], fill=INK)
        if tick % 4 == 0:
            draw.text((x + 2, floor + 3), f"{tick // 4}m", INK, FONT)
    for foot, colour in enumerate((LEFT, RIGHT)):
        if clip.contacts[frame, foot]:
            x = picture.width / 2 + (8 if foot else -38)
            draw.rectangle([x, picture.height - 9, x + 30, picture.height - 4], fill=colour)
    draw.text((4, 2), f"{frame / clip.fps:.2f} s", INK, FONT)


def _foot_chart(
    clip: Clip, body: BodyModel, rotations: Array, places: Array, width: int, height: int = 190
) -> Image.Image:
    """Sole height (cm) and horizontal sole speed (m/s) of each foot, with contact flags."""
    sole = _sole_vertices(body)
    picture = Image.new("RGB", (width, height), PAPER)
    draw = ImageDraw.Draw(picture)
    left_edge, right_edge = 60, width - 8
    seconds = np.arange(clip.frames) / clip.fps
    x = left_edge + (right_edge - left_edge) * seconds / max(seconds[-1], 1e-6)
    lanes = {"cm": (8, 92, -4.0, 16.0), "m/s": (100, 168, 0.0, 3.0)}
    for name, (top, bottom, low, high) in lanes.items():
        for level in (0.0, high / 2, high):
            y = bottom - (bottom - top) * (level - low) / (high - low)
            draw.line([left_edge, y, right_edge, y], fill=INK if level == 0 else FAINT)
            draw.text((left_edge - 24, y - 7), f"{level:g}", INK, FONT)
        draw.text((4, (top + bottom) / 2 - 7), name, INK, FONT)
    for foot, colour in enumerate((LEFT, RIGHT)):
        points = body.skin(np.asarray(clip.betas), rotations, places, sole[foot])
        lowest = np.argmin(points[..., 2], axis=1)
        at_lowest = np.arange(clip.frames), lowest
        level = points[at_lowest][:, 2] * 100
        speed = np.zeros(clip.frames)
        step = (
            points[1:] - points[:-1]
        )  # of the point that is lowest, so that rolling is not sliding
        speed[1:] = np.linalg.norm(step[at_lowest[0][:-1], lowest[1:], :2], axis=-1) * clip.fps
        for values, (top, bottom, low, high) in zip((level, speed), lanes.values(), strict=True):
            y = bottom - (bottom - top) * (np.clip(values, low, high) - low) / (high - low)
            draw.line(list(zip(x, y, strict=True)), fill=colour, width=2)
        for frame in np.flatnonzero(clip.contacts[:, foot]):
            y = 174 + 7 * foot
            draw.rectangle(
                [x[frame], y, x[frame] + (x[-1] - x[0]) / clip.frames, y + 4], fill=colour
            )
    return picture


def _clay(body: BodyModel) -> Array:
    """Plain grey, left limbs reddish and right ones bluish, to tell the legs apart. [V, 3]."""
    tints = {"left": np.array([0.87, 0.55, 0.52]), "right": np.array([0.47, 0.62, 0.85])}
    by_joint = np.full((len(body.joint_names), 3), 0.80)
    for joint, name in enumerate(body.joint_names):
        side = name.split("_")[0]
        if side in tints and "collar" not in name:
            by_joint[joint] = tints[side]
    return np.einsum("vk,vkc->vc", body.skin_weights, by_joint[body.skin_joints])


def _sole_vertices(body: BodyModel) -> list[NDArray[np.int64]]:
    """Vertices under the left and the right foot in the rest pose."""
    found = []
    owner = np.take_along_axis(body.skin_joints, body.skin_weights.argmax(-1)[:, None], -1)[:, 0]
    for side in ("left", "right"):
        feet = [body.joint_names.index(f"{side}_{part}") for part in ("ankle", "foot")]
        mine = np.flatnonzero(np.isin(owner, feet))
        level = body.bind_vertices[mine, 2]
        found.append(mine[level < level.min() + 0.02])
    return found


def render(
    source: Annotated[Path, typer.Argument(help="Clip, AMASS-style npz.", exists=True)],
    target: Annotated[Path, typer.Argument(help="Picture to write, e.g. walk.png.")],
    view: Annotated[str, typer.Option(help="side, front, body (film strip) or top.")] = "side",
    every: Annotated[int, typer.Option(help="Frames between two bodies.", min=1)] = 8,
    columns: Annotated[int, typer.Option(help="Bodies in a row.", min=1)] = 10,
) -> None:
    """Draw a contact sheet of a clip: a film strip, or the view from above."""
    clip = read_npz(source)
    body = load_body(clip.body, clip.gender, "low")
    from_above = view == "top"
    picture = top_view([clip], [body]) if from_above else strip(clip, body, every, view, columns)
    picture.save(target)
    typer.echo(f"{target}: {picture.width} × {picture.height} px, {clip.seconds:.1f} s of motion")
