"""The retargeting fit: small corrections to copied rotations, all frames of many clips at once.

Unknowns per frame: a rotation vector per joint and a shift of the hips. Adam minimises, each in
units of the deviation we accept: joint places, corrections, their change over time, joint
acceleration (against the recording's), soles under the floor, and, while a part of a foot
touches, its height and slide.
"""

import itertools
from dataclasses import dataclass

import numpy as np
import torch
from scipy.spatial.transform import Rotation
from torch import Tensor
from torch.nn.functional import avg_pool1d

from wayfarer.body.model import BodyModel
from wayfarer.spec import FPS
from wayfarer_lab.training.mocap.kinematics import FrameKinematics, from_rotvec, multiply
from wayfarer_lab.training.mocap.retarget import FitProblem
from wayfarer_lab.training.mocap.rig import JOINT_NAMES, ClipInfo, J
from wayfarer_lab.training.mocap.shape import RetargetShape
from wayfarer_lab.training.mocap.skeleton import Array

# Accepted deviation of a joint from its target, metres. Spine joints and head have no target:
# their places do not compare between skeletons.
PLACE = {"ankle": 0.012, "foot": 0.03, "knee": 0.02, "hip": 0.02, "elbow": 0.025, "wrist": 0.02}
PLACE |= {"shoulder": 0.04}
# Accepted correction of a joint's rotation, degrees.
TURN = {"pelvis": 4.0, "spine": 3.0, "neck": 4.0, "head": 4.0, "collar": 6.0, "ankle": 10.0}
TURN |= {"foot": 12.0, "wrist": 12.0, "hip": 20.0, "knee": 20.0, "shoulder": 20.0, "elbow": 20.0}
SCALES = (1, 5, 17, 65)
"""Frames over which parts of a correction are averaged. The terms couple neighbouring frames, so
slow corrections are found 3 times sooner as separate variables."""
SOLE_THICKNESS = 0.015  # metres: skin lower than this in the T-pose is sole


@dataclass(frozen=True)
class FitOptions:
    """Weights of the terms, in units of accepted deviations, and the optimiser's budget."""

    steps: int = 90
    rate: float = 0.003  # radians per step; the hips move at half of it, in metres
    turn_speed: float = 1.5  # rad/s: accepted change of a correction over time
    acceleration: float = 5.0  # m/s²: accepted difference from the recording's
    sink: float = 0.003  # metres under the floor
    contact_height: float = 0.006  # metres
    slide: float = 0.03  # m/s
    device: str = "cpu"


@dataclass(frozen=True)
class FittedClip:
    """A clip on our body: the solution of a `FitProblem`."""

    info: ClipInfo
    shape: RetargetShape
    translation: Array  # [N, 3] hips, float32
    rotations: Array  # [N, 22, 4] quaternions x, y, z, w, float32
    touch: Array  # [N, 2, 2] bool: left, right foot × heel, ball
    use: Array  # [N] uint8, selection.Use
    joint_error: Array  # [N, 22] metres from the targets; NaN where there is none

    def __len__(self) -> int:
        return len(self.translation)


def _part(name: str) -> str:
    return name.split("_")[-1].rstrip("123")


def sole_points(body: BodyModel) -> tuple[Array, Array]:
    """Mesh vertices under the feet [S], and for each its place in the flattened contacts.

    Per foot: rear and both sides of the heel, both sides of the ball, tip of the toes. They
    bound the sole, which the few sole *markers* do not: toes and heel could sink unseen.
    """
    rest = body.rest_joints(np.zeros(body.betas))
    identity = np.broadcast_to(np.eye(3), (len(body.parents), 3, 3))
    mesh = body.skin(np.zeros(body.betas), identity, rest)
    low = mesh[:, 2] < SOLE_THICKNESS
    vertices, parts = [], []
    for foot, side in enumerate(("left", "right")):
        own = low & ((mesh[:, 0] > 0) == bool(foot))  # the body's right side is +X
        ball = rest[J[f"{side}_foot"], 1]
        heel = np.flatnonzero(own & (mesh[:, 1] < rest[J[f"{side}_ankle"], 1]))
        front = np.flatnonzero(own & (mesh[:, 1] > ball))
        across = np.flatnonzero(own & (np.abs(mesh[:, 1] - ball) < 0.015))
        for part, group, axes in ((0, heel, (-2, 1, -1)), (1, across, (1, -1)), (1, front, (2,))):
            for axis in axes:  # sign: which end of the axis x (1) or y (2)
                extreme = np.argmax(np.sign(axis) * mesh[group, abs(axis) - 1])
                vertices.append(int(group[extreme]))
                parts.append(2 * foot + part)
    return np.array(vertices), np.array(parts)


class Fitter:
    """Fits clips to one gender's body. Tensors have frames last: [..., N]."""

    def __init__(self, body: BodyModel, options: FitOptions = FitOptions()) -> None:
        self.options = options
        points, self.parts = sole_points(body)
        self.kinematics = FrameKinematics(body, points, options.device)
        self.body = body
        place = [PLACE.get(_part(n), 0.0) for n in JOINT_NAMES]
        self.targeted = np.array([p > 0 for p in place])
        per_joint = np.array([1 / p if p else 0.0 for p in place])
        self.place = self._tensor(per_joint)[:, None, None]
        turn = np.array([1 / np.deg2rad(TURN[_part(n)]) for n in JOINT_NAMES])
        self.turn = self._tensor(turn)[:, None, None]

    def _tensor(self, array: Array) -> Tensor:
        return torch.as_tensor(np.ascontiguousarray(array), dtype=torch.float32).to(
            self.options.device
        )

    def fit(self, problems: list[FitProblem], refine: bool = True) -> list[FittedClip]:
        """Fits all clips in one batch. `refine` False returns the copied rotations as they are."""
        batch = self._batch(problems)
        turn, shift = torch.zeros_like(batch.targets), torch.zeros_like(batch.start)
        if refine:
            turn, shift = self._descend(batch)
        with torch.no_grad():
            final, places, _ = self._pose(batch, turn, shift)
            error = torch.linalg.norm(places - batch.targets, dim=1).T.cpu().numpy()
            error[:, ~self.targeted] = np.nan
            final = final / final.norm(dim=1, keepdim=True)
            final = torch.where(final[:, 3:] < 0, -final, final)
            rotations = final.permute(2, 0, 1).contiguous().cpu().numpy()
            translation = (batch.start + shift).T.contiguous().cpu().numpy()
        edges = np.cumsum([0, *(len(p) for p in problems)])
        return [
            FittedClip(
                p.info, p.shape, translation[a:b], rotations[a:b], p.touch, p.use, error[a:b]
            )
            for p, (a, b) in zip(problems, itertools.pairwise(edges), strict=True)
        ]

    def _pose(self, batch: "_Batch", turn: Tensor, shift: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Local rotations [22, 4, N], joint places [22, 3, N] and sole points [S, 3, N]."""
        local = multiply(batch.local, from_rotvec(turn))
        places, soles = self.kinematics(batch.start + shift, local, batch.offsets, batch.seen)
        return local, places, soles

    def _batch(self, problems: list[FitProblem]) -> "_Batch":
        lengths = [len(p) for p in problems]
        shapes = [self.kinematics.shape(p.shape.betas) for p in problems]
        pairs, triples = _inside(lengths)
        local = matrix_quaternions(np.concatenate([p.local for p in problems]))
        touching = np.concatenate([p.touch.reshape(len(p), 4) for p in problems])
        heights = np.array([self._rest_height(p) for p in problems])
        return _Batch(
            start=self._tensor(np.concatenate([p.translation for p in problems]).T),
            local=self._tensor(local.transpose(1, 2, 0)),
            targets=self._tensor(np.concatenate([p.targets for p in problems]).transpose(1, 2, 0)),
            offsets=self._tensor(_per_frame([offsets for offsets, _ in shapes], lengths)),
            seen=self._tensor(_per_frame([seen for _, seen in shapes], lengths)),
            touch=self._tensor(touching[:, self.parts].T),
            rest_height=self._tensor(np.repeat(heights, lengths, axis=0).T),
            pairs=self._tensor(pairs),
            triples=self._tensor(triples),
        )

    def _rest_height(self, problem: FitProblem) -> Array:
        """Height of each sole point in the T-pose [S]: where it is when standing."""
        rest = self.body.rest_joints(problem.shape.betas)
        identity = np.broadcast_to(np.eye(3), (len(rest), 3, 3))
        points = self.kinematics.points
        return self.body.skin(problem.shape.betas, identity, rest, points)[:, 2]

    def _descend(self, batch: "_Batch") -> tuple[Tensor, Tensor]:
        """Corrections of rotations [22, 3, N] and of the hips' place [3, N]."""
        o = self.options
        shape = (*batch.targets.shape[:2], len(SCALES), batch.targets.shape[-1])
        turns = torch.zeros(shape, device=o.device, requires_grad=True)
        shifts = torch.zeros(shape[1:], device=o.device, requires_grad=True)
        groups = [{"params": [turns], "lr": o.rate}, {"params": [shifts], "lr": o.rate / 2}]
        adam = torch.optim.Adam(groups, betas=(0.9, 0.95))
        decay = torch.optim.lr_scheduler.CosineAnnealingLR(adam, o.steps)
        for _ in range(o.steps):
            adam.zero_grad(set_to_none=True)
            turn, shift = _at_all_scales(turns), _at_all_scales(shifts)
            _, places, soles = self._pose(batch, turn, shift)
            loss = self._pose_terms(batch, turn, places) + self._floor_terms(batch, soles)
            (loss / turn.shape[-1]).backward()
            adam.step()
            decay.step()
        with torch.no_grad():
            return _at_all_scales(turns), _at_all_scales(shifts)

    def _pose_terms(self, batch: "_Batch", turn: Tensor, places: Tensor) -> Tensor:
        """Joint places, size and change of corrections, joint acceleration."""
        o = self.options
        miss = places - batch.targets
        place = (miss * self.place).square().sum()
        size = (turn * self.turn).square().sum()
        change = (turn[..., 1:] - turn[..., :-1]) * batch.pairs * (FPS / o.turn_speed)
        jerk = (miss[..., 2:] - 2 * miss[..., 1:-1] + miss[..., :-2]) * batch.triples
        jerk = jerk * (self.place > 0) * (FPS**2 / o.acceleration)
        return place + size + change.square().sum() + jerk.square().sum()

    def _floor_terms(self, batch: "_Batch", soles: Tensor) -> Tensor:
        """Nothing under the floor; touching parts at their standing height, not sliding."""
        o = self.options
        height = soles[:, 2]
        sunk = torch.relu(batch.rest_height.amin(0) - height) / o.sink
        lifted = (height - batch.rest_height) * batch.touch / o.contact_height
        moved = (soles[:, :2, 1:] - soles[:, :2, :-1]).square().sum(1)
        both = batch.touch[:, 1:] * batch.touch[:, :-1] * batch.pairs
        slid = (moved * both).sum() * (FPS / o.slide) ** 2
        return sunk.square().sum() + lifted.square().sum() + slid


@dataclass(frozen=True)
class _Batch:
    """All frames of the clips of one batch. N frames, S sole points."""

    start: Tensor  # [3, N]
    local: Tensor  # [22, 4, N] quaternions
    targets: Tensor  # [22, 3, N]
    offsets: Tensor  # [22, 3, N], see FrameKinematics
    seen: Tensor  # [K, 3, N]
    touch: Tensor  # [S, N] the part of the foot that the point belongs to touches the floor
    rest_height: Tensor  # [S, N]
    pairs: Tensor  # [N-1] frames i and i+1 are of one clip
    triples: Tensor  # [N-2]


def _at_all_scales(values: Tensor) -> Tensor:
    """Sum over scales of moving averages: [..., scales, N] → [..., N]."""
    flat = values.reshape(-1, *values.shape[-2:])
    total = flat[:, 0]
    for k, width in enumerate(SCALES[1:], start=1):
        pooled = avg_pool1d(flat[:, k], width, 1, width // 2, count_include_pad=False)
        total = total + pooled
    return total.reshape(*values.shape[:-2], values.shape[-1])


def matrix_quaternions(matrices: Array) -> Array:
    """Rotation matrices [..., 3, 3] as quaternions x, y, z, w [..., 4]."""
    flat = Rotation.from_matrix(matrices.reshape(-1, 3, 3)).as_quat()
    return flat.reshape(*matrices.shape[:-2], 4)


def _per_frame(values: list[Array], lengths: list[int]) -> Array:
    """Values [K, 3] of each clip, repeated for its frames: [K, 3, N]."""
    return np.repeat(np.stack(values, -1), lengths, axis=-1)


def _inside(lengths: list[int]) -> tuple[Array, Array]:
    """Masks of frame pairs [N-1] and triples [N-2] that lie within one clip."""
    owner = np.repeat(np.arange(len(lengths)), lengths)
    pair = owner[1:] == owner[:-1]
    return pair, pair[1:] & pair[:-1]
