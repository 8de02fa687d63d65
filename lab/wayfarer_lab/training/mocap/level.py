"""Put a subject's clips on the floor, find foot contacts, measure how their feet stand."""

from dataclasses import replace

import numpy as np
from scipy.ndimage import gaussian_filter1d

from wayfarer.spec import FPS
from wayfarer_lab.training.mocap.floor import (
    ANKLES,
    BALLS,
    ankle_height,
    find_contacts,
    fit_tilt,
    floor_height,
    speeds,
)
from wayfarer_lab.training.mocap.load import Piece
from wayfarer_lab.training.mocap.retarget import Subject, mean_sole, straightest_knee
from wayfarer_lab.training.mocap.rig import SourceClip

USUAL_ANKLE_HEIGHT = 0.05  # metres above the ball joints, when a subject never stands flat
MIN_RESTING = 0.8  # share of a walk's frames with a foot at rest, below which the data slide
MAX_WALK = 1.8  # m/s
NO_CONTACTS = np.zeros((0, 2, 2), bool)


def level_subject(pieces: list[Piece]) -> tuple[list[SourceClip], Subject]:
    """Level all pieces of one subject: one floor tilt per subject, one height per piece.

    The tilt is measured on locomotion where there is some: it spans the floor, while people
    acting on the spot bend their feet and tell nothing about it.
    """
    flat = [p for p in pieces if not p.info.scene_contact]
    walked = [p for p in flat if p.info.locomotion]
    turn = fit_tilt([p.places for p in walked or flat])
    clips, ankles = [], []
    for piece in pieces:
        places = piece.places @ turn.T
        places[..., 2] -= floor_height(places)
        clips.append(
            SourceClip(piece.info, places, turn @ piece.rotations, piece.rest, NO_CONTACTS)
        )
        height = ankle_height(places)
        if height is not None and not piece.info.scene_contact:
            ankles.append(height)
    ankle = float(np.median(ankles)) if ankles else USUAL_ANKLE_HEIGHT
    ready = [replace(c, contacts=find_contacts(c.places, ankle)) for c in clips]
    ready = [_without_slide(c, ankle) if c.info.locomotion else c for c in ready]
    measured = [c for c in ready if not c.info.scene_contact] or ready
    return ready, Subject(ankle, straightest_knee(measured), mean_sole(measured))


def _without_slide(clip: SourceClip, ankle: float) -> SourceClip:
    """A walk whose feet never rest (wrong bone lengths), moved so that the lower foot does.

    The horizontal velocity of the lowest points of the feet is taken off the whole body. Clips
    that show a foot at rest in most frames, runs included, are left as they are.
    """
    hips = speeds(clip.places[:, 0])
    resting = clip.contacts.any((1, 2)).mean()
    if resting > MIN_RESTING or hips.mean() > MAX_WALK:
        return clip
    points = clip.places[:, ANKLES + BALLS]
    height = points[..., 2] - np.array([ankle, ankle, 0.0, 0.0])
    velocity = np.gradient(points[..., :2], axis=0)
    slowness = np.linalg.norm(velocity, axis=-1) * FPS
    weight = np.exp(-height / 0.015 - slowness / 0.3)
    weight = gaussian_filter1d(weight / weight.sum(-1, keepdims=True), 1.5, axis=0)
    slide = (velocity * weight[..., None]).sum(1)
    places = clip.places.copy()
    places[..., :2] -= (np.cumsum(slide, axis=0) - slide[0])[:, None]
    return replace(clip, places=places, contacts=find_contacts(places, ankle))
