import numpy as np
import pytest

from wayfarer.body.library import load_body
from wayfarer.body.rotation import quaternion_from_rotvec
from wayfarer.clips.clip import Clip
from wayfarer.spec import POSED_JOINTS


@pytest.fixture(scope="session")
def body():
    return load_body("anny52", "female", "low")


@pytest.fixture(scope="session")
def clip(body):
    """Half a second of wild but smooth motion of an uncommon body."""
    rng = np.random.default_rng(11)
    frames = 20
    time = np.arange(frames)[:, None, None] / frames
    wave = rng.normal(scale=0.8, size=(POSED_JOINTS, 3)) * np.sin(
        2 * np.pi * time + rng.uniform(0, 6, size=(POSED_JOINTS, 3))
    )
    wave[:, 0] += np.linspace(0, 4, frames)[:, None] * [0, 0, 1]  # beyond 180°
    return Clip(
        translation=np.cumsum(rng.normal(scale=0.03, size=(frames, 3)), 0) + np.array([3, -2, 0.9]),
        rotations=quaternion_from_rotvec(wave),
        contacts=rng.random((frames, 2)) < 0.5,
        gender="female",
        betas=tuple(rng.normal(size=10)),
        goals=((3.0, 2.0, 0.0), (-1.0, 4.0, 0.0)),
    )
