"""A small prepared data folder: T-poses that glide straight ahead on the floor."""

from pathlib import Path

import numpy as np

from wayfarer.body.library import load_body
from wayfarer.spec import BETAS, FPS, GENDERS, POSED_JOINTS
from wayfarer_lab.training.mocap.selection import Use
from wayfarer_lab.training.mocap.store import ClipRange, Dataset

FRAMES = 100
SPEED = 1.2
KINDS = (*((gender, "") for gender in GENDERS), ("female", "faster"))


def hips_height(gender: str) -> float:
    """Hips' height of the mean body in its T-pose with its soles on the floor."""
    body = load_body("anny52", gender)
    places = body.rest_joints(np.zeros(BETAS))
    turns = np.tile(np.eye(3), (len(places), 1, 1))
    markers = body.markers(np.zeros(BETAS), turns, places)
    return float(places[0, 2] - markers[body.sole_markers, 2].min())


def write_recordings(folder: Path, *splits: str) -> Path:
    """Writes one clip of each gender in `heldout` (or in each of `splits`), and an augmented one
    that must not be used.
    """
    clips, translation, use = [], [], []
    time = np.arange(FRAMES) / FPS
    kinds = [(split, *kind) for split in splits or ("heldout",) for kind in KINDS]
    for number, (split, gender, augmentation) in enumerate(kinds):
        start = number * FRAMES
        clips.append(
            ClipRange(
                start, start + FRAMES, f"c{number}", f"c{number}", "07", split, "walk", True,
                gender, (0.0,) * BETAS, "own", augmentation,
            )
        )  # fmt: skip
        hips = np.zeros((FRAMES, 3))
        hips[:, 0], hips[:, 1], hips[:, 2] = number, SPEED * time, hips_height(gender)
        translation.append(hips)
        uses = np.full(FRAMES, Use.LOCOMOTION, np.uint8)
        uses[:5] = Use.EXCLUDED
        use.append(uses)
    frames = FRAMES * len(clips)
    Dataset(
        translation=np.concatenate(translation).astype(np.float32),
        rotations=np.tile(np.float32([0, 0, 0, 1]), (frames, POSED_JOINTS, 1)),
        contacts=np.ones((frames, 2), bool),
        use=np.concatenate(use),
        clips=tuple(clips),
    ).save(folder)
    return folder
