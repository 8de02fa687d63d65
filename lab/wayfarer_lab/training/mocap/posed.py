"""A fitted clip as joint places and world rotations: what augmentations bend, then fit again."""

from dataclasses import dataclass, replace

import numpy as np

from wayfarer.body.model import BodyModel
from wayfarer.body.rotation import matrix_from_quaternion
from wayfarer.spec import FPS, POSED_JOINTS
from wayfarer_lab.training.mocap.fit import FittedClip
from wayfarer_lab.training.mocap.resample import nearest_rotations, slerp
from wayfarer_lab.training.mocap.retarget import FitProblem
from wayfarer_lab.training.mocap.rig import PARENTS, ClipInfo, J
from wayfarer_lab.training.mocap.shape import RetargetShape
from wayfarer_lab.training.mocap.skeleton import Array

HIPS = [J["left_hip"], J["right_hip"]]
LEGS = [[J[f"{side}_{part}"] for part in ("knee", "ankle", "foot")] for side in ("left", "right")]


@dataclass(frozen=True)
class PosedMotion:
    """Motion of one body: N frames, world frame, metres."""

    info: ClipInfo
    shape: RetargetShape
    places: Array  # [N, 22, 3]
    world: Array  # [N, 22, 3, 3]
    touch: Array  # [N, 2, 2] bool: left, right foot × heel, ball
    use: Array  # [N] uint8

    def __len__(self) -> int:
        return len(self.places)

    def frames(self, index: Array | slice) -> "PosedMotion":
        """Only some frames."""
        return replace(
            self,
            places=self.places[index],
            world=self.world[index],
            touch=self.touch[index],
            use=self.use[index],
        )

    def tagged(self, augmentation: str, suffix: str = "") -> "PosedMotion":
        """The same motion under a new name, marked as augmented; tags add up."""
        tags = "+".join(t for t in (self.info.augmentation, augmentation) if t)
        name = f"{self.info.name}~{suffix or augmentation}"
        return replace(self, info=replace(self.info, name=name, augmentation=tags))

    def heading(self) -> Array:
        """Heading [N] of the hips in radians, unwrapped; 0 faces +Y."""
        forward = self.world[:, 0, :2, 1]
        return np.unwrap(np.arctan2(-forward[:, 0], forward[:, 1]))

    def turned(self, angle: float, pivot: Array, to: Array) -> "PosedMotion":
        """Rotated about the vertical through `pivot` [2], which moves to `to` [2]."""
        spin = yaw_matrix(np.array(angle))
        shift = np.array([*to, 0.0]) - spin @ np.array([*pivot, 0.0])
        return replace(self, places=self.places @ spin.T + shift, world=spin @ self.world)

    def problem(self) -> FitProblem:
        """The fit that makes this motion one of the body, with its contacts kept."""
        local = self.world.copy()
        local[:, 1:] = np.swapaxes(self.world[:, PARENTS[1:]], -1, -2) @ self.world[:, 1:]
        return FitProblem(
            self.info, self.shape, self.places[:, 0], local, self.places, self.touch, self.use
        )


def pose(clip: FittedClip, body: BodyModel) -> PosedMotion:
    """Joint places and world rotations of a fitted clip."""
    local = matrix_from_quaternion(clip.rotations.astype(np.float64))
    return pose_local(clip.info, clip.shape, clip.translation, local, clip.touch, clip.use, body)


def pose_local(
    info: ClipInfo,
    shape: RetargetShape,
    translation: Array,
    local: Array,
    touch: Array,
    use: Array,
    body: BodyModel,
) -> PosedMotion:
    """The same from local rotations [N, 22, 3, 3]."""
    rest = body.rest_joints(shape.betas)
    world, places = body.forward_kinematics(translation.astype(np.float64), local, rest)
    return PosedMotion(info, shape, places[:, :POSED_JOINTS], world[:, :POSED_JOINTS], touch, use)


def yaw_matrix(angle: Array) -> Array:
    """Rotations [..., 3, 3] about the vertical."""
    turn = np.zeros((*angle.shape, 3, 3))
    turn[..., 0, 0] = turn[..., 1, 1] = np.cos(angle)
    turn[..., 1, 0] = np.sin(angle)
    turn[..., 0, 1] = -turn[..., 1, 0]
    turn[..., 2, 2] = 1
    return turn


def smoothstep(x: Array) -> Array:
    """0 before 0, 1 after 1, smooth between (zero acceleration at both ends)."""
    x = np.clip(x, 0.0, 1.0)
    return x * x * x * (x * (6 * x - 15) + 10)


def at_times(motion: PosedMotion, times: Array) -> PosedMotion:
    """The motion at fractional frames [K]; contacts and use from the nearest frame."""
    times = np.clip(times, 0, len(motion) - 1)
    first = np.minimum(times.astype(int), len(motion) - 2)
    part = (times - first)[:, None]
    a, b = motion.frames(first), motion.frames(first + 1)
    nearest = motion.frames(np.rint(times).astype(int))
    return replace(
        nearest,
        places=a.places + (b.places - a.places) * part[..., None],
        world=slerp(a.world, b.world, part),
    )


def blend(a: PosedMotion, b: PosedMotion, weight: Array) -> PosedMotion:
    """Motion a where weight [N] is 0, b where it is 1; contacts and use of the nearer one."""
    w = weight[:, None]
    far = weight > 0.5
    return replace(
        b,
        places=a.places + (b.places - a.places) * w[..., None],
        world=slerp(a.world, b.world, w),
        touch=np.where(far[:, None, None], b.touch, a.touch),
        use=np.where(far, b.use, a.use),
    )


def join(parts: list[PosedMotion]) -> PosedMotion:
    """One after the other; info and shape of the first."""
    return replace(
        parts[0],
        places=np.concatenate([p.places for p in parts]),
        world=np.concatenate([p.world for p in parts]),
        touch=np.concatenate([p.touch for p in parts]),
        use=np.concatenate([p.use for p in parts]),
    )


def stances(touch: Array) -> list[tuple[int, int]]:
    """Ranges of frames in which a foot [N, 2] (heel, ball) touches the floor."""
    flags = np.concatenate([[False], touch.any(-1), [False]]).astype(int)
    edges = np.flatnonzero(np.diff(flags))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def hips_speed(motion: PosedMotion) -> Array:
    """Horizontal speed [N] of the hips, m/s, averaged over a quarter second."""
    middle = motion.places[:, HIPS, :2].mean(1)
    velocity = np.gradient(middle, axis=0) * FPS
    kernel = np.ones(9) / 9
    padded = np.pad(velocity, ((4, 4), (0, 0)), mode="edge")
    smooth = np.stack([np.convolve(padded[:, k], kernel, "valid") for k in range(2)], -1)
    return np.linalg.norm(smooth, axis=-1)


def average_pose(world: Array) -> Array:
    """Mean rotations [22, 3, 3] of some frames [K, 22, 3, 3]."""
    return nearest_rotations(world.mean(0))
