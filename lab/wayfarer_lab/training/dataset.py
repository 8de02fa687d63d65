"""Prepared motion as tensors: frames in the world, windows in their canonical frame.

The predictor learns from windows of markers; the regressor from single poses, which can be
re-skinned with any body shape.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from wayfarer.body.library import SHIPPED
from wayfarer.engines.torch.marker_bodies import load_marker_bodies
from wayfarer.errors import InvalidArgument
from wayfarer.motion.frame import Frame, canonical_frame
from wayfarer.motion.marker_body import MarkerBody
from wayfarer.spec import BETAS, FPS, GENDERS
from wayfarer_lab.training.mocap.selection import Use
from wayfarer_lab.training.mocap.standing import CROUCHED, knee_bend
from wayfarer_lab.training.mocap.store import Dataset, mirror
from wayfarer_lab.training.rotation import matrix_from_quaternion

Part = TypeVar("Part")


@dataclass(frozen=True)
class Poses:
    """All poses of one split, end to end. Clip edges are respected by `starts`."""

    hips: Tensor  # [N, 3] world
    rotations: Tensor  # [N, 22, 4] local quaternions, joint 0 world
    run: Tensor  # [N] frames left in the unbroken stretch that begins here, itself included
    weight: Tensor  # [N] how often a window should start here, relative

    def starts(self, length: int) -> tuple[Tensor, Tensor]:
        """Frames where a window of `length` may start, and their weights."""
        index = torch.nonzero((self.run >= length) & (self.weight > 0)).squeeze(-1)
        if len(index) == 0:
            raise InvalidArgument(f"the data hold no unbroken stretch of {length} frames")
        return index, self.weight[index]


@dataclass(frozen=True)
class Frames(Poses):
    """Poses with the markers of the bodies that took them."""

    markers: Tensor  # [N, 67, 3] world
    hips_rotation: Tensor  # [N, 3, 3]
    betas: Tensor  # [N, 10]
    gender: Tensor  # [N] index in `GENDERS`
    acted: Tensor  # [N] whether the person acts a style

    def world(self, starts: Tensor, length: int) -> Tensor:
        """Windows in the world [B, length, 67, 3]."""
        return self.markers[starts[:, None] + torch.arange(length)]

    def frame(self, at: Tensor, floor_origin: bool) -> Frame:
        """Canonical frames of primitives that begin at frames `at` [B]."""
        return canonical_frame(self.hips[at], self.hips_rotation[at], floor_origin)


class WindowSampler:
    """Draws start frames with replacement, in proportion to their weight."""

    def __init__(self, frames: Poses, length: int) -> None:
        self.index, weight = frames.starts(length)
        self._upto = torch.cumsum(weight.double(), 0)

    def draw(self, count: int, generator: torch.Generator | None = None) -> Tensor:
        """`count` start frames."""
        u = torch.rand(count, dtype=torch.float64, generator=generator) * self._upto[-1]
        return self.index[torch.searchsorted(self._upto, u).clamp(max=len(self.index) - 1)]


class PairedSampler:
    """Draws start frames of both genders, half of each: the first half of the rows is male.

    So the rows of a gender are a slice, whose length does not depend on what was drawn: that is
    cheaper than picking rows, and can be recorded in a CUDA graph.
    """

    def __init__(self, frames: Frames, length: int) -> None:
        """Raises InvalidArgument where a gender has no stretch of `length` frames."""
        self.samplers = [
            WindowSampler(replace(frames, weight=frames.weight * (frames.gender == g)), length)
            for g in range(len(GENDERS))
        ]

    def draw(self, count: int) -> Tensor:
        """`count` start frames; an even number."""
        each = count // len(self.samplers)
        return torch.cat([sampler.draw(each) for sampler in self.samplers])


def in_halves(
    parts: Sequence[Part], do: Callable[[Part, slice], Sequence[Tensor]], count: int
) -> tuple[Tensor, ...]:
    """What `do(part, rows)` gives for the slices of `count` rows that a `PairedSampler` drew."""
    each = count // len(parts)
    made = [do(part, slice(i * each, (i + 1) * each)) for i, part in enumerate(parts)]
    return tuple(torch.cat(column) for column in zip(*made, strict=True))


def by_gender(
    gender: Tensor, parts: Sequence[Part], do: Callable[[Part, Tensor], Sequence[Tensor]]
) -> tuple[Tensor, ...]:
    """What `do(part, rows)` gives for the rows of each gender, in the order of all rows.

    `gender` [B] are indices of `parts`; results have a first axis of as many rows.
    """
    made, order = [], []
    for number, part in enumerate(parts):
        rows = torch.nonzero(gender == number).squeeze(-1)
        if len(rows):
            made.append(do(part, rows))
            order.append(rows)
    back = torch.cat(order).argsort()
    return tuple(torch.cat(column)[back] for column in zip(*made, strict=True))


def skin_frames(
    hips: Tensor, rotations: Tensor, betas: Tensor, gender: Tensor, bodies: dict[str, MarkerBody]
) -> Tensor:
    """Markers [N, 67, 3] of frames whose body differs: gender [N] indexes `GENDERS`."""
    markers = torch.empty(len(hips), 67, 3)
    with torch.no_grad():
        for g, name in enumerate(GENDERS):
            for rows in torch.nonzero(gender == g).flatten().split(4096):
                if not len(rows):
                    continue
                local = matrix_from_quaternion(rotations[rows])
                markers[rows], _ = bodies[name](hips[rows], local, betas[rows])
    return markers


def random_betas(count: int) -> Tensor:
    """Shapes drawn from the (unit variance) shape space, within 2.5 standard deviations."""
    return torch.randn(count, BETAS).clamp(-2.5, 2.5)


def load_frames(folder: Path, split: str, mix: Mapping[str, float]) -> Frames:
    """`load_poses` with markers, which takes a minute or two for the shipped data."""
    poses, betas, gender, acted = _read(folder, split, mix)
    bodies = load_marker_bodies(SHIPPED)
    return Frames(
        hips=poses.hips,
        rotations=poses.rotations,
        run=poses.run,
        weight=poses.weight,
        markers=skin_frames(poses.hips, poses.rotations, betas, gender, bodies),
        hips_rotation=matrix_from_quaternion(poses.rotations[:, 0]),
        betas=betas,
        gender=gender,
        acted=acted,
    )


def load_poses(folder: Path, split: str, mix: Mapping[str, float]) -> Poses:
    """One split of a prepared folder, with its mirror image, as tensors.

    `mix` gives each group's share of the draws (`group_of`); within a group a subject's frames
    weigh less the more there are of them (square root), so that no person's gait dominates.
    Raises DataError when the folder is not prepared, InvalidArgument when the split is empty.
    """
    return _read(folder, split, mix)[0]


def _read(
    folder: Path, split: str, mix: Mapping[str, float]
) -> tuple[Poses, Tensor, Tensor, Tensor]:
    """Poses, and of each the betas [N, 10] and gender [N] of the body, and if it acts a style."""
    data = Dataset.load(folder)
    chosen = [c for c in data.clips if c.split == split]
    if not chosen:
        raise InvalidArgument(f"{folder} holds no clip of split {split!r}", "split")
    rows = np.concatenate([np.arange(c.start, c.stop) for c in chosen])
    owner = np.repeat(np.arange(len(chosen)), [c.stop - c.start for c in chosen])
    use = data.use[rows]
    run = unbroken(use > 0, owner)
    done = np.concatenate(
        [
            label_motion(data.translation[c.start : c.stop], data.rotations[c.start : c.stop, 0])
            for c in chosen
        ]
    )
    acted = np.array([c.acted for c in chosen])[owner]
    crouched = knee_bend(data.rotations[rows]) > CROUCHED
    groups = [group_of(*frame) for frame in zip(use, done, acted, crouched, strict=True)]
    weight = draw_weights(groups, [chosen[o].subject for o in owner], mix)
    hips, rotations = data.translation[rows], data.rotations[rows]
    image = mirror(hips, rotations, data.contacts[rows])
    hips, rotations = np.concatenate([hips, image[0]]), np.concatenate([rotations, image[1]])
    owner, run, weight = np.tile(owner, 2), np.tile(run, 2), np.tile(weight, 2)
    poses = Poses(
        hips=torch.from_numpy(hips),
        rotations=torch.from_numpy(rotations),
        run=torch.from_numpy(run),
        weight=torch.from_numpy(weight).float(),
    )
    betas = torch.tensor([c.betas for c in chosen], dtype=torch.float32)[owner]
    gender = torch.tensor([GENDERS.index(c.gender) for c in chosen])[owner]
    return poses, betas, gender, torch.from_numpy(np.tile(acted, 2))


GROUPS = ("walk", "run", "sideways", "backward", "start_stop", "turn", "standing", "other")
"""Kinds of frames that a training's `mix` gives shares to."""

SCARCE = ("sideways", "backward", "turn")
"""Groups of which recordings without acting are too few."""

STILL = 0.2
"""m/s: hips slower than this stand, or turn on the spot."""

RUNNING = 2.0
"""m/s: hips faster than this run."""

TURNING = 0.6
"""rad/s on the spot that count as a turn."""

SIDE, BACK = np.deg2rad(50.0), np.deg2rad(130.0)
"""Angle from the way that the hips face to the way that they go: ahead, sideways, backward."""

EDGE = round(0.5 * FPS)
"""Frames on both sides of setting off and of coming to a stand that are a start or a stop."""


def label_motion(hips: NDArray[np.floating], facing: NDArray[np.floating]) -> NDArray[np.str_]:
    """The activity in each frame, one of `GROUPS`; hips [N, 3], their rotations [N, 4], world.

    By the motion itself (over half a second), whatever a file is called: takes of sideways walking
    begin and end with forward walks, and hold stops and turns.
    """
    if len(hips) < 3:
        return np.full(len(hips), "walk", dtype="<U10")
    forward = matrix_from_quaternion(torch.from_numpy(np.asarray(facing, np.float32))).numpy()
    forward = forward[:, :2, 1]
    heading = np.unwrap(np.arctan2(-forward[:, 0], forward[:, 1]))
    velocity = np.stack([_smooth(np.gradient(hips[:, k]) * FPS) for k in range(2)], -1)
    speed = np.linalg.norm(velocity, axis=-1)
    ahead = (velocity * forward).sum(-1)
    across = velocity[:, 0] * forward[:, 1] - velocity[:, 1] * forward[:, 0]
    angle = np.abs(np.arctan2(across, ahead))
    found = np.full(len(hips), "walk", dtype="<U10")
    found[speed > RUNNING] = "run"
    found[angle > SIDE] = "sideways"
    found[angle > BACK] = "backward"
    still = speed < STILL
    found[still] = "standing"
    changes = np.flatnonzero(still[1:] != still[:-1])
    for frame in changes:
        found[max(0, frame - EDGE) : frame + EDGE] = "start_stop"
    found[still & (np.abs(_smooth(np.gradient(heading) * FPS)) > TURNING)] = "turn"
    return found


def _smooth(values: NDArray[np.floating], seconds: float = 0.5) -> NDArray[np.floating]:
    """Moving average over time, edges held."""
    half = min(round(seconds * FPS / 2), len(values) - 1)
    padded = np.pad(values, half, mode="edge")
    return np.convolve(padded, np.ones(2 * half + 1) / (2 * half + 1), "valid")


def group_of(use: int, done: str, acted: bool, crouched: bool) -> str:
    """The group of `GROUPS` that a frame teaches, or ""; `done` is from `label_motion`.

    Acted styles teach only what is `SCARCE`, and crouched frames teach nobody to stand.
    """
    if use == Use.EXCLUDED:
        return ""
    if use == Use.STANDING:
        done = "standing"
    unnatural = (acted and done not in SCARCE) or (crouched and done == "standing")
    return "other" if use == Use.OTHER or unnatural else done


def draw_weights(
    groups: Sequence[str], subjects: Sequence[str], mix: Mapping[str, float]
) -> NDArray[np.float64]:
    """Weight per frame so that groups are drawn by `mix` and subjects by the root of their size.

    Raises InvalidArgument when `mix` names a group that does not exist.
    """
    unknown = sorted(set(mix) - set(GROUPS))
    if unknown:
        raise InvalidArgument(f"unknown groups {unknown}; allowed: {list(GROUPS)}", "mix")
    names, group = np.unique(np.asarray(groups), return_inverse=True)
    _, subject = np.unique(np.asarray(subjects), return_inverse=True)
    pair = group * (subject.max() + 1) + subject
    weight = 1 / np.sqrt(np.bincount(pair)[pair])
    total = np.bincount(group, weights=weight)
    share = np.array([mix.get(str(n), 0.0) for n in names])
    return weight * (share / total)[group]


def unbroken(good: NDArray[np.bool_], owner: NDArray[np.int64]) -> NDArray[np.int64]:
    """For each frame, how many frames from it on are good and of the same clip."""
    run = np.zeros(len(good), np.int64)
    count = 0
    for i in range(len(good) - 1, -1, -1):
        same = i + 1 < len(good) and owner[i + 1] == owner[i]
        count = (count if same else 0) + 1 if good[i] else 0
        run[i] = count
    return run
