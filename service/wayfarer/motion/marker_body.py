"""Markers and joints of a body from its body parameters, in torch: differentiable, exportable.

Linear blend skinning restricted to the marker vertices and the posed joints: fingers stay as
modelled, so their skinning weight is folded into the wrists. The curl of a served body's hands
(`body/hands.py`) moves a finger's marker by less than 2 mm and is left out. Inside,
arrays are *poses last* (see `posing.py`): kinematics run level by level down the tree in long rows,
and blending is one matrix product per body, since small products and gathers dominate otherwise.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import ArrayLike
from torch import Tensor, nn
from torch.nn.functional import linear

from wayfarer.errors import InvalidArgument
from wayfarer.motion.constants import indices
from wayfarer.motion.posing import compose, to_columns, to_rows, turn
from wayfarer.spec import POSED_JOINTS


class Shaped(NamedTuple):
    """Bodies of one shape each, for `MarkerBody.blend`."""

    offsets: Tensor  # [3, 22, 1, A] from parent to joint, rest pose
    bind: Tensor  # [A, 4 · 22, M] markers in their joints' frames, weighted; and the weights


class Placed(NamedTuple):
    """Joints of poses, from `MarkerBody.place`."""

    rotations: Tensor  # [3, 3, 22, F, A] world
    places: Tensor  # [3, 22, F, A]


class MarkerBody(nn.Module):
    """Skins M markers of one gendered body. Built from plain arrays (see `BodyModel`)."""

    offsets: Tensor
    offsets_dirs: Tensor
    bind: Tensor
    bind_dirs: Tensor
    rest: Tensor
    rest_dirs: Tensor

    def __init__(
        self,
        parents: ArrayLike,  # [J], numbered level by level
        bind_joints: ArrayLike,  # [J, 3]
        bind_joints_dirs: ArrayLike,  # [J, 3, B]
        bind_to_rest: ArrayLike,  # [J, 3, 3]; of the posed joints
        bind_markers: ArrayLike,  # [M, 3]
        bind_markers_dirs: ArrayLike,  # [M, 3, B]
        skin_joints: ArrayLike,  # [M, 4]
        skin_weights: ArrayLike,  # [M, 4]
    ) -> None:
        super().__init__()
        tree = np.asarray(parents)
        posed = POSED_JOINTS
        turned = np.asarray(bind_to_rest, dtype=np.float64)
        owner = _posed_owner(tree, posed)
        self.levels = _levels(tree[:posed])

        joints = np.asarray(bind_joints, dtype=np.float64)[:posed]
        joints_dirs = np.asarray(bind_joints_dirs, dtype=np.float64)[:posed]
        parent = np.maximum(tree[:posed], 0)
        step = turned[parent]  # rest offset = bind_to_rest[parent] @ bind offset
        offsets = np.einsum("jab,jb->aj", step, joints - joints[parent])
        offsets_dirs = np.einsum("jab,jbk->kaj", step, joints_dirs - joints_dirs[parent])
        self._keep("offsets", offsets)
        self._keep("offsets_dirs", offsets_dirs)

        index, weight = np.asarray(skin_joints), np.asarray(skin_weights, dtype=np.float64)
        dense = np.zeros((posed, len(index)))
        np.add.at(dense.T, (np.arange(len(index))[:, None], owner[index]), weight)
        markers = np.asarray(bind_markers, dtype=np.float64)
        markers_dirs = np.asarray(bind_markers_dirs, dtype=np.float64)
        into = turned[:posed]
        # A marker in the frame of each joint that moves it, times that joint's weight.
        held = np.einsum("jab,jmb,jm->ajm", into, markers - joints[:, None], dense)
        held_dirs = np.einsum("jab,jmbk,jm->kajm", into, markers_dirs - joints_dirs[:, None], dense)
        self._keep("bind", np.concatenate([held, dense[None]]).reshape(4 * posed, -1))
        self._keep("bind_dirs", _with_zeros(held_dirs).reshape(len(held_dirs), 4 * posed, -1))
        # In the T-pose a joint lies at the sum of the offsets that lead to it, and turns nothing.
        moves = _chains(tree[:posed]) @ dense  # [J, M]
        self._keep("rest", held.sum(1) + offsets @ moves)
        self._keep("rest_dirs", held_dirs.sum(2) + offsets_dirs @ moves)

    def _keep(self, name: str, array: ArrayLike) -> None:
        """Registers as a constant of the module (not a weight: not in its state dict)."""
        values = torch.from_numpy(np.array(array, dtype=np.float32))
        self.register_buffer(name, values, persistent=False)

    def shaped(self, betas: Tensor, markers: Sequence[int] | None = None) -> Shaped:
        """The part that depends only on the shape, for these markers or all: betas [A, B]."""
        mean, dirs = self.bind, self.bind_dirs
        if markers is not None:
            some = indices(markers, betas)
            mean, dirs = mean.index_select(-1, some), dirs.index_select(-1, some)
        bind = linear(betas, dirs.flatten(1).T, mean.flatten())
        offsets = linear(betas, self.offsets_dirs.flatten(1).T, self.offsets.flatten())
        return Shaped(
            offsets.T.unflatten(0, self.offsets.shape)[:, :, None],
            bind.unflatten(-1, mean.shape),
        )

    def resting(self, betas: Tensor) -> Tensor:
        """Markers [A, 3, M] of the T-pose, the hips at the origin: betas [A, B]."""
        markers = linear(betas, self.rest_dirs.flatten(1).T, self.rest.flatten())
        return markers.unflatten(-1, self.rest.shape)

    def place(self, shape: Shaped, hips: Tensor, local: Tensor) -> Placed:
        """Joints in the world: hips [3, F, A] and local rotations [3, 3, 22, F, A]."""
        rotations, places = [local[:, :, :1]], [hips[:, None]]
        for level in self.levels[1:]:
            here, base, start = slice(level.first, level.end), rotations[-1], places[-1]
            if level.parents is not None:
                above = indices(level.parents, local)
                base, start = base.index_select(2, above), start.index_select(1, above)
            places.append(start + turn(base, shape.offsets[:, here]))
            rotations.append(compose(base, local[:, :, here]))
        return Placed(torch.cat(rotations, 2), torch.cat(places, 1))

    def blend(self, shape: Shaped, joints: Placed) -> Tensor:
        """Markers [A, F, 3, M]."""
        # [3, 4 · 22, F, A]: x, y or z of the joints' axes and places
        axes = torch.cat([joints.rotations, joints.places[:, None]], 1).flatten(1, 2)
        frames = axes.shape[2]
        rows = to_rows(axes.permute(2, 0, 1, 3)).flatten(1, 2)  # [A, F · 3, 88]
        return (rows @ shape.bind).unflatten(1, (frames, 3))

    def skin(self, shape: Shaped, translation: Tensor, local: Tensor) -> tuple[Tensor, Tensor]:
        """Markers [A, F, M, 3] and joint places [A, F, 22, 3].

        translation [A, F, 3] and local rotations [A, F, 22, 3, 3] of A shapes.
        """
        hips, turns = to_columns(translation), to_columns(local)
        joints = self.place(shape, hips.transpose(0, 1), turns.permute(2, 3, 1, 0, 4))
        markers = self.blend(shape, joints).transpose(-1, -2)
        return markers, to_rows(joints.places.permute(2, 1, 0, 3))

    def forward(self, translation: Tensor, local: Tensor, betas: Tensor) -> tuple[Tensor, Tensor]:
        """Markers [..., M, 3] and joint places [..., 22, 3] of poses that each have their shape.

        translation [..., 3], local rotations [..., 22, 3, 3], betas [..., B].
        """
        shape, rows = translation.shape[:-1], betas.flatten(0, -2)
        markers, places = self.skin(
            self.shaped(rows),
            translation.reshape(-1, 1, 3),
            local.reshape(-1, 1, *local.shape[-3:]),
        )
        return markers.view(*shape, -1, 3), places.reshape(*shape, -1, 3)


class JointLevel(NamedTuple):
    """Joints at one depth of the tree: `first` to `end`."""

    first: int
    end: int
    parents: list[int] | None
    """Their parents' places in the level above; None if each has its own or all share one."""


def _with_zeros(held: np.ndarray) -> np.ndarray:
    """[B, 3, J, M] → [B, 4, J, M]: weights do not depend on the shape."""
    return np.concatenate([held, np.zeros_like(held[:, :1])], 1)


def _chains(parents: np.ndarray) -> np.ndarray:
    """[J, J] 1 if the second joint is the first or hangs from it."""
    chains = np.eye(len(parents))
    for j, parent in enumerate(parents):
        if parent >= 0:
            chains[:, j] += chains[:, parent]
    return chains


def _posed_owner(parents: np.ndarray, posed: int) -> np.ndarray:
    """For every joint the posed joint that carries it (itself when it is posed)."""
    owner = np.arange(len(parents))
    for j in range(posed, len(parents)):
        owner[j] = owner[parents[j]]
    return owner


def _levels(parents: Sequence[int] | np.ndarray) -> list[JointLevel]:
    """Joints by depth in the tree, the root first. Raises InvalidArgument for another order."""
    depth = [0] * len(parents)
    for j, parent in enumerate(parents):
        depth[j] = depth[parent] + 1 if parent >= 0 else 0
    if depth != sorted(depth):
        raise InvalidArgument("the posed joints must be numbered level by level")
    levels = []
    for level in range(max(depth) + 1):
        members = [j for j, d in enumerate(depth) if d == level]
        above = depth.index(level - 1) if level else 0
        rows = [int(parents[j]) - above for j in members]
        alike = len(set(rows)) == 1 == depth.count(level - 1)
        own = rows == list(range(depth.count(level - 1)))
        levels.append(JointLevel(members[0], members[-1] + 1, None if alike or own else rows))
    return levels
