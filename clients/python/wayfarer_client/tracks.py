"""Frames of many batches, joined per agent: for clips, lock-step and recordings."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wayfarer_client.character import Character
from wayfarer_client.messages import Agent, Batch, Float, Frames


@dataclass(frozen=True, slots=True)
class Track:
    """The motion of one agent."""

    agent: Agent
    times: NDArray[np.float64] = field(repr=False)  # [F] seconds
    translation: Float = field(repr=False)  # [F, 3] hips
    rotations: Float = field(repr=False)  # [F, B, 4] x, y, z, w
    contacts: NDArray[np.bool_] = field(repr=False)  # [F, 2] left, right foot on the ground

    def on(self, character: Character, title: str = "motion", scale: float = 1.0) -> bytes:
        """The character's file with this motion of a session or clip in the glTF basis.

        An agent made with `fit = await client.fit_body(character)`, `fit.spec()` has its legs.
        `scale`: `fit.scale`; lengths are multiplied by it, and times by its square root.
        """
        times = self.times
        fps = (len(times) - 1) / float(times[-1] - times[0]) if len(times) > 1 else 40.0
        rest = scale * np.asarray(self.agent.rest_offsets)
        places = scale * np.asarray(self.translation)
        return character.animate(places, self.rotations, rest, fps / scale**0.5, title)

    def save(self, path: str | Path) -> Path:
        """Writes an npz file of these arrays, with the agent's betas and rest offsets."""
        path = Path(path).with_suffix(".npz")
        np.savez_compressed(
            path,
            times=self.times,
            translation=self.translation,
            rotations=self.rotations,
            contacts=self.contacts,
            rest_offsets=self.agent.rest_offsets,
            betas=np.array(self.agent.betas),
            gender=np.array(self.agent.gender),
            name=np.array(self.agent.name),
        )
        return path


def tracks(batches: Iterable[Batch]) -> dict[str, Track]:
    """The motion of every agent in the batches, by agent id."""
    found: dict[str, list[Frames]] = {}
    for batch in batches:
        for frames in batch:
            found.setdefault(frames.agent.agent_id, []).append(frames)
    return {agent_id: _joined(frames) for agent_id, frames in found.items()}


def _joined(frames: list[Frames]) -> Track:
    return Track(
        agent=frames[-1].agent,
        times=np.concatenate([part.times for part in frames]),
        translation=np.concatenate([part.translation for part in frames]),
        rotations=np.concatenate([part.rotations for part in frames]),
        contacts=np.concatenate([part.contacts for part in frames]),
    )
