"""Clothes, shoes and hair on a body: meshes of their own, bound to the same joints and betas."""

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.body import hems
from wayfarer.body.library import FOLDER, SHIPPED, load_arrays
from wayfarer.body.mesh import vertex_normals
from wayfarer.body.model import BodyModel
from wayfarer.body.outfit import BARE, EYEBALLS, EYES, HAIR, HAIRCUTS, SKIN, Look, regions

Array = NDArray[np.floating[Any]]
Index = NDArray[np.int64]

LAYOUT: Final = 1
"""Version of the arrays in the file."""

PLACE_M: Final = 1e-4
"""Metres that the file's numbers of places count."""

DIRECTION_M: Final = 1e-5
"""Metres per unit of beta that its numbers of directions count."""

TUCK_M: Final = 0.006
"""Metres that skin beside what is hidden lies deeper, so that it does not come through a hem."""

IRIS: Final = 0.86
"""Cosine of the angle around the way ahead that the iris fills."""


def wardrobe_file(name: str) -> str:
    """Name of the file of a shipped body's clothes."""
    return f"{name}_wardrobe.npz"


@dataclass(frozen=True)
class Garment:
    """A mesh for one gender and detail; arrays as of `BodyModel`."""

    bind_vertices: Array  # [V, 3]
    bind_vertices_dirs: Array  # [V, 3, B]
    skin_joints: Index  # [V, 4]
    skin_weights: Array  # [V, 4]
    faces: Index  # [F, 3]
    regions: Index  # [F]
    hides: Index  # vertices of the body


@lru_cache(maxsize=128)
def load_garment(name: str, gender: str, detail: str) -> Garment:
    """A garment of the shipped body. Raises KeyError for an unknown one, ArtifactError."""
    arrays = load_arrays(FOLDER / wardrobe_file(SHIPPED))
    key = f"{name}/{detail}"
    weights = arrays[f"{key}/skin_weights"].astype(np.float64)
    return Garment(
        bind_vertices=arrays[f"{key}/{gender}/vertices"] * PLACE_M,
        bind_vertices_dirs=arrays[f"{key}/{gender}/vertices_dirs"] * DIRECTION_M,
        skin_joints=arrays[f"{key}/skin_joints"].astype(np.int64),
        skin_weights=weights / weights.sum(-1, keepdims=True),
        faces=arrays[f"{key}/faces"].astype(np.int64),
        regions=arrays[f"{key}/regions"].astype(np.int64),
        hides=arrays[f"{key}/hides"].astype(np.int64),
    )


def dressed(body: BodyModel, look: Look) -> tuple[BodyModel, Index]:
    """The body with clothes, and the region of each face [F].

    What they hide of it is left out. Texture coordinates are the body's own: `uv_faces` is -1 on
    clothes. A body without a wardrobe wears paint.
    """
    if body.name != SHIPPED:
        return hems.painted(body) if look.outfit != BARE else (body, _skin(body))
    garments = [load_garment(name, body.gender, body.detail) for name in look.garments]
    hidden = np.zeros(len(body.bind_vertices), bool)
    for garment in garments:
        hidden[garment.hides] = True
    kept = ~hidden[body.faces].all(-1)
    starts = np.cumsum([len(body.bind_vertices), *(len(g.bind_vertices) for g in garments)])
    uv_faces = body.uv_faces
    if uv_faces is not None:
        bare = np.full((sum(len(g.faces) for g in garments), 3), -1)
        uv_faces = np.concatenate([uv_faces[kept], bare])
    edge = np.intersect1d(np.flatnonzero(hidden), body.faces[kept])
    skin = body.bind_vertices.copy()
    skin[edge] -= TUCK_M * vertex_normals(skin, body.faces)[edge]
    together = replace(
        body,
        bind_vertices=np.concatenate([skin, *(g.bind_vertices for g in garments)]),
        bind_vertices_dirs=np.concatenate(
            [body.bind_vertices_dirs, *(g.bind_vertices_dirs for g in garments)]
        ),
        skin_joints=np.concatenate([body.skin_joints, *(g.skin_joints for g in garments)]),
        skin_weights=np.concatenate([body.skin_weights, *(g.skin_weights for g in garments)]),
        faces=np.concatenate(
            [body.faces[kept], *(g.faces + at for g, at in zip(garments, starts, strict=False))]
        ),
        regions=None,
        uv_faces=uv_faces,
    )
    skin_of = _skin(body)
    if any(name in cut for cut in HAIRCUTS.values() for name in look.garments):
        scalp = (regions(body)[body.faces] == HAIR).all(-1)
        skin_of[scalp] = HAIR  # seen between strands
    return together, np.concatenate([skin_of[kept], *(g.regions for g in garments)])


def _skin(body: BodyModel) -> Index:
    """Region of each face of a bare body: skin, and eyes with an iris."""
    worn = np.where((regions(body)[body.faces] == EYES).any(-1), EYES, SKIN)
    middles = body.bind_vertices[body.faces].mean(1)
    for side in (-1, 1):
        eye = np.flatnonzero((worn == EYES) & (side * middles[:, 0] > 0))
        if body.name == SHIPPED and body.detail == "high" and len(eye):
            away = middles[eye] - middles[eye].mean(0)
            ahead = away[:, 1] / np.maximum(np.linalg.norm(away, axis=-1), 1e-9)
            worn[eye[ahead < IRIS]] = EYEBALLS
    return worn
