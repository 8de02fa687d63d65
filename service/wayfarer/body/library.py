"""Shipped bodies and a user's own, by name, gender and detail."""

import json
import os
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from wayfarer.body import skeleton
from wayfarer.body.hands import relaxed
from wayfarer.body.model import BodyModel
from wayfarer.body.smplx import load_smplx
from wayfarer.errors import ArtifactError, NotFound
from wayfarer.models.artifacts import ASSETS, sha256_of
from wayfarer.spec import BETAS, GENDERS, MARKERS

Detail = Literal["high", "low"]

LAYOUT: Final = 1
"""Version of the arrays in a body file."""

SHIPPED: Final = "anny52"
"""The shipped body."""

GENDERS_OF: Final[Mapping[str, tuple[str, ...]]] = {
    SHIPPED: GENDERS,
    "smplx": (*GENDERS, "neutral"),
}
"""Bodies and their genders. anny52 is shipped; smplx is a user's own (`SMPLX_FOLDER`)."""

DETAILS: Final = ("high", "low")
FOLDER: Final = ASSETS / "body"
MANIFEST: Final = "manifest.json"

SMPLX_FOLDER: Final = "WAYFARER_SMPLX_DIR"
"""Environment variable: the folder of SMPLX_{MALE,FEMALE,NEUTRAL}.npz; a markers.json in it
(marker name → vertex) replaces the markers found by geometry."""

_SHARED = ("bind_joints", "bind_joints_dirs", "bind_to_rest", "marker_names")
_PER_DETAIL = (
    "bind_vertices",
    "bind_vertices_dirs",
    "skin_joints",
    "skin_weights",
    "faces",
    "marker_vertices",
    "regions",
)


def load_body(name: str, gender: str, detail: Detail = "high") -> BodyModel:
    """A body, cached. Both details have the same joints, betas and markers; a user's own body has
    one mesh for both.

    Raises:
        NotFound: no such body, gender or detail; the message lists the known ones.
        ArtifactError: its file is missing, damaged or has another layout.
    """
    path = body_file(name, gender)
    _check("detail", detail, DETAILS)
    return _load(name, gender, detail if name == SHIPPED else "high", path)


def texture_file(name: str) -> str:
    """Name of the file of a shipped body's texture coordinates, which its genders share."""
    return f"{name}_texture.npz"


def body_file(name: str, gender: str) -> Path:
    """The path of a body's file. Raises NotFound."""
    _check("body", name, tuple(GENDERS_OF))
    _check("gender", gender, GENDERS_OF[name])
    if name == SHIPPED:
        return FOLDER / f"{name}_{gender}.npz"
    folder = os.environ.get(SMPLX_FOLDER)
    if not folder:
        raise NotFound(
            f"body 'smplx' needs your own model files: set {SMPLX_FOLDER} to the folder of "
            "SMPLX_MALE.npz, SMPLX_FEMALE.npz and SMPLX_NEUTRAL.npz"
        )
    return Path(folder) / f"SMPLX_{gender.upper()}.npz"


def _check(what: str, value: str, allowed: tuple[str, ...]) -> None:
    if value not in allowed:
        raise NotFound(f"no {what} {value!r}; allowed: {', '.join(allowed)}")


@cache
def load_arrays(path: Path) -> Mapping[str, NDArray[Any]]:
    """All arrays of a body file, whose hash must equal the manifest's. Raises ArtifactError."""
    expected = _manifest(path.parent).get(path.name)
    found = sha256_of(path)
    if found != expected:
        raise ArtifactError(f"{path}: SHA-256 is {found}, the manifest says {expected}")
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays = dict(file)
    except (OSError, ValueError) as error:
        raise ArtifactError(f"{path}: cannot be read as npz: {error}") from error
    layout = json.loads(str(arrays["meta"]))["layout"] if "meta" in arrays else None
    if layout != LAYOUT:
        raise ArtifactError(f"{path}: layout {layout}, expected {LAYOUT}: bake the body again")
    return arrays


def report(name: str, gender: str) -> dict[str, Any]:
    """Errors of anny52 against anny, measured when it was baked (see `baking/check.py`)."""
    meta: dict[str, Any] = json.loads(str(load_arrays(body_file(name, gender))["meta"]))
    return dict(meta["report"])


@cache
def _load(name: str, gender: str, detail: Detail, path: Path) -> BodyModel:
    if name == "smplx":
        markers = path.with_name("markers.json")
        return load_smplx(path, gender, markers if markers.exists() else None)
    texture = load_arrays(path.with_name(texture_file(name)))
    body = body_from_arrays(name, gender, {**texture, **load_arrays(path)}, detail)
    if len(body.marker_names) != MARKERS or body.betas != BETAS:
        raise ArtifactError(
            f"{path}: {len(body.marker_names)} markers and {body.betas} betas, "
            f"expected {MARKERS} and {BETAS}"
        )
    turns = relaxed(body.joint_names, body.bind_joints, body.bind_to_rest)
    return replace(body, bind_to_rest=turns)


def body_from_arrays(
    name: str, gender: str, arrays: Mapping[str, NDArray[Any]], detail: Detail = "high"
) -> BodyModel:
    """A body from the arrays of its file. Raises ArtifactError when one is missing.

    They may include texture coordinates, which are in their own file.
    """
    prefix = "low_" if detail == "low" else ""
    missing = [n for n in (*_SHARED, *(prefix + n for n in _PER_DETAIL)) if n not in arrays]
    if missing:
        raise ArtifactError(f"body {name} ({gender}): arrays {missing} are missing")
    return BodyModel(
        name=name,
        gender=gender,
        joint_names=skeleton.joint_names(),
        parents=np.array(skeleton.parents(), dtype=np.int64),
        bind_joints=arrays["bind_joints"].astype(np.float64),
        bind_joints_dirs=arrays["bind_joints_dirs"].astype(np.float64),
        bind_to_rest=arrays["bind_to_rest"].astype(np.float64),
        bind_vertices=arrays[prefix + "bind_vertices"].astype(np.float64),
        bind_vertices_dirs=arrays[prefix + "bind_vertices_dirs"].astype(np.float64),
        skin_joints=arrays[prefix + "skin_joints"].astype(np.int64),
        skin_weights=_normalised(arrays[prefix + "skin_weights"]),
        faces=arrays[prefix + "faces"].astype(np.int64),
        marker_names=tuple(str(n) for n in arrays["marker_names"]),
        marker_vertices=arrays[prefix + "marker_vertices"].astype(np.int64),
        regions=arrays[prefix + "regions"],
        detail=detail,
        uvs=arrays[prefix + "uvs"].astype(np.float64) if prefix + "uvs" in arrays else None,
        uv_faces=(
            arrays[prefix + "uv_faces"].astype(np.int64) if prefix + "uv_faces" in arrays else None
        ),
    )


def write_manifest(folder: Path) -> None:
    """Writes the SHA-256 of each body file in a folder."""
    hashes = {path.name: sha256_of(path) for path in sorted(folder.glob("*.npz"))}
    (folder / MANIFEST).write_text(json.dumps(hashes, indent=1) + "\n")


def _normalised(weights: NDArray[Any]) -> NDArray[np.float64]:
    values = weights.astype(np.float64)
    return values / values.sum(-1, keepdims=True)


def _manifest(folder: Path) -> dict[str, str]:
    try:
        values = json.loads((folder / MANIFEST).read_text())
    except (OSError, ValueError) as error:
        raise ArtifactError(f"{folder / MANIFEST}: cannot be read as JSON: {error}") from error
    return dict(values)
