"""Known defects of recordings, found and mended or cut out at the file's own frame rate."""

from collections.abc import Iterable

import numpy as np

from wayfarer_lab.training.mocap.resample import nearest_rotations
from wayfarer_lab.training.mocap.skeleton import Array, MocapSkeleton, SkeletonMotion

SKIP_SECONDS = 10 / 120  # the solver settles in the first frames of a CMU clip
GUARD_SECONDS = 6 / 120  # cut on both sides of a glitch
MAX_SPIKE = np.deg2rad(15)
MAX_ROOT_SPEED = 9.0  # m/s
MAX_JOINT_SPEED = 18.0  # m/s, relative to the root


def mend_cmu_bvh(skeleton: MocapSkeleton, asf: MocapSkeleton | None = None) -> MocapSkeleton:
    """Gives back the two bones that CMU's BVH conversion lost, if this skeleton lacks them.

    The conversion wrote a zero OFFSET for Neck and the shoulders (the thorax bone, 12 cm) and
    for the finger bases and thumbs (the wrist bone, 10 cm). With the subject's ASF the lengths
    are exact; otherwise the thorax is taken as long as Spine1, the wrist as half the forearm.
    """
    at = {n: i for i, n in enumerate(skeleton.names)}
    lost = ["Neck", "LeftShoulder", "RightShoulder"]
    hands = [f"{s}FingerBase" for s in ("Left", "Right")]
    if not all(n in at and not skeleton.offsets[at[n]].any() for n in lost + hands):
        return skeleton
    if asf is not None:
        bone = {n: i for i, n in enumerate(asf.names)}
        thorax = asf.offsets[bone["lowerneck"]]
        wrist = {s: asf.offsets[bone[f"{s[0].lower()}hand"]] for s in ("Left", "Right")}
    else:
        thorax = skeleton.offsets[at["Spine1"]]
        wrist = {s: 0.5 * skeleton.offsets[at[f"{s}Hand"]] for s in ("Left", "Right")}
    offsets = dict.fromkeys(lost, thorax)
    for side, offset in wrist.items():
        offsets[f"{side}FingerBase"] = offset
        if f"{side[0]}Thumb" in at:
            offsets[f"{side[0]}Thumb"] = offset
    return skeleton.with_offsets(offsets)


def drop_t_pose(motion: SkeletonMotion) -> SkeletonMotion:
    """Drops frame 0 when it is an added T-pose: all rotations zero there and not in frame 1."""
    if len(motion) < 2:
        return motion
    angles = np.rad2deg(_angle(motion.local[:2]))  # [2, J]
    return motion.cut(1) if angles[0].max() < 1.0 and angles[1].max() > 5.0 else motion


def missing_arm_frames(upper_arms: Array) -> int:
    """Leading frames in which an upper arm has no rotation at all [N, 2, 3, 3]: not tracked yet."""
    zero = np.any(_angle(upper_arms) < 1e-6, axis=-1)
    return len(zero) if zero.all() else int(np.argmin(zero))


def _angle(matrices: Array) -> Array:
    trace = np.trace(matrices, axis1=-2, axis2=-1)
    return np.arccos(np.clip((trace - 1) / 2, -1, 1))


def despike(rotations: Array) -> Array:
    """Rotations [N, 3, 3] with those frames replaced that leave their neighbours' mean.

    Optical hands and feet flip over for a frame or two, which no joint does. The mean is taken
    over two frames on either side, those far from it counting little (another spike must not
    pull it).
    """
    padded = np.concatenate([rotations[:1]] * 2 + [rotations] + [rotations[-1:]] * 2)
    around = np.stack([padded[k : k + len(rotations)] for k in (0, 1, 3, 4)])
    mean = nearest_rotations(around.mean(0))
    for _ in range(5):
        weight = 1 / (_angle(np.swapaxes(mean, -1, -2) @ around) + 0.02)
        mean = nearest_rotations((weight[..., None, None] * around).sum(0))
    spikes = _angle(np.swapaxes(mean, -1, -2) @ rotations) > MAX_SPIKE
    return np.where(spikes[:, None, None], mean, rotations)


def clean_pieces(
    places: Array, fps: float, start: int, listed: Iterable[int] = ()
) -> list[tuple[int, int]]:
    """Ranges of frames free of glitches, from `start` on.

    A frame is a glitch when the root (joint 0 of places [N, J, 3], metres) is faster than
    `MAX_ROOT_SPEED`, a joint is faster than `MAX_JOINT_SPEED` relative to it, or the index
    lists it.
    """
    good = np.ones(len(places), bool)
    good[: start + round(SKIP_SECONDS * fps)] = False
    root = np.linalg.norm(np.diff(places[:, 0], axis=0), axis=-1) * fps > MAX_ROOT_SPEED
    relative = places - places[:, :1]
    joint = np.linalg.norm(np.diff(relative, axis=0), axis=-1).max(-1) * fps > MAX_JOINT_SPEED
    bad = set(np.flatnonzero(root | joint).tolist()) | set(listed)
    guard = max(1, round(GUARD_SECONDS * fps))
    for frame in bad:
        good[max(0, frame - guard) : frame + guard + 2] = False
    edges = np.flatnonzero(np.diff(np.concatenate([[False], good, [False]]).astype(int)))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]
