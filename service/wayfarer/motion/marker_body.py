"""Markers and joints of a body from its body parameters, in torch: differentiable, exportable.

Linear blend skinning restricted to the marker vertices and the posed joints: fingers stay at
rest, so their skinning weight is folded into the wrists. Kinematics run level by level down
the tree; what depends on the shape alone is worked out once for all frames (`shaped`); blending is
one matrix product for all, with markers last, since gathers and small products dominate otherwise.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import ArrayLike
from torch import Tensor, nn

from wayfarer.errors import InvalidArgument
from wayfarer.spec import POSED_JOINTS


class Shaped(NamedTuple):
    """A body of one shape per row, as `MarkerBody.skin` wants it."""

    offsets: Tensor  # [..., 22, 3] from parent to joint, rest pose
    bind_joints: Tensor  # [..., 22, 3]
    bind_markers: Tensor  # [..., 4, M] x, y, z and 1


class MarkerBody(nn.Module):
    """Skins M markers of one gendered body. Built from plain arrays (see `BodyModel`)."""

    offsets: Tensor
    offsets_dirs: Tensor
    bind_joints: Tensor
    bind_joints_dirs: Tensor
    turn: Tensor
    bind_markers: Tensor
    bind_markers_dirs: Tensor
    weights: Tensor

    def __init__(
        self,
        parents: ArrayLike,  # [J]
        bind_joints: ArrayLike,  # [J, 3]
        bind_joints_dirs: ArrayLike,  # [J, 3, B]
        bind_to_rest: ArrayLike,  # [J, 3, 3]
        bind_markers: ArrayLike,  # [M, 3]
        bind_markers_dirs: ArrayLike,  # [M, 3, B]
        skin_joints: ArrayLike,  # [M, 4]
        skin_weights: ArrayLike,  # [M, 4]
    ) -> None:
        super().__init__()
        tree = np.asarray(parents)
        posed = POSED_JOINTS
        turn = np.asarray(bind_to_rest, dtype=np.float64)
        owner = _posed_owner(tree, posed)
        if np.abs(turn - turn[owner]).max() > 1e-5:
            raise InvalidArgument(
                "unposed joints must share the bind_to_rest of the joint they hang from"
            )

        joints = np.asarray(bind_joints, dtype=np.float64)
        dirs = np.asarray(bind_joints_dirs, dtype=np.float64)
        parent = np.maximum(tree[:posed], 0)
        step = turn[parent]  # rest offset = bind_to_rest[parent] @ bind offset
        offsets = np.einsum("jab,jb->ja", step, joints[:posed] - joints[parent])
        offsets_dirs = np.einsum("jab,jbk->jak", step, dirs[:posed] - dirs[parent])

        index, weight = np.asarray(skin_joints), np.asarray(skin_weights, dtype=np.float64)
        dense = np.zeros((len(index), posed))
        np.add.at(dense, (np.arange(len(index))[:, None], owner[index]), weight)

        self.levels = _levels(tree[:posed])
        order = [j for level in self.levels for j in level]
        self.inverse_order = [order.index(j) for j in range(posed)]
        self.level_parents = [[int(tree[j]) for j in level] for level in self.levels]
        self._keep("offsets", offsets)
        self._keep("offsets_dirs", offsets_dirs)
        self._keep("bind_joints", joints[:posed])
        self._keep("bind_joints_dirs", dirs[:posed])
        self._keep("turn", turn[:posed])
        self._keep("bind_markers", bind_markers)
        self._keep("bind_markers_dirs", bind_markers_dirs)
        self._keep("weights", dense.T)

    def _keep(self, name: str, array: ArrayLike) -> None:
        """Register as a constant of the module (not a weight: not in its state dict)."""
        values = torch.from_numpy(np.array(array, dtype=np.float32))
        self.register_buffer(name, values, persistent=False)

    def shaped(self, betas: Tensor) -> Shaped:
        """What a shape alone decides: betas [..., B]."""
        column = betas[..., None, :, None]
        bind_markers = self.bind_markers + (self.bind_markers_dirs @ column).squeeze(-1)
        one = torch.ones_like(bind_markers[..., :1])
        return Shaped(
            offsets=self.offsets + (self.offsets_dirs @ column).squeeze(-1),
            bind_joints=self.bind_joints + (self.bind_joints_dirs @ column).squeeze(-1),
            bind_markers=torch.cat([bind_markers, one], -1).transpose(-1, -2),
        )

    def kinematics(
        self, shape: Shaped, translation: Tensor, local: Tensor
    ) -> tuple[Tensor, Tensor]:
        """World rotations [..., F, 22, 3, 3] and joint places [..., F, 22, 3].

        translation [..., F, 3], local rotations [..., F, 22, 3, 3] of a shape [...].
        """
        offsets = shape.offsets[..., None, :, :]
        rotations, places = [local[..., :1, :, :]], [translation[..., None, :]]
        for below, joints in enumerate(self.levels[1:]):
            above = self.levels[below]
            rows = [above.index(p) for p in self.level_parents[below + 1]]
            base = rotations[-1][..., rows, :, :]
            moved = (base * offsets[..., joints, None, :]).sum(-1)
            places.append(places[-1][..., rows, :] + moved)
            rotations.append(base @ local[..., joints, :, :])
        back = self.inverse_order
        return torch.cat(rotations, -3)[..., back, :, :], torch.cat(places, -2)[..., back, :]

    def skin(self, shape: Shaped, translation: Tensor, local: Tensor) -> tuple[Tensor, Tensor]:
        """Markers [..., F, M, 3] and joint places [..., F, 22, 3]; arguments as in `kinematics`."""
        rotations, places = self.kinematics(shape, translation, local)
        turn = rotations @ self.turn
        shift = places - (turn * shape.bind_joints[..., None, :, None, :]).sum(-1)
        transform = torch.cat([turn, shift[..., None]], -1)  # [..., F, 22, 3, 4]
        by_entry = transform.movedim(-3, -1).flatten(-3, -2)  # [..., F, 3 · 4, 22]
        blended = (by_entry @ self.weights).unflatten(-2, (3, 4))  # [..., F, 3, 4, M]
        markers = (blended * shape.bind_markers[..., None, None, :, :]).sum(-2)
        return markers.transpose(-1, -2), places

    def forward(self, translation: Tensor, local: Tensor, betas: Tensor) -> tuple[Tensor, Tensor]:
        """Markers [..., M, 3] and joint places [..., 22, 3] of poses that each have their shape.

        translation [..., 3], local rotations [..., 22, 3, 3], betas [..., B].
        """
        markers, places = self.skin(
            self.shaped(betas), translation[..., None, :], local[..., None, :, :, :]
        )
        return markers[..., 0, :, :], places[..., 0, :, :]


def _posed_owner(parents: np.ndarray, posed: int) -> np.ndarray:
    """For every joint the posed joint that carries it (itself when it is posed)."""
    owner = np.arange(len(parents))
    for j in range(posed, len(parents)):
        owner[j] = owner[parents[j]]
    return owner


def _levels(parents: Sequence[int] | np.ndarray) -> list[list[int]]:
    """Joints grouped by depth in the tree; level 0 is the root."""
    depth = [0] * len(parents)
    for j, parent in enumerate(parents):
        depth[j] = depth[parent] + 1 if parent >= 0 else 0
    return [[j for j, d in enumerate(depth) if d == level] for level in range(max(depth) + 1)]
