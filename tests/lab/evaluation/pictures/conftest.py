"""Small things to draw: T-poses that glide ahead on the floor."""

from dataclasses import replace

import numpy as np
import pytest

from wayfarer.body.library import load_body
from wayfarer.clips.clip import Clip
from wayfarer_lab.evaluation.pictures.scene import ClipActor

FRAMES = 20


@pytest.fixture(scope="session")
def body():
    return load_body("anny52", "male", "low")


@pytest.fixture(scope="session")
def clip(body):
    """Half a second, 1 m ahead, to a goal."""
    translation = np.zeros((FRAMES, 3))
    translation[:, 1] = np.linspace(0, 1, FRAMES)
    translation[:, 2] = body.rest_joints(np.zeros(10))[0, 2]
    rotations = np.zeros((FRAMES, 22, 4))
    rotations[..., 3] = 1
    contacts = np.ones((FRAMES, 2), bool)
    return Clip(translation, rotations, contacts, "male", (0.0,) * 10, goals=((0.0, 1.0, 0.0),))


@pytest.fixture
def act(body, clip):
    """Make an actor of the clip, moved by (x, y, z), with some of its fields replaced."""

    def make(by=(0.0, 0.0, 0.0), look="sides", **fields):
        moved = replace(clip, translation=clip.translation + np.array(by))
        return ClipActor.of(replace(moved, **fields), body, look)

    return make


@pytest.fixture
def pixels():
    """A picture as whole numbers [H, W, 3] that can be subtracted."""
    return lambda picture: np.asarray(picture).astype(int)
