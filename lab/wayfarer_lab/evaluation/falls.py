"""Agents that had to get up in a run: who, when, what the guard saw, and the seconds around it."""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import count
from math import degrees
from pathlib import Path
from typing import Final

import numpy as np

from wayfarer.clips.clip import Clip
from wayfarer.model_bundle import Bodies
from wayfarer.spec import STEP_SECONDS
from wayfarer.world.agents.agent import AgentChange, AgentSpec, MotionChunk
from wayfarer.world.agents.behaviour import Agent
from wayfarer.world.agents.registry import Session
from wayfarer.world.goals.commands import GoalCommand
from wayfarer.world.observer import Fall, Names, Start
from wayfarer.world.rows import Index
from wayfarer.world.stepping.due import Due
from wayfarer_lab.evaluation.gait import Row
from wayfarer_lab.evaluation.pictures.files import write_still
from wayfarer_lab.evaluation.pictures.scene import ClipActor
from wayfarer_lab.evaluation.pictures.stills import contact_sheet

BEFORE, AFTER = 12, 8
"""Chunks of 0.2 s that are shown up to a fall, and after it."""

MOMENTS: Final = 14
HEIGHT: Final = 200
"""Bodies in a strip, and pixels of one's cell."""


@dataclass(frozen=True)
class Fallen:
    """A fall, and what was sent around it."""

    agent: int  # number in order of creation
    spec: AgentSpec
    fall: Fall
    chunks: Sequence[MotionChunk]  # of that agent, in order

    @property
    def seconds(self) -> float:
        """When its chunk begins, from the agent's first frame on."""
        return self.fall.seq * STEP_SECONDS

    def row(self, name: str) -> Row:
        """A row of JSON; `name` is that of the run."""
        return {
            "name": f"{name}, agent {self.agent}",
            "at_s": self.seconds,
            "state": self.fall.state.value,
            "lean_deg": degrees(self.fall.lean),
            "hips": self.fall.hips,
        }

    def clip(self) -> Clip:
        """The chunks sent around it, of which there is at least one."""
        return Clip(
            np.concatenate([chunk.translation for chunk in self.chunks]),
            np.concatenate([chunk.rotations for chunk in self.chunks]),
            np.concatenate([chunk.contacts for chunk in self.chunks]),
            self.spec.gender,
            self.spec.betas,
        )


class FallWatch:
    """Keeps what falls need, of all agents of a world. A `WorldObserver`."""

    def __init__(self) -> None:
        self._numbers = count()
        self._agents: dict[str, tuple[int, AgentSpec]] = {}
        self._recent: dict[str, deque[MotionChunk]] = {}
        self._open: list[Fallen] = []
        self._closed: list[Fallen] = []

    @property
    def falls(self) -> list[Fallen]:
        """All of them, in order of time."""
        late = [self._so_far(fallen) for fallen in self._open]
        return sorted([*self._closed, *late], key=lambda fallen: fallen.seconds)

    def fell(self, falls: Sequence[Fall]) -> None:
        """Note falls."""
        for fall in falls:
            number, spec = self._agents[fall.agent_id]
            self._open.append(Fallen(number, spec, fall, ()))

    def created(self, session: Session, agents: Sequence[Agent], starts: Sequence[Start]) -> None:
        """Number the agents."""
        for agent in agents:
            self._agents[agent.agent_id] = next(self._numbers), agent.spec
            self._recent[agent.agent_id] = deque(maxlen=BEFORE + AFTER)

    def sent(self, due: Due) -> None:
        """Keep what was sent last."""
        for chunk in due.chunks:
            self._recent[chunk.agent_id].append(chunk)
        if not self._open:
            return
        seqs = dict(zip(due.chunks.agent_id, due.chunks.seq.tolist(), strict=True))
        done = [f for f in self._open if seqs.get(f.fall.agent_id, -1) >= f.fall.seq + AFTER]
        self._closed += map(self._so_far, done)
        self._open = [f for f in self._open if f not in done]

    def _so_far(self, fallen: Fallen) -> Fallen:
        recent = tuple(self._recent[fallen.fall.agent_id])
        return Fallen(fallen.agent, fallen.spec, fallen.fall, recent)

    def opened(self, session: Session) -> None:
        """Agents come with `created`."""

    def closed(self, session: Session) -> None:
        """Falls are kept."""

    def commanded(self, agent: Agent, command: GoalCommand, seq: int) -> None:
        """Pictures show no goals."""

    def changed(self, agent: Agent, change: AgentChange, seq: int) -> None:
        """Bodies stay the same."""

    def deleted(self, agent: Agent, seq: int) -> None:
        """Falls are kept."""

    def planned(
        self, agent_ids: Names, seqs: Index, candidates: int, models: Sequence[str]
    ) -> None:
        """What is sent counts."""

    def strayed(self, session_id: str, agent_id: str) -> None:
        """Evaluations contain no faults."""

    def stood(self, agents: Sequence[Agent]) -> None:
        """What is sent counts."""


def draw_falls(name: str, falls: Sequence[Fallen], bodies: Bodies, folder: Path) -> Path | None:
    """A sheet `falls_NAME.png` with a row for each fall of the run `name`; None: nobody fell."""
    shown = [fallen for fallen in falls if fallen.chunks]
    if not shown:
        return None
    actors = [ClipActor.of(fallen.clip(), bodies[fallen.spec.gender], "sides") for fallen in shown]
    captions = [
        f"agent {f.agent}, {f.seconds:.1f} s, {f.fall.state.value}: "
        f"lean {degrees(f.fall.lean):.1f} deg, hips {f.fall.hips:.2f}"
        for f in shown
    ]
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"falls_{'_'.join(name.replace('.', ' ').split())}.png"
    write_still(path, contact_sheet(actors, captions, MOMENTS, height=HEIGHT))
    return path
