"""Kinematics with frames as the last axis, for the fit.

The fit repeats kinematics and its gradient hundreds of times over thousands of frames of many
bodies. Products of 3×3 matrices do not vectorise; sums and products along frames do: this is
10 times faster than `motion.marker_body` on a CPU. Rotations are unit quaternions x, y, z, w.
"""

import numpy as np
import torch
from torch import Tensor

from wayfarer.body.model import BodyModel
from wayfarer.spec import POSED_JOINTS
from wayfarer_lab.training.mocap.rig import PARENTS
from wayfarer_lab.training.mocap.skeleton import Array


def from_rotvec(rotvec: Tensor) -> Tensor:
    """Axis times angle [J, 3, N] → quaternions [J, 4, N]; safe at zero."""
    angle = torch.sqrt((rotvec * rotvec).sum(1, keepdim=True) + 1e-12)
    return torch.cat([rotvec * (torch.sin(angle / 2) / angle), torch.cos(angle / 2)], 1)


def multiply(a: Tensor, b: Tensor) -> Tensor:
    """Rotation b, then a: [J, 4, N]."""
    av, aw, bv, bw = a[:, :3], a[:, 3:], b[:, :3], b[:, 3:]
    vector = aw * bv + bw * av + torch.linalg.cross(av, bv, dim=1)
    return torch.cat([vector, aw * bw - (av * bv).sum(1, keepdim=True)], 1)


def rotate(q: Tensor, v: Tensor) -> Tensor:
    """Vectors [J, 3, N] turned by quaternions [J, 4, N]."""
    twice = 2 * torch.linalg.cross(q[:, :3], v, dim=1)
    return v + q[:, 3:] * twice + torch.linalg.cross(q[:, :3], twice, dim=1)


class FrameKinematics:
    """Joint and skin point places of one gender's bodies, each frame with its own shape."""

    def __init__(self, body: BodyModel, points: Array, device: str = "cpu") -> None:
        """`points` are mesh vertices to skin; they must hang on the 22 posed joints."""
        self.body = body
        self.points = points
        depth = np.zeros(POSED_JOINTS, int)
        for j, parent in enumerate(PARENTS[1:], start=1):
            depth[j] = depth[parent] + 1
        self.levels = [np.flatnonzero(depth == d) for d in range(depth.max() + 1)]
        order = np.concatenate(self.levels)
        self.back = torch.as_tensor(np.argsort(order), device=device)
        self.above = [
            torch.as_tensor(np.searchsorted(up, PARENTS[down]), device=device)
            for up, down in zip(self.levels, self.levels[1:], strict=False)
        ]
        # one entry for each (point, joint) pair with weight
        weights, joints = body.skin_weights[points], body.skin_joints[points]
        rows, slots = np.nonzero(weights > 1e-4)
        self.pair_point = torch.as_tensor(rows, device=device)
        self.pair_joint = joints[rows, slots]
        share = weights[rows, slots] / np.bincount(rows, weights[rows, slots])[rows]
        self.pair_weight = torch.as_tensor(share, dtype=torch.float32, device=device)[:, None, None]

    def shape(self, betas: Array) -> tuple[Array, Array]:
        """What depends on a shape: bone offsets [22, 3], and points seen from joints [K, 3]."""
        body = self.body
        rest = body.rest_joints(betas)[:POSED_JOINTS]
        offsets = rest - rest[np.maximum(PARENTS, 0)]
        bind = body.bind_joints + body.bind_joints_dirs @ betas
        skin = body.bind_vertices[self.points] + body.bind_vertices_dirs[self.points] @ betas
        pairs = self.pair_joint
        seen = skin[self.pair_point.cpu().numpy()] - bind[pairs]
        return offsets, np.einsum("kij,kj->ki", body.bind_to_rest[pairs], seen)

    def __call__(
        self, hips: Tensor, local: Tensor, offsets: Tensor, seen: Tensor
    ) -> tuple[Tensor, Tensor]:
        """Joint places [22, 3, N] and skin points [S, 3, N].

        hips [3, N], local quaternions [22, 4, N], and per frame what `shape` gives:
        offsets [22, 3, N], seen [K, 3, N].
        """
        turns, places = [local[:1]], [hips[None]]
        for above, joints in zip(self.above, self.levels[1:], strict=True):
            turn, place = turns[-1][above], places[-1][above]
            places.append(place + rotate(turn, offsets[joints]))
            turns.append(multiply(turn, local[joints]))
        world, place = torch.cat(turns)[self.back], torch.cat(places)[self.back]
        carried = rotate(world[self.pair_joint], seen) + place[self.pair_joint]
        points = torch.zeros(len(self.points), *hips.shape, device=hips.device)
        return place, points.index_add(0, self.pair_point, carried * self.pair_weight)
