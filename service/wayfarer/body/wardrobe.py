"""Clothes, shoes and hair on a body: separate meshes with the same joints and betas."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.body import hems
from wayfarer.body.library import FOLDER, SHIPPED, load_arrays
from wayfarer.body.model import BodyModel
from wayfarer.body.outfit import BARE, EYEBALLS, EYES, HAIR, HAIRCUTS, SKIN, Look, regions

Array = NDArray[np.floating[Any]]
Index = NDArray[np.int64]

BODY: Final = "body"
"""The name of the body among the layers beneath a garment."""

LAYOUT: Final = 1
"""Version of the arrays in the file."""

PLACE_M: Final = 1e-4
"""Metres per unit of the file's places."""

DIRECTION_M: Final = 1e-5
"""Metres per beta and unit of the file's directions."""

IRIS: Final = 0.86
"""Cosine of the angle from the forward direction that the iris fills."""


def wardrobe_file(name: str) -> str:
    """Name of the file of a shipped body's clothes."""
    return f"{name}_wardrobe.npz"


@dataclass(frozen=True)
class Garment:
    """A mesh for one gender and detail; arrays as in `BodyModel`."""

    bind_vertices: Array  # [V, 3]
    bind_vertices_dirs: Array  # [V, 3, B]
    skin_joints: Index  # [V, 4]
    skin_weights: Array  # [V, 4]
    faces: Index  # [F, 3]
    regions: Index  # [F]


@dataclass(frozen=True)
class Cover:
    """The effect of a garment on a mesh beneath it, the body or shoes."""

    hides: Index  # vertices; faces among them are left out
    tucks: Index  # [N] vertices at its edge, which lie deeper and move with the garment
    shifts: Array  # [N, 3] metres
    skin_joints: Index  # [N, 4]
    skin_weights: Array  # [N, 4]


@lru_cache(maxsize=128)
def load_garment(name: str, gender: str, detail: str) -> Garment:
    """A garment of the shipped body. Raises KeyError for an unknown one, ArtifactError."""
    arrays = load_arrays(FOLDER / wardrobe_file(SHIPPED))
    key = f"{name}/{detail}"
    return Garment(
        bind_vertices=arrays[f"{key}/{gender}/vertices"] * PLACE_M,
        bind_vertices_dirs=arrays[f"{key}/{gender}/vertices_dirs"] * DIRECTION_M,
        skin_joints=arrays[f"{key}/skin_joints"].astype(np.int64),
        skin_weights=_shares(arrays[f"{key}/skin_weights"]),
        faces=arrays[f"{key}/faces"].astype(np.int64),
        regions=arrays[f"{key}/regions"].astype(np.int64),
    )


@lru_cache(maxsize=512)
def load_cover(name: str, below: str, detail: str) -> Cover | None:
    """Its effect on shoes of that name or on the BODY; None: it does not cover them."""
    arrays = load_arrays(FOLDER / wardrobe_file(SHIPPED))
    key = f"{name}/{detail}/over/{below}"
    if f"{key}/hides" not in arrays:
        return None
    return Cover(
        hides=arrays[f"{key}/hides"].astype(np.int64),
        tucks=arrays[f"{key}/tucks"].astype(np.int64),
        shifts=arrays[f"{key}/shifts"] * PLACE_M,
        skin_joints=arrays[f"{key}/skin_joints"].astype(np.int64),
        skin_weights=_shares(arrays[f"{key}/skin_weights"]),
    )


def _shares(weights: NDArray[Any]) -> Array:
    return np.asarray(weights / weights.sum(-1, keepdims=True, dtype=np.float64))


def dressed(body: BodyModel, look: Look) -> tuple[BodyModel, Index]:
    """The body with clothes, and the region of each face [F].

    Its parts beneath them are left out. Texture coordinates are the body's own: `uv_faces` is -1 on
    clothes. A body without a wardrobe wears paint.
    """
    if body.name != SHIPPED:
        return hems.painted(body) if look.outfit != BARE else (body, _skin(body))
    skin = Garment(
        bind_vertices=body.bind_vertices,
        bind_vertices_dirs=body.bind_vertices_dirs,
        skin_joints=body.skin_joints,
        skin_weights=body.skin_weights,
        faces=body.faces,
        regions=_skin(body),
    )
    if any(name in cut for cut in HAIRCUTS.values() for name in look.garments):
        skin.regions[(regions(body)[body.faces] == HAIR).all(-1)] = HAIR  # seen between strands
    parts = {BODY: skin}
    parts |= {name: load_garment(name, body.gender, body.detail) for name in look.garments}
    kept = {}
    for below in parts:
        covers = [load_cover(name, below, body.detail) for name in look.garments]
        parts[below], kept[below] = _beneath(parts[below], [c for c in covers if c])
    worn = list(parts.values())
    starts = np.cumsum([0, *(len(part.bind_vertices) for part in worn)])
    uv_faces = body.uv_faces
    if uv_faces is not None:
        bare = np.full((sum(len(part.faces) for part in worn[1:]), 3), -1)
        uv_faces = np.concatenate([uv_faces[kept[BODY]], bare])

    def joined(name: str) -> NDArray[Any]:
        return np.concatenate([getattr(part, name) for part in worn])

    together = replace(
        body,
        bind_vertices=joined("bind_vertices"),
        bind_vertices_dirs=joined("bind_vertices_dirs"),
        skin_joints=joined("skin_joints"),
        skin_weights=joined("skin_weights"),
        faces=np.concatenate([part.faces + at for part, at in zip(worn, starts, strict=False)]),
        regions=None,
        uv_faces=uv_faces,
    )
    return together, joined("regions")


def _beneath(part: Garment, covers: Sequence[Cover]) -> tuple[Garment, NDArray[np.bool_]]:
    """The visible part of a mesh beneath garments, and its faces [F]."""
    hidden = np.zeros(len(part.bind_vertices), bool)
    places = part.bind_vertices.copy()
    joints, weights = part.skin_joints.copy(), part.skin_weights.copy()
    for cover in covers:
        hidden[cover.hides] = True
        places[cover.tucks] += cover.shifts
        joints[cover.tucks], weights[cover.tucks] = cover.skin_joints, cover.skin_weights
    kept: NDArray[np.bool_] = np.asarray(~hidden[part.faces].all(-1))
    left = replace(
        part,
        bind_vertices=places,
        skin_joints=joints,
        skin_weights=weights,
        faces=part.faces[kept],
        regions=part.regions[kept],
    )
    return left, kept


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
