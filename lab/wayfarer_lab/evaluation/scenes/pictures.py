"""Pictures of scenes: from above with all trails, and as a camera sees people in them."""

from collections.abc import Sequence
from math import radians, tan
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from PIL import Image

from wayfarer.navigation.scene import Scene
from wayfarer.navigation.solids import footprint, solid_triangles
from wayfarer_lab.evaluation.pictures.camera import Camera, Size, View
from wayfarer_lab.evaluation.pictures.floor import Mark
from wayfarer_lab.evaluation.pictures.scene import Prop, picture
from wayfarer_lab.evaluation.pictures.top import TRAILS, ScaleDrawing
from wayfarer_lab.evaluation.scenes.monitor import SceneMonitor
from wayfarer_lab.evaluation.scenes.solids import standing

Array = NDArray[np.floating[Any]]

GROUND, SOLID, CRATE = "#d9dde3", "#8d96a3", "#c47a3c"
LOW, HIGH = np.array([207, 230, 214]), np.array([116, 178, 138])
COLOURS: Final = 255
"""Colours of a stored picture: few enough for a small file."""

AZIMUTH, ANGLE = radians(-28), radians(30)
"""Where a camera on a scene looks to, and its opening angle."""


class Focus(NamedTuple):
    """The part of a scene that a picture shows."""

    place: tuple[float, float]
    metres: float  # from its lower to its upper edge, at that place
    elevation: float = 38.0  # degrees from which the camera looks down


def plan(scene: Scene, ways: Sequence[Array], pixels: int = 720) -> Image.Image:
    """From above, +x right and +y up: ways [N, 3], each from a dot to where it ends.

    Green: where an agent's middle may be, darker where it is higher; grey: other ground, and
    solids; brown: obstacles.
    """
    x0, y0, x1, y1 = scene.bounds
    scale = pixels / max(x1 - x0, y1 - y0)
    drawing = ScaleDrawing(np.array([x0, y0]), np.array([x1, y1]), _pixels(x1 - x0, y1 - y0, scale))
    for layer in scene.ground.layers:
        drawing.area(layer.own, GROUND, SOLID)
    _walkable(drawing, scene)
    for solid in standing(scene):
        if not solid.walked_on:
            is_crate = solid.solid in scene.obstacles.values()
            drawing.area(footprint(solid.solid), CRATE if is_crate else SOLID)
    for number, way in enumerate(ways):
        ink = TRAILS[number % len(TRAILS)]
        drawing.line(way[:, :2], ink, 1.4)
        drawing.disc(way[0, :2], 3.0, ink)
    return drawing.picture()


def _pixels(width: float, depth: float, scale: float) -> Size:
    return round(width * scale), round(depth * scale)


def _walkable(drawing: ScaleDrawing, scene: Scene) -> None:
    """The mesh's triangles, lower ones first, coloured by height."""
    middles = scene.mesh.corners.mean(1)
    height = np.empty(len(middles))
    for number, layer in enumerate(scene.ground.layers):
        mine = scene.mesh.layer == number
        height[mine] = layer.heights.at(middles[mine])
    share = (height - height.min()) / max(float(np.ptp(height)), 1.0)
    paints = (LOW + share[:, None] * (HIGH - LOW)).round().astype(int)
    triangles = shapely.polygons(scene.mesh.corners)
    for paint in np.unique(np.column_stack([height.round(1), paints]), axis=0)[:, 1:].astype(int):
        same = (paints == paint).all(-1)
        drawing.area(shapely.union_all(triangles[same]), f"#{bytes(paint.tolist()).hex()}", GROUND)


def props(scene: Scene) -> list[Prop]:
    """Everything that stands in a scene, as props."""
    crates = list(scene.obstacles.values())
    return [
        *(Prop(solid_triangles(solid), "#b9bec6") for solid in scene.spec.solids),
        *(Prop(solid_triangles(crate), "#c98a52") for crate in crates),
    ]


def view(scene: Scene, monitor: SceneMonitor, focus: Focus, size: Size = (960, 540)) -> Image.Image:
    """People as they were after some seconds, and their ways until then where the floor is 0."""
    ways = [
        Mark(way[:, :2], 0.05, TRAILS[number % len(TRAILS)], 0.7)
        for number, way in enumerate(monitor.trails())
        if len(way) > 1
    ]
    return picture(_camera(scene, size, focus), monitor.actors(), ways, props(scene))


def _camera(scene: Scene, size: Size, focus: Focus) -> Camera:
    x, y = focus.place
    distance = focus.metres / (2 * tan(ANGLE / 2))
    seen = View.wide(AZIMUTH, radians(focus.elevation), distance, ANGLE, size)
    return Camera(seen, (x, y, float(scene.floor(np.array([x, y]))) + 0.8))


def save(path: Path, image: Image.Image) -> None:
    """A small PNG."""
    path.parent.mkdir(parents=True, exist_ok=True)
    image.quantize(COLOURS, Image.Quantize.FASTOCTREE).save(path, optimize=True)
