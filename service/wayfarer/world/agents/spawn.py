"""The seed of a standing agent: a natural start pose, on the floor, at a place and heading.

Both seed frames are the same, so the first primitive starts at rest.
"""

from collections.abc import Mapping
from pathlib import Path
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from wayfarer.body.model import BodyModel
from wayfarer.body.rotation import matrix_from_quaternion, quaternion_from_rotvec
from wayfarer.errors import ArtifactError
from wayfarer.spec import POSED_JOINTS
from wayfarer.world.agents.agent import AgentSpec
from wayfarer.world.agents.heading import facing_at
from wayfarer.world.agents.slots import Mode, Motion
from wayfarer.world.output.quaternion import multiply


def load_start_poses(path: Path) -> NDArray[np.float32]:
    """Array `rotations` [P, 22, 4] of a file: standing poses at heading 0. Raises ArtifactError."""
    try:
        with np.load(path) as file:
            rotations = file["rotations"]
    except (OSError, ValueError, KeyError, BadZipFile) as error:
        raise ArtifactError(f"{path}: start poses cannot be read: {error}") from error
    if rotations.ndim != 3 or rotations.shape[1:] != (POSED_JOINTS, 4) or not len(rotations):
        raise ArtifactError(
            f"{path}: rotations: found shape {rotations.shape}, expected (P > 0, {POSED_JOINTS}, 4)"
        )
    lengths = np.linalg.norm(rotations, axis=-1)
    if not (np.abs(lengths - 1) < 1e-3).all():  # a NaN fails too
        raise ArtifactError(f"{path}: rotations: found quaternions that are not of unit length")
    return rotations.astype(np.float32)


class Spawner:
    """Builds standing seeds for bodies of both genders."""

    def __init__(self, bodies: Mapping[str, BodyModel], start_poses: NDArray[np.float32]) -> None:
        self._bodies = bodies
        self._poses = start_poses

    def stand(self, spec: AgentSpec) -> Motion:
        """One row: `spec`'s body standing at its position and heading, soles on z = 0.

        The pose is chosen by the noise seed. Hips are over the position.
        """
        body = self._bodies[spec.gender]
        pose = self._poses[spec.noise_seed % len(self._poses)].astype(np.float64)
        turn = quaternion_from_rotvec(np.array([0.0, 0.0, spec.heading]))
        betas = np.asarray(spec.betas, np.float64)

        local = matrix_from_quaternion(pose)
        local[0] = matrix_from_quaternion(turn) @ local[0]
        rotations, places = body.forward_kinematics(np.zeros(3), local, body.rest_joints(betas))
        markers = body.markers(betas, rotations, places)
        hips = np.array([*spec.position, -body.sole_height(betas, rotations, places, markers)])
        quaternions = np.concatenate([multiply(turn, pose[0])[None], pose[1:]])

        stand = Motion.empty(1)
        seed, gait = stand.seed, stand.gait
        seed.markers[:] = markers + hips
        seed.translation[:] = hips
        seed.rotations[:] = quaternions
        gait.mode[:] = Mode.STANDING
        gait.stop_place[:] = spec.position
        gait.stop_facing[:] = facing_at(spec.heading)
        gait.rested[:] = True
        return stand
