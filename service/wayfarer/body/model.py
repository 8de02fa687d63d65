"""One body of one gender: linear blend skinning over shape coefficients, as numpy arrays.

Frame: metres, right-handed, Z up, the body faces +Y, its right side is +X.
Rest pose: a T-pose in which every bone's rotation is identity. The mesh may be modelled in
another pose (the *bind* pose, e.g. an A-pose): `bind_to_rest` turns each bone from bind to
rest, so skinning stays exact (glTF allows the same: inverse bind ≠ node rest).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.body import landmarks
from wayfarer.errors import InvalidArgument

Array = NDArray[np.floating[Any]]

MAX_BETA: Final = 5.0
"""Largest magnitude of a shape coefficient: five standard deviations."""


INFLUENCES: Final = 4
"""Joints that move one vertex, as engines expect."""


def largest_weights(dense: Array) -> tuple[NDArray[np.int64], Array]:
    """Joints [V, 4] and weights [V, 4] of dense weights [V, J]: largest first, sum 1 again."""
    joints = np.argsort(-dense, axis=-1, kind="stable")[:, :INFLUENCES]
    kept = np.take_along_axis(dense, joints, -1)
    return joints, kept / kept.sum(-1, keepdims=True)


@dataclass(frozen=True, eq=False)
class BodyModel:
    """Arrays of a body. J joints, V vertices, B betas, M markers."""

    name: str  # "anny52", "smplx"
    gender: str
    joint_names: tuple[str, ...]  # J, canonical (SMPL-X) names, parents before children
    parents: NDArray[np.int64]  # [J], -1 for the root
    bind_joints: Array  # [J, 3] mean
    bind_joints_dirs: Array  # [J, 3, B]
    bind_to_rest: Array  # [J, 3, 3] rotation of each bone from bind pose to rest pose
    bind_vertices: Array  # [V, 3] mean
    bind_vertices_dirs: Array  # [V, 3, B]
    skin_joints: NDArray[np.int64]  # [V, 4]
    skin_weights: Array  # [V, 4] sum to 1
    faces: NDArray[np.int64]  # [F, 3]
    marker_names: tuple[str, ...]  # M
    marker_vertices: NDArray[np.int64]  # [M]
    pose_dirs: Array | None = None  # [V, 3, (J-1)*9] pose blend shapes (SMPL-X), on the bind mesh
    regions: NDArray[np.uint8] | None = None  # [V] what each vertex wears, numbers of `outfit.py`
    uvs: Array | None = None  # [T, 2] texture coordinates, (0, 0) at the upper left as in glTF
    uv_faces: NDArray[np.int64] | None = None  # [F, 3] row of `uvs` of each corner of `faces`
    detail: str = "high"  # of the mesh

    @property
    def betas(self) -> int:
        """Number of shape coefficients."""
        return int(self.bind_vertices_dirs.shape[-1])

    @cached_property
    def sole_markers(self) -> NDArray[np.int64]:
        """Indices [8] of the markers of the soles, left ones first: heel, both balls, toe.

        A set with nothing under the feet (MOJO's SSM2) uses those around them instead, 1 to 3 cm
        above the floor: see `sole_vertices`.
        """
        if self._has_soles:
            return np.array([i for i, n in enumerate(self.marker_names) if "SOLE" in n])
        around = [side + part for side in "LR" for part in landmarks.AROUND_SOLE]
        return np.array([self.marker_names.index(n) for n in around if n in self.marker_names])

    @cached_property
    def sole_vertices(self) -> NDArray[np.int64]:
        """Vertices [8] under the feet, in the order of `sole_markers`.

        They carry those markers, or are found on the mesh. Raises ValueError without feet.
        """
        if self._has_soles:
            return self.marker_vertices[self.sole_markers]
        joints = dict(zip(self.joint_names, self.rest_joints(np.zeros(self.betas)), strict=True))
        return landmarks.find_soles(self.rest_vertices(np.zeros(self.betas)), joints)

    @cached_property
    def _has_soles(self) -> bool:
        return any("SOLE" in name for name in self.marker_names)

    def sole_height(self, betas: Array, rotations: Array, places: Array, markers: Array) -> float:
        """Height in metres of the lowest point under the feet; one pose, arguments as in `skin`."""
        if self._has_soles:
            return float(markers[self.sole_markers, 2].min())
        return float(self.skin(betas, rotations, places, self.sole_vertices)[:, 2].min())

    def check_betas(self, betas: Array) -> Array:
        """Returns betas as float64. Raises InvalidArgument on shape, NaN or |beta| > 5."""
        values = np.asarray(betas, dtype=np.float64)
        if values.shape[-1:] != (self.betas,) or not np.isfinite(values).all():
            raise InvalidArgument(f"betas must be {self.betas} finite numbers", "betas")
        if (np.abs(values) > MAX_BETA).any():
            raise InvalidArgument(
                f"each beta must lie in [-{MAX_BETA:g}, {MAX_BETA:g}] (unit variance)", "betas"
            )
        return values

    def rest_joints(self, betas: Array) -> Array:
        """T-pose joint places, hips at their height above sole level. [..., J, 3]."""
        shape = np.asarray(betas)
        bind = self.bind_joints + np.einsum("jcb,...b->...jc", self.bind_joints_dirs, shape)
        rest = np.zeros_like(bind)
        rest[..., 0, :] = bind[..., 0, :]
        for j, parent in enumerate(self.parents[1:], start=1):
            offset = (bind[..., j, :] - bind[..., parent, :]) @ self.bind_to_rest[parent].T
            rest[..., j, :] = rest[..., parent, :] + offset
        return rest

    def forward_kinematics(
        self, translation: Array, local: Array, rest_joints: Array
    ) -> tuple[Array, Array]:
        """World joint rotations [..., J, 3, 3] and places [..., J, 3], in metres.

        translation [..., 3] is the world place of the hips; local [..., P, 3, 3] with P ≤ J:
        joints after P stay at rest; rest_joints [..., J, 3]. Leading shapes broadcast.
        """
        posed = local.shape[-3]
        batch = np.broadcast_shapes(
            np.shape(translation)[:-1], local.shape[:-3], rest_joints.shape[:-2]
        )
        identity = np.broadcast_to(np.eye(3), (*batch, 3, 3))
        local = np.broadcast_to(local, (*batch, *local.shape[-3:]))
        rotations: list[Array] = [local[..., 0, :, :]]
        places: list[Array] = [np.broadcast_to(translation, (*batch, 3))]
        for j, parent in enumerate(self.parents[1:], start=1):
            turn = local[..., j, :, :] if j < posed else identity
            offset = rest_joints[..., j, :] - rest_joints[..., parent, :]
            places.append(places[parent] + np.einsum("...ij,...j->...i", rotations[parent], offset))
            rotations.append(rotations[parent] @ turn)
        return np.stack(rotations, -3), np.stack(places, -2)

    def skin(
        self,
        betas: Array,
        rotations: Array,
        places: Array,
        vertices: Sequence[int] | NDArray[np.int64] | None = None,
    ) -> Array:
        """Vertex positions in the world [..., V, 3] from world joint rotations and places.

        `betas` is one shape [B]; `vertices` restricts to some (e.g. `marker_vertices`).
        """
        chosen = slice(None) if vertices is None else np.asarray(vertices)
        betas = np.asarray(betas)
        bind = self.bind_vertices[chosen] + self.bind_vertices_dirs[chosen] @ betas
        bind_joints = self.bind_joints + self.bind_joints_dirs @ betas
        if self.pose_dirs is not None:
            local = self._local(rotations)[..., 1:, :, :] - np.eye(3)
            features = local.reshape(*local.shape[:-3], -1)
            bind = bind + np.einsum("vcp,...p->...vc", self.pose_dirs[chosen], features)
        turn = rotations @ self.bind_to_rest  # bone from bind pose to the world
        shift = places - np.einsum("...jab,jb->...ja", turn, bind_joints)
        transforms = np.concatenate([turn, shift[..., None]], -1)  # [..., J, 3, 4]
        flat = transforms.reshape(*transforms.shape[:-2], 12)
        # One matrix product over all joints beats gathering four transforms per vertex.
        blended = (self._dense_weights[chosen] @ flat).reshape(*flat.shape[:-2], -1, 3, 4)
        return np.einsum("...vab,...vb->...va", blended[..., :3], bind) + blended[..., 3]

    def rest_vertices(
        self, betas: Array, vertices: Sequence[int] | NDArray[np.int64] | None = None
    ) -> Array:
        """Vertices [V, 3] of the T-pose standing on the floor, for one shape [B]."""
        rest = self.rest_joints(betas)
        return self.skin(betas, np.tile(np.eye(3), (len(rest), 1, 1)), rest, vertices)

    def markers(self, betas: Array, rotations: Array, places: Array) -> Array:
        """Marker positions [..., M, 3]; arguments as in `skin`."""
        return self.skin(betas, rotations, places, self.marker_vertices)

    @cached_property
    def _dense_weights(self) -> Array:
        """Skinning weights of every joint. [V, J]."""
        dense = np.zeros((len(self.skin_joints), len(self.parents)))
        np.add.at(dense, (np.arange(len(dense))[:, None], self.skin_joints), self.skin_weights)
        return dense

    def _local(self, world: Array) -> Array:
        """Local rotations [..., J, 3, 3] from world rotations."""
        local = np.array(world)
        for j, parent in enumerate(self.parents[1:], start=1):
            back = np.swapaxes(world[..., parent, :, :], -1, -2)
            local[..., j, :, :] = back @ world[..., j, :, :]
        return local
