"""SMPL-X bodies from a user's own SMPLX_{MALE,FEMALE,NEUTRAL}.npz, behind the same `BodyModel`.

The model files are licensed by the Max Planck Institute and are not shipped; this loader reads
their arrays and shares no code with the `smplx` package. Source of the formulae: Loper et al.,
SMPL (2015), Eq. 2-10, and Pavlakos et al., SMPL-X (2019), Sec. 3.1.

Frame: SMPL-X is Y up and faces +Z; here it is turned to Z up, facing +Y, by (x, y, z) →
(-x, z, y), and set on the floor: the sole of the T-pose is at z = 0 for every shape.
Joints: the first 52 are ours, in our order; jaw and eyes, which the file has at 22…24, come last.
Shape: the first 10 betas; expressions stay neutral. Skinning keeps the four largest weights per
vertex, renormalised, as engines do.
"""

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.body import landmarks, skeleton
from wayfarer.body.model import BodyModel, largest_weights
from wayfarer.body.rotation import GLTF_FROM_CORE
from wayfarer.errors import ArtifactError
from wayfarer.spec import BETAS, JOINTS, MARKERS

Array = NDArray[np.floating[Any]]

FILE_JOINTS: Final = 55
EXTRA_JOINTS: Final = ("jaw", "left_eye_smplhf", "right_eye_smplhf")

_BODY = 22
_ORDER = (*range(_BODY), *range(_BODY + 3, FILE_JOINTS), *range(_BODY, _BODY + 3))
"""Place in the file of each of our joints."""

_AXES = GLTF_FROM_CORE  # p_ours = _AXES @ p_file; its own inverse


def load_smplx(path: Path, gender: str, markers: Path | None = None) -> BodyModel:
    """A body from a model file.

    `markers` is a JSON file {name: vertex index} of all 67 names of `landmarks.marker_names()`, or
    a file of MOJO's form with 67 markers of other names (SSM2.json, which GAMMA's own networks
    need): {"markersets": [{"indices": {name: vertex index}}]}, in its order. Without it markers are
    found on the mesh by the geometry of `landmarks`.

    Raises:
        ArtifactError: the file is missing, pickled or not of the SMPL-X layout; the message
            names the array and the expected shape.
    """
    file = read_archive(path)
    vertices = read_array(path, file, "v_template", ("V", 3))
    count = len(vertices)
    shapes = read_array(path, file, "shapedirs", (count, 3, "B"))
    if shapes.shape[-1] < BETAS:
        raise ArtifactError(f"{path}: shapedirs has {shapes.shape[-1]} betas, {BETAS} are needed")
    regressor = read_array(path, file, "J_regressor", (FILE_JOINTS, count))
    weights = read_array(path, file, "weights", (count, FILE_JOINTS))[:, _ORDER]
    poses = read_array(path, file, "posedirs", (count, 3, 9 * (FILE_JOINTS - 1)))
    faces = read_array(path, file, "f", ("F", 3)).astype(np.int64)

    mean = vertices @ _AXES.T
    dirs = np.einsum("ab,vbk->vak", _AXES, shapes[..., :BETAS])
    regressor = regressor[_ORDER, :]
    joints, joints_dirs = regressor @ mean, np.einsum("jv,vck->jck", regressor, dirs)
    # The floor is at one vertex, the mean body's lowest, and so stays linear in betas.
    lowest = mean[:, 2].argmin()
    floor = mean[lowest] * [0.0, 0.0, 1.0]
    floor_dirs = dirs[lowest] * np.array([[0.0], [0.0], [1.0]])
    skin_joints, skin_weights = largest_weights(weights)
    body = BodyModel(
        name="smplx",
        gender=gender,
        joint_names=(*skeleton.joint_names(), *EXTRA_JOINTS),
        parents=_parents(path, file),
        bind_joints=joints - floor,
        bind_joints_dirs=joints_dirs - floor_dirs,
        bind_to_rest=np.tile(np.eye(3), (FILE_JOINTS, 1, 1)),
        bind_vertices=mean - floor,
        bind_vertices_dirs=dirs - floor_dirs,
        faces=faces,
        marker_names=landmarks.marker_names(),
        marker_vertices=np.zeros(0, dtype=np.int64),
        pose_dirs=_pose_directions(poses),
        skin_joints=skin_joints,
        skin_weights=skin_weights,
    )
    return _with_markers(body, markers, path)


def read_archive(path: Path) -> Mapping[str, Any]:
    """The archive; its arrays are read one by one, so unused pickled ones are harmless."""
    try:
        file = np.load(path, allow_pickle=False)
    except (OSError, ValueError) as error:
        raise ArtifactError(f"{path}: cannot be read as npz: {error}") from error
    if not isinstance(file, np.lib.npyio.NpzFile):
        raise ArtifactError(f"{path}: is a single array, expected SMPLX_<GENDER>.npz")
    return file


def read_array(
    path: Path, file: Mapping[str, Any], name: str, shape: tuple[int | str, ...]
) -> NDArray[np.float64]:
    """One array as float64; a letter in `shape` stands for any size."""
    if name not in file:
        raise ArtifactError(f"{path}: array {name} is missing; found {sorted(file)}")
    try:
        values = np.asarray(file[name], dtype=np.float64)
    except ValueError as error:
        raise ArtifactError(
            f"{path}: array {name} is pickled or not numeric, and pickles may run code, so they "
            "are not read: use the .npz of the SMPL-X v1.1 download, not the .pkl, or save the "
            f"arrays again as plain numbers ({error})"
        ) from error
    fits = len(values.shape) == len(shape) and all(
        isinstance(want, str) or want == got for want, got in zip(shape, values.shape, strict=True)
    )
    if not fits:
        raise ArtifactError(f"{path}: array {name} has shape {values.shape}, expected {shape}")
    if not np.isfinite(values).all():
        raise ArtifactError(f"{path}: array {name} has values that are not finite")
    return values


def _parents(path: Path, file: Mapping[str, Any]) -> NDArray[np.int64]:
    """Parents in our order, checked against our skeleton (a file's root has no valid parent)."""
    tree = read_array(path, file, "kintree_table", (2, FILE_JOINTS))[0].astype(np.int64)
    ours = {in_file: j for j, in_file in enumerate(_ORDER)}
    parents = np.array([ours.get(int(tree[in_file]), -1) for in_file in _ORDER])
    parents[0] = -1
    expected = [*skeleton.parents(), *[skeleton.joint_names().index("head")] * len(EXTRA_JOINTS)]
    wrong = [j for j in range(FILE_JOINTS) if parents[j] != expected[j]]
    if wrong:
        names = (*skeleton.joint_names(), *EXTRA_JOINTS)
        raise ArtifactError(
            f"{path}: kintree_table is not that of SMPL-X: wrong parents of "
            f"{[names[j] for j in wrong]}"
        )
    return parents


def _pose_directions(poses: Array) -> Array:
    """Pose blend shapes [V, 3, 54*9] for our frame and joint order.

    The file multiplies them with the flattened R - 1 of joints 1…54. With R_file = A R A
    (A the axes, its own inverse) and offsets turned by A, each of the three indices turns by A.
    """
    moved = [joint - 1 for joint in _ORDER[1:]]
    split = poses.reshape(len(poses), 3, FILE_JOINTS - 1, 3, 3)[:, :, moved]
    turned = np.einsum("ki,vijab,ac,bd->vkjcd", _AXES, split, _AXES, _AXES, optimize=True)
    return turned.reshape(poses.shape)


def _with_markers(body: BodyModel, markers: Path | None, path: Path) -> BodyModel:
    if markers is not None:
        table = _chosen(markers, len(body.bind_vertices))
        return replace(
            body, marker_names=tuple(table), marker_vertices=np.array([*table.values()], np.int64)
        )
    joints = dict(zip(body.joint_names[:JOINTS], body.bind_joints, strict=False))
    try:
        found = landmarks.find_markers(body.bind_vertices, body.faces, joints)
    except ValueError as error:
        raise ArtifactError(
            f"{path}: markers cannot be found by geometry ({error}): name them in a JSON file"
        ) from error
    return replace(body, marker_vertices=found)


def _chosen(path: Path, vertices: int) -> dict[str, int]:
    """Vertices by marker, in the networks' order, from a user's JSON. Raises ArtifactError."""
    try:
        table = json.loads(path.read_text())
    except (OSError, ValueError) as error:
        raise ArtifactError(f"{path}: cannot be read as JSON: {error}") from error
    names = landmarks.marker_names()
    if isinstance(table, dict) and "markersets" in table:
        try:
            table = dict(table["markersets"][0]["indices"])
        except (LookupError, TypeError, ValueError) as error:
            raise ArtifactError(f"{path}: markersets[0].indices is no object") from error
        names = tuple(table)
        if len(names) != MARKERS:
            raise ArtifactError(
                f"{path}: markersets[0].indices has {len(names)} markers, expected {MARKERS}"
            )
    if not isinstance(table, dict) or set(table) != set(names):
        raise ArtifactError(f"{path}: expected an object with the {MARKERS} names {list(names)}")
    for name, vertex in table.items():
        if type(vertex) is not int or not 0 <= vertex < vertices:
            raise ArtifactError(f"{path}: {name}: {vertex!r} is not a vertex 0…{vertices - 1}")
    return {name: table[name] for name in names}
