"""The guards, called with copies of arrays."""

import numpy as np

from wayfarer.world.output.legs import Legs, bones
from wayfarer.world.stepping.guards import FELL, FOLDED, bear_rows, bend_rows


def bendable(rotations: np.ndarray, shape: Legs) -> tuple[np.ndarray, np.ndarray]:
    """The rotations with knees within their limits, and whose were not. [A]"""
    made, mended = np.array(rotations, np.float32), np.zeros(len(rotations), np.bool_)
    bend_rows(made, shape.ankle, mended)
    return made, mended


def fallen(translation: np.ndarray, rotations: np.ndarray, shape: Legs) -> np.ndarray:
    """Who leans or squats as no walker does. [A]"""
    upright, height = np.empty((2, len(rotations)), np.float32)
    bear_rows(translation, rotations, bones(shape), upright, height)
    return (upright < FELL) | (height < FOLDED)
