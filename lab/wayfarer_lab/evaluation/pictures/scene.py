"""People on a floor, lit and seen by a camera: one picture of one moment."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from wayfarer.body.mesh import split_vertices, vertex_normals
from wayfarer.body.model import BodyModel
from wayfarer.body.outfit import look as look_of
from wayfarer.body.wardrobe import dressed
from wayfarer.clips.clip import Clip
from wayfarer.errors import InvalidArgument
from wayfarer_lab.evaluation.pictures.camera import Camera
from wayfarer_lab.evaluation.pictures.floor import Mark, cast, floor_of, painted
from wayfarer_lab.evaluation.pictures.light import colour, encode, shine, to_sun
from wayfarer_lab.evaluation.pictures.raster import Canvas, Faces

Array = NDArray[np.floating[Any]]

LOOKS: Final = ("dressed", "sides")

SUNK = colour("#ff1a10")
SINKING = (0.01, 0.03)  # metres under the floor from which, and at which, the body is red


def check_look(name: str) -> str:
    """The name of a look. Raises InvalidArgument."""
    if name not in LOOKS:
        raise InvalidArgument(f"look is {name!r}; allowed: {', '.join(LOOKS)}", "look")
    return name


@dataclass(frozen=True)
class Dress:
    """Colours of a mesh whose vertices are doubled where two colours meet. V' ≥ V vertices."""

    body: BodyModel  # with its clothes, where it is dressed
    source: NDArray[np.int64]  # [V'] vertex of the body
    faces: Faces  # [F, 3] over V'
    albedo: Array  # [V', 3] share of the light sent back

    @classmethod
    def clothes(cls, body: BodyModel, style: int) -> "Dress":
        """Skin, hair and clothes; the same seed `style`, the same look."""
        worn_by = look_of(style, body.gender)
        body, worn = dressed(body, worn_by)
        source, [region], faces = split_vertices(body.faces, np.repeat(worn[:, None], 3, axis=1))
        return cls(body, source, faces, worn_by.linear[region])

    @classmethod
    def sides(cls, body: BodyModel) -> "Dress":
        """Grey, left limbs red and right ones blue: crossing legs stay distinguishable."""
        by_joint = np.tile(colour("#d5d3d0"), (len(body.joint_names), 1))
        for joint, name in enumerate(body.joint_names):
            for side, paint in (("left", "#dd8078"), ("right", "#6f9bd6")):
                if name.startswith(side) and "collar" not in name:
                    by_joint[joint] = colour(paint)
        albedo = np.einsum("vk,vkc->vc", body.skin_weights, by_joint[body.skin_joints])
        return cls(body, np.arange(len(albedo)), body.faces, albedo)


@dataclass(frozen=True)
class ClipActor:
    """A clip with the body that performs it."""

    clip: Clip
    body: BodyModel
    dress: Dress

    @classmethod
    def of(cls, clip: Clip, body: BodyModel, look: str, style: int = 0) -> "ClipActor":
        """Its look: "dressed" in clothes of a style, or its "sides" in two colours."""
        sides = check_look(look) == "sides"
        dress = Dress.sides(body) if sides else Dress.clothes(body, style)
        return cls(clip, dress.body, dress)

    @cached_property
    def pose(self) -> tuple[Array, Array]:
        """World joint rotations [N, J, 3, 3] and places [N, J, 3]."""
        return self.clip.pose(self.body)

    @property
    def hips(self) -> Array:
        """World places of the hips [N, 3]."""
        return self.clip.translation

    def vertices(self, frame: int) -> Array:
        """The skinned body [V, 3] in a frame; after the clip's end, in its last."""
        rotations, places = self.pose
        frame = min(frame, self.clip.frames - 1)
        return self.body.skin(np.asarray(self.clip.betas), rotations[frame], places[frame])


@dataclass(frozen=True)
class Prop:
    """Something that stands on the floor, of one colour and with sharp edges."""

    corners: Array  # [F, 3, 3] of its triangles, counter-clockwise as seen from outside
    paint: str  # "#rrggbb"

    @cached_property
    def normals(self) -> Array:
        """Unit normal of each triangle. [F, 3]"""
        a, b, c = np.moveaxis(self.corners, 1, 0)
        out = np.cross(b - a, c - a)
        return out / np.maximum(np.linalg.norm(out, axis=-1, keepdims=True), 1e-12)


def picture(
    camera: Camera,
    poses: Sequence[tuple[ClipActor, int]],
    marks: Sequence[Mark] = (),
    props: Sequence[Prop] = (),
) -> Image.Image:
    """Actors, each in a frame of its clip, among props on a floor with marks."""
    sun = to_sun(camera.view.azimuth)
    canvas = Canvas(camera.view.size)
    shadows = []
    for prop in props:
        corners = prop.corners.reshape(-1, 3)
        faces = np.arange(len(corners)).reshape(-1, 3)
        light = shine(colour(prop.paint), prop.normals, sun)
        canvas.draw(camera.project(corners), faces, np.repeat(light, 3, 0))
        shadows.append(cast(corners, faces, sun))
    for actor, frame in poses:
        vertices, dress = actor.vertices(frame), actor.dress
        normals = vertex_normals(vertices, actor.body.faces)[dress.source]
        light = shine(dress.albedo, normals, sun)
        start, end = SINKING
        sunk = np.clip((-vertices[dress.source, 2] - start) / (end - start), 0, 1)[:, None]
        seen = camera.project(vertices)[dress.source]
        canvas.draw(seen, dress.faces, light + 0.8 * sunk * (SUNK - light))
        shadows.append(cast(vertices, actor.body.faces, sun))
    eye = camera.position
    floor = floor_of(camera.view, float(eye[2]))
    behind = floor.paint(eye[:2], shadows, painted(camera, marks))
    light, cover = canvas.layer()
    return Image.fromarray(encode(light + behind * (1 - cover[..., None])))
