"""The shipped bodies in the form of the torch core."""

from collections.abc import Sequence

import numpy as np

from wayfarer.body.library import load_body
from wayfarer.body.model import BodyModel
from wayfarer.motion.marker_body import MarkerBody
from wayfarer.spec import GENDERS


def marker_body(body: BodyModel, vertices: Sequence[int] | None = None) -> MarkerBody:
    """The torch skinning of a body's markers, or of other vertices of its mesh."""
    chosen = body.marker_vertices if vertices is None else np.asarray(vertices)
    return MarkerBody(
        parents=body.parents,
        bind_joints=body.bind_joints,
        bind_joints_dirs=body.bind_joints_dirs,
        bind_to_rest=body.bind_to_rest,
        bind_markers=body.bind_vertices[chosen],
        bind_markers_dirs=body.bind_vertices_dirs[chosen],
        skin_joints=body.skin_joints[chosen],
        skin_weights=body.skin_weights[chosen],
    )


def load_marker_bodies(name: str = "anny52") -> dict[str, MarkerBody]:
    """Torch skinning of both genders."""
    return {g: marker_body(load_body(name, g)) for g in GENDERS}
