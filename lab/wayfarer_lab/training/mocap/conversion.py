"""A file's motion → our 22 joints in metres, Z up."""

import numpy as np

from wayfarer_lab.training.mocap.joints import joint_map
from wayfarer_lab.training.mocap.rig import guess_unit
from wayfarer_lab.training.mocap.skeleton import Array, SkeletonMotion
from wayfarer_lab.training.mocap.stance import Z_UP, RestFrame, rest_turn


def to_our_joints(
    motion: SkeletonMotion, unit: float | None, up: str, reference: RestFrame | None = None
) -> tuple[Array, Array, Array]:
    """Places [N, 22, 3], world rotations [N, 22, 3, 3] and rest places [22, 3] in our frame.

    `up` is the world's upward axis, y or z. The rest pose is the file's zero pose, or `reference`.
    Raises DataError if the rest pose does not stand or `unit` cannot be determined.
    """
    rows = joint_map(motion.skeleton)
    every, everywhere = motion.world()
    rotations, places = every[:, rows], everywhere[:, rows]
    rest = motion.skeleton.rest_places()[rows]
    if reference is not None:
        rest = reference.places
        rotations = rotations @ np.swapaxes(reference.rotations, -1, -2)
    metres = guess_unit(rest) if unit is None else unit
    turn = rest_turn(rest)
    rest = rest * metres @ turn.T
    # world axes change by Z_UP only (headings are kept as recorded), rest axes by turn
    return (
        places * metres @ Z_UP[up].T,
        Z_UP[up] @ rotations @ turn.T,
        rest - rest[0],
    )
