"""Direct representations (Sec. A.4): open rollouts without a regressor, and pictures of the worst.

The network's own numbers go from primitive to primitive; nothing is blended, joined or set on the
floor.
"""

from collections.abc import Mapping, Sequence
from typing import Any, Final, TypedDict

import numpy as np
import torch
from numpy.typing import NDArray
from PIL import Image, ImageDraw
from torch import Tensor

from wayfarer.body.library import load_body
from wayfarer.clips.clip import Clip
from wayfarer.motion.frame import canonical_frame, to_local, to_world
from wayfarer.motion.quality import Sites
from wayfarer.spec import GENDERS, LATENT
from wayfarer_lab.evaluation.model_parts import Direct
from wayfarer_lab.evaluation.pictures.framing import FLOATING, close_up
from wayfarer_lab.evaluation.pictures.paper import FONT, INK, PAPER
from wayfarer_lab.evaluation.pictures.scene import ClipActor, picture
from wayfarer_lab.evaluation.realism import PoseScore
from wayfarer_lab.evaluation.rollout import FrozenPoses, Rollout, frozen
from wayfarer_lab.training.representation import Whose
from wayfarer_lab.training.rotation import matrix_from_quaternion, quaternion_from_matrix

Array = NDArray[np.floating[Any]]

CELL: Final = (110, 170)
"""Pixels of a body in a picture of failures."""

CAPTION: Final = 20
"""Pixels of the text above a row."""


@torch.no_grad()
def roll_out_direct(
    model: Direct, poses: FrozenPoses, frames: int, random: torch.Generator
) -> Rollout:
    """As `rollout.roll_out`: the primitive with which bodies set off is not measured."""
    gender, kind, keep = GENDERS.index(poses.gender), model.kind, model.predictor.seed_frames
    count, every = len(poses.betas), model.predictor.new_frames
    whose = Whose(poses.betas, torch.full((count,), gender))
    names = load_body("anny52", poses.gender, "low").marker_names
    still = frozen(kind.bodies[gender], Sites.from_names(names), poses)
    turns = matrix_from_quaternion(still.rotations)
    frame = canonical_frame(still.translation[:, 0], turns[:, 0, 0], model.floor_origin)
    local = _with_root(frame.rotation.transpose(-1, -2), turns)
    hips = to_local(frame, still.translation)
    seed = kind.features(hips.expand(-1, 2, -1), local.expand(-1, 2, -1, -1, -1), whose)[:, :keep]
    made: list[tuple[Tensor, ...]] = []
    for _ in range(1 + -(-frames // every)):
        latent = torch.randn(count, 1, LATENT, generator=random)
        future = model.predictor.decode(seed, latent)[:, 0]
        hips, local = kind.pose(future)
        markers, _ = kind.skin(hips, local, whose)
        markers = to_world(frame, markers.flatten(1, 2)).reshape(markers.shape)
        hips, turns = to_world(frame, hips), _with_root(frame.rotation, local)
        made.append((markers, hips, quaternion_from_matrix(turns), markers[:, None, -keep:]))
        after = canonical_frame(hips[:, -keep], turns[:, -keep, 0], model.floor_origin)
        seed, frame = kind.moved(future[:, -keep:], frame, after), after
    skins, places, rotations, carried = (
        torch.cat(column, 1).numpy() for column in zip(*made[1:], strict=True)
    )
    return Rollout(skins, places, rotations, carried, every)


def _with_root(turn: Tensor, rotations: Tensor) -> Tensor:
    """Rotations [A, F, 22, 3, 3], the root's turned by [A, 3, 3]."""
    root = turn[:, None] @ rotations[:, :, 0]
    return torch.cat([root[:, :, None], rotations[:, :, 1:]], 2)


class ShownPose(TypedDict):
    """A body in one frame; numbers are rounded for a file."""

    gender: str
    betas: list[float]
    hips: list[float]
    rotations: list[list[float]]  # [22][4]
    usual: float  # to the pose prior, 0…1


def least_usual(
    made: Sequence[tuple[FrozenPoses, Rollout]], score: PoseScore, count: int
) -> list[ShownPose]:
    """The `count` least usual poses, at most one of each motion.

    `made` are rollouts of both genders and what they began with.
    """
    found: list[ShownPose] = []
    for poses, rollout in made:
        for row in range(len(rollout.hips)):
            if not np.isfinite(rollout.markers[row]).all():
                continue
            usual = score(rollout.rotations[row])
            frame = int(usual.argmin())
            found.append(
                ShownPose(
                    gender=poses.gender,
                    betas=np.round(poses.betas[row].numpy(), 3).tolist(),
                    hips=np.round(rollout.hips[row, frame], 3).tolist(),
                    rotations=np.round(rollout.rotations[row, frame], 3).tolist(),
                    usual=round(float(usual[frame]), 3),
                )
            )
    return sorted(found, key=lambda pose: pose["usual"])[:count]


def draw_poses(rows: Mapping[str, Sequence[ShownPose]]) -> Image.Image:
    """Fig. S3, right: a row for each way to make motion, by name."""
    columns = max(map(len, rows.values()))
    sheet = Image.new("RGB", (columns * CELL[0], len(rows) * (CAPTION + CELL[1])), PAPER)
    draw = ImageDraw.Draw(sheet)
    for line, (name, poses) in enumerate(rows.items()):
        top = line * (CAPTION + CELL[1])
        draw.text((4, top + 3), name, INK, FONT)
        for column, pose in enumerate(poses):
            turns = np.array([pose["rotations"]], np.float32)
            turns /= np.linalg.norm(turns, axis=-1, keepdims=True)
            clip = Clip(
                np.array([pose["hips"]], np.float32),
                turns,
                np.zeros((1, 2), bool),
                pose["gender"],
                tuple(pose["betas"]),
            )
            actor = ClipActor.of(clip, load_body("anny52", clip.gender, "low"), "sides")
            cell = picture(close_up(actor, 0, "quarter", CELL), [(actor, 0)])
            sheet.paste(cell, (column * CELL[0], top + CAPTION))
            if pose["hips"][2] > FLOATING:
                corner = (column * CELL[0] + 4, top + CAPTION + CELL[1] - 16)
                draw.text(corner, f"hips at {pose['hips'][2]:.1f} m", INK, FONT)
    return sheet
