"""Relaxed hands: fingers that are never posed hang in a natural curl.

The shipped body is modelled with its fingers spread and nearly straight, which on a walking person
looks like a mannequin's. Fingers have no rotations in a stream, so their *rest* is curled here: the
joints of skeleton, skin, GLB and clips alike. Wrists and all joints before them stay as they are.
"""

from collections.abc import Sequence
from math import radians
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.body.rotation import matrix_from_quaternion, quaternion_from_rotvec

Array = NDArray[np.floating[Any]]

CURL: Final = {
    "index": (7.0, 13.0, 7.0),
    "middle": (10.0, 16.0, 8.0),
    "ring": (12.0, 18.0, 9.0),
    "pinky": (14.0, 19.0, 10.0),
    "thumb": (0.0, 6.0, 10.0),
}
"""Degrees by which the joints of each finger, from the knuckle on, are bent beyond the model: more
from finger to finger, as in a hanging hand."""

SPREAD: Final = {"index": -4.0, "middle": 2.0, "ring": 7.0, "pinky": 12.0}
"""Degrees by which a finger is turned at its knuckle towards its neighbours: positive, to the
side of the thumb."""

PALM: Final = np.array([0.0, 0.0, -1.0])
"""Direction of the palms in the T-pose."""

THUMB_SIDE: Final = np.array([0.0, 1.0, 0.0])
"""Direction of the thumbs in the T-pose."""


def relaxed(names: Sequence[str], bind_joints: Array, bind_to_rest: Array) -> Array:
    """`bind_to_rest` [J, 3, 3] with curled fingers; names of joints and bind places [J, 3].

    Every joint of a finger turns with those before it.
    """
    found, number = np.array(bind_to_rest), {name: k for k, name in enumerate(names)}
    for side in ("left", "right"):
        for finger, bends in CURL.items():
            chain = [number[f"{side}_{finger}{k}"] for k in (1, 2, 3)]
            turn = np.eye(3)
            for place, (joint, bend) in enumerate(zip(chain, bends, strict=True)):
                first, last = chain[min(place, 1)], chain[min(place, 1) + 1]
                bone = bind_to_rest[joint] @ (bind_joints[last] - bind_joints[first])
                if place == 0 and finger in SPREAD:
                    aside = np.cross(bone, THUMB_SIDE)  # down on one side, up on the other
                    turn = _about(aside, SPREAD[finger]) @ turn
                towards = _inwards(finger, bone)
                turn = turn @ _about(np.cross(bone, towards), bend)
                found[joint] = turn @ bind_to_rest[joint]
    return found


def _inwards(finger: str, bone: Array) -> Array:
    """The direction in which a T-pose bone bends: fingers to the palm, the thumb to the index."""
    if finger == "thumb":
        along = np.array([np.sign(bone[0]), 0.0, 0.0])
        return along - THUMB_SIDE
    return PALM


def _about(axis: Array, degrees: float) -> Array:
    unit = axis / np.linalg.norm(axis)
    return matrix_from_quaternion(quaternion_from_rotvec(unit * radians(degrees)))
