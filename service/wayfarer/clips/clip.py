"""A finished piece of motion of one body."""

import itertools
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wayfarer.body.model import BodyModel
from wayfarer.body.rotation import matrix_from_quaternion
from wayfarer.errors import InvalidArgument
from wayfarer.spec import FPS, POSED_JOINTS
from wayfarer.world.agents.agent import AgentSpec, MotionChunk

Array = NDArray[np.floating[Any]]


@dataclass(frozen=True)
class Clip:
    """Frames of one body, world space: metres, right-handed, Z up. N frames.

    Rotations are unit quaternions x, y, z, w: joint 0 in the world, the others local to their
    parent and relative to the T-pose. Raises InvalidArgument when shapes or values do not fit.
    """

    translation: Array = field(repr=False)  # [N, 3] hips joint
    rotations: Array = field(repr=False)  # [N, 22, 4]
    contacts: NDArray[np.bool_] = field(repr=False)  # [N, 2] left, right
    gender: str
    betas: tuple[float, ...]
    body: str = "anny52"
    fps: float = FPS
    goals: tuple[tuple[float, float, float], ...] = ()  # visited in this order
    meta: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        n = len(self.translation)
        wanted = {"translation": (n, 3), "rotations": (n, POSED_JOINTS, 4), "contacts": (n, 2)}
        for name, shape in wanted.items():
            values = getattr(self, name)
            if n == 0 or values.shape != shape:
                raise InvalidArgument(
                    f"{name} has shape {values.shape}; wanted {shape}, N ≥ 1", name
                )
            if not np.isfinite(values).all():
                raise InvalidArgument(f"{name} holds NaN or infinity", name)
        if not self.fps > 0:
            raise InvalidArgument(f"fps is {self.fps}; it must be above 0", "fps")

    @property
    def frames(self) -> int:
        """Number of frames N."""
        return len(self.translation)

    @property
    def seconds(self) -> float:
        """Length in seconds."""
        return self.frames / self.fps

    def __getitem__(self, frames: slice) -> "Clip":
        """The chosen frames as a clip of the same rate (slices with steps are refused)."""
        if frames.step not in (None, 1):
            raise InvalidArgument("a clip is cut without steps: its rate would change", "frames")
        return replace(
            self,
            translation=self.translation[frames],
            rotations=self.rotations[frames],
            contacts=self.contacts[frames],
        )

    def pose(self, body: BodyModel) -> tuple[Array, Array]:
        """World joint rotations [N, J, 3, 3] and places [N, J, 3] of all frames."""
        local = matrix_from_quaternion(np.asarray(self.rotations, np.float64))
        rest = body.rest_joints(np.asarray(self.betas))
        return body.forward_kinematics(np.asarray(self.translation, np.float64), local, rest)


def join_chunks(chunks: Iterable[MotionChunk], spec: AgentSpec, **about: Any) -> Clip:
    """One agent's chunks, in order of `seq`, as a clip; `about` fills further Clip fields.

    Raises InvalidArgument when there is no chunk, or frames are missing between two chunks.
    """
    ordered = sorted(chunks, key=lambda chunk: chunk.seq)
    if not ordered:
        raise InvalidArgument("no chunk: the agent has not moved yet", "chunks")
    for before, after in itertools.pairwise(ordered):
        if after.first_frame != before.first_frame + len(before.translation):
            raise InvalidArgument(f"frames are missing before chunk {after.seq}", "chunks")
    return Clip(
        translation=np.concatenate([chunk.translation for chunk in ordered]),
        rotations=np.concatenate([chunk.rotations for chunk in ordered]),
        contacts=np.concatenate([chunk.contacts for chunk in ordered]),
        gender=spec.gender,
        betas=spec.betas,
        **about,
    )
