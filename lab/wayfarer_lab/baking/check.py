"""The baked body against anny itself, on people and poses that the bake has not seen.

Every figure lands in the body file's meta and is read back with `library.report`.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.body import skeleton
from wayfarer.body.library import body_from_arrays
from wayfarer.body.model import BodyModel
from wayfarer.body.rotation import matrix_from_quaternion, quaternion_from_rotvec
from wayfarer_lab.baking.anny_source import AnnyPeople, AnnySource

Array = NDArray[np.floating[Any]]

POSE_DEVIATION: Final = 0.35
"""Standard deviation of each local rotation vector's coordinates, radians, 52 joints."""

RANDOM_SHAPES: Final = 200
AXIS_BONES: Final = {
    "left_shoulder": ("left_elbow", (-1, 0, 0)),
    "left_elbow": ("left_wrist", (-1, 0, 0)),
    "left_wrist": ("left_middle1", (-1, 0, 0)),
    "left_hip": ("left_knee", (0, 0, -1)),
    "left_knee": ("left_ankle", (0, 0, -1)),
}
"""Bone → the joint at its end and its direction in the T-pose (the right side mirrors it)."""


def report(
    source: AnnySource,
    people: AnnyPeople,
    arrays: Mapping[str, NDArray[Any]],
    progress: Callable[[int], None] = lambda done: None,
) -> dict[str, Any]:
    """Errors in mm, mean and largest over vertices, identities and poses; angles in degrees.

    representation: bind-pose mesh from 10 betas against the person's own mesh; low: low-poly.
    joints: the same for joint places (made symmetric).
    skinning: our skinning (four influences, symmetric weights) of the person's own mesh and
    joints against anny's.
    posed: the baked body in random poses against anny's body of the same person and pose; this
    adds the effect of symmetric joints. sole_height and stature: T-posed random shapes.
    """
    body = body_from_arrays("anny52", "", arrays)
    low = body_from_arrays("anny52", "", arrays, "low")
    drawn = len(people.low_vertices[0])  # the low mesh ends with marker points
    rng, none = np.random.default_rng(7), np.zeros(0)
    errors = {n: _Error() for n in ("representation", "low", "joints", "skinning", "posed")}
    for n in range(len(people.age)):
        who = {label: values[n : n + 1] for label, values in people.phenotypes.items()}
        betas, lift = fit_betas(body, people.vertices[n])
        shaped = body.bind_vertices + body.bind_vertices_dirs @ betas
        errors["representation"].add(shaped - people.vertices[n] - lift)
        shaped = (low.bind_vertices + low.bind_vertices_dirs @ betas)[:drawn]
        errors["low"].add(shaped - people.low_vertices[n] - lift)
        shaped = body.bind_joints + body.bind_joints_dirs @ betas
        errors["joints"].add(shaped - people.joints[n] - lift)

        local = random_pose(rng)
        world, places = body.forward_kinematics(np.zeros(3), local, body.rest_joints(betas))
        joints = source.rest(who)[1][0]
        # anny's hips lie up to some mm off the midline: put both pelvises in the same place
        hips = world[0] @ body.bind_to_rest[0] @ (joints[0] - people.joints[n, 0])
        truth = source.posed(who, world[None] @ body.bind_to_rest, hips[None])[0]
        errors["posed"].add(body.skin(betas, world, places) - truth)

        own = replace(
            body,
            bind_vertices=people.vertices[n],
            bind_vertices_dirs=np.zeros((*body.bind_vertices.shape, 0)),
            bind_joints=joints,
            bind_joints_dirs=np.zeros((*joints.shape, 0)),
        )
        world, places = own.forward_kinematics(hips, local, own.rest_joints(none))
        errors["skinning"].add(own.skin(none, world, places) - truth)
        progress(n + 1)
    shapes = rng.normal(size=(RANDOM_SHAPES, body.betas))
    heights = np.array([body.rest_vertices(betas)[:, 2] for betas in shapes])
    return {
        "people": len(people.age),
        "error_mm": {name: error.summary() for name, error in errors.items()},
        "sole_height_mm": _range(1000 * heights.min(1)),
        "stature_m": _range(heights.max(1)),
        "bone_off_axis_deg": bone_deviation(body, shapes),
    }


def fit_betas(body: BodyModel, vertices: Array) -> tuple[Array, Array]:
    """Betas [10] and upward shift [3] of the body nearest to a bind-pose mesh, least squares."""
    up = np.tile([0.0, 0.0, -1.0], len(vertices))
    design = np.column_stack([body.bind_vertices_dirs.reshape(len(up), -1), up])
    target = (vertices - body.bind_vertices).ravel()
    found = np.linalg.lstsq(design, target, rcond=None)[0]
    return found[:-1], np.array([0.0, 0.0, found[-1]])


def random_pose(rng: np.random.Generator) -> Array:
    """Local rotations [52, 3, 3]."""
    rotvec = rng.normal(0, POSE_DEVIATION, (len(skeleton.joint_names()), 3))
    return matrix_from_quaternion(quaternion_from_rotvec(rotvec))


def bone_deviation(body: BodyModel, shapes: Array) -> dict[str, float]:
    """Largest angle between a limb bone and its T-pose direction over shapes [N, B], degrees."""
    rest = dict(zip(body.joint_names, np.moveaxis(body.rest_joints(shapes), -2, 0), strict=True))
    worst = {}
    for name, (end, axis) in AXIS_BONES.items():
        along = rest[end] - rest[name]
        cosine = along @ np.array(axis) / np.linalg.norm(along, axis=-1)
        worst[name] = round(float(np.degrees(np.arccos(np.clip(cosine, -1, 1))).max()), 2)
    return worst


@dataclass
class _Error:
    """Running mean and maximum of vertex distances."""

    total: float = 0.0
    count: int = 0
    largest: float = 0.0

    def add(self, difference: Array) -> None:
        distance = np.linalg.norm(difference, axis=-1)
        self.total += float(distance.sum())
        self.count += distance.size
        self.largest = max(self.largest, float(distance.max()))

    def summary(self) -> dict[str, float]:
        return {
            "mean": round(1000 * self.total / self.count, 4),
            "max": round(1000 * self.largest, 3),
        }


def _range(values: Array) -> dict[str, float]:
    return {"min": round(float(values.min()), 3), "max": round(float(values.max()), 3)}
