"""Repair: how far the rules after the model move a body, all together and each on its own."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayfarer.body.rotation import matrix_from_quaternion
from wayfarer.models.bundle import Bodies
from wayfarer.spec import POSED_JOINTS
from wayfarer.world.agents.agent import AgentSpec
from wayfarer.world.rows import Float, Index
from wayfarer.world.stepping.rules import MODEL, PLANNED, RULES

Array = NDArray[np.floating[Any]]
Row = dict[str, float]

EVERY: Final = 4
"""Steps of an agent between two measured steps."""

ALL: Final = "all rules"


class SeenFrames(NamedTuple):
    """Frames of one agent: hips [F, 3] in the world, rotations [F, 22, 4]."""

    translation: Array
    rotations: Array


class RepairedStep(NamedTuple):
    """A step as the model made it, and as it was planned."""

    made: SeenFrames
    planned: SeenFrames


@dataclass
class Repair:
    """A `rules.Watch`: gathers how far each rule moves joints, in places and in angles.

    Agents have the slots 0, 1, … in the order of `specs`, as in a separate world. Motion that
    a replan discards counts for the single rules, not for all together.
    """

    specs: Sequence[AgentSpec]
    bodies: Bodies
    climbs: bool = False  # the height of the floor, and with it that of the hips, is no repair
    every: int = EVERY
    _steps: dict[int, int] = field(default_factory=lambda: defaultdict(int))
    _now: dict[int, SeenFrames] = field(default_factory=dict)  # being ruled
    _made: dict[int, SeenFrames] = field(default_factory=dict)
    _waiting: dict[int, list[RepairedStep]] = field(default_factory=lambda: defaultdict(list))
    _sent: dict[int, tuple[SeenFrames, SeenFrames]] = field(
        default_factory=dict
    )  # made, and so far
    _metres: dict[str, list[Array]] = field(default_factory=lambda: defaultdict(list))
    _degrees: dict[str, list[Array]] = field(default_factory=lambda: defaultdict(list))

    def __call__(self, name: str, slots: Index, translation: Float, rotations: Float) -> None:
        """See `rules.Watch`."""
        for row, slot in enumerate(slots.tolist()):
            frames = SeenFrames(translation[row].copy(), rotations[row].copy())
            if name == MODEL:
                self._begin(slot, frames)
            elif name == PLANNED:
                self._leave(slot, frames)
            elif name != "ground":
                self._plan(name, slot, frames)
            else:
                self._send(name, slot, frames)

    def rows(self) -> Mapping[str, Row]:
        """By rule, and for `ALL`: mean and 95th percentile over joints and frames, of the distance
        in cm and of the change of the local rotation in degrees.
        """
        return self.joined([self])

    @staticmethod
    def joined(repairs: Sequence["Repair"]) -> Mapping[str, Row]:
        """`rows` of several, all their joints and frames together."""
        for repair in repairs:
            for slot in list(repair._sent):
                repair._finish(slot)
        found = {}
        for rule in (ALL, *RULES):
            metres = [values for repair in repairs for values in repair._metres[rule]]
            degrees = [values for repair in repairs for values in repair._degrees[rule]]
            if metres:
                found[rule] = _row(np.concatenate(metres), np.concatenate(degrees))
        return found

    def _begin(self, slot: int, made: SeenFrames) -> None:
        self._steps[slot] += 1
        self._now.pop(slot, None)
        if self._steps[slot] % self.every == 0:
            self._made[slot] = self._now[slot] = made
            self._waiting[slot] = [*self._waiting[slot], RepairedStep(made, made)][-3:]

    def _plan(self, name: str, slot: int, frames: SeenFrames) -> None:
        if slot in self._now:
            self._note(name, slot, self._now[slot], frames)
            self._now[slot] = frames
            self._waiting[slot][-1] = RepairedStep(self._made[slot], frames)

    def _leave(self, slot: int, planned: SeenFrames) -> None:
        self._finish(slot)
        for step in self._waiting[slot]:
            if np.array_equal(step.planned.translation, planned.translation):
                self._sent[slot] = (step.made, planned)

    def _send(self, name: str, slot: int, frames: SeenFrames) -> None:
        if slot in self._sent:
            made, before = self._sent[slot]
            self._note(name, slot, before, frames)
            self._sent[slot] = (made, frames)

    def _finish(self, slot: int) -> None:
        """Completes the frames that were sent to an agent, when the next ones leave."""
        if slot in self._sent:
            made, last = self._sent.pop(slot)
            self._note(ALL, slot, made, last)

    def _note(self, rule: str, slot: int, before: SeenFrames, after: SeenFrames) -> None:
        spec = self.specs[slot]
        body = self.bodies[spec.gender]
        rest = body.rest_joints(np.asarray(spec.betas))
        turns = [matrix_from_quaternion(f.rotations.astype(np.float64)) for f in (before, after)]
        places = [
            body.forward_kinematics(f.translation.astype(np.float64), local, rest)[1]
            for f, local in zip((before, after), turns, strict=True)
        ]
        moved = (places[1] - places[0])[:, :POSED_JOINTS]
        if self.climbs:
            moved[..., 2] -= moved[:, :1, 2]
        relative = np.swapaxes(turns[0], -1, -2) @ turns[1]
        # |R - 1|² = 8 sin²(angle / 2): unlike the arc cosine of the trace, exact for small angles
        chord = np.linalg.norm((relative - np.eye(3)).reshape(*relative.shape[:-2], 9), axis=-1)
        angle = 2 * np.arcsin(np.clip(chord / 8**0.5, 0, 1))
        self._metres[rule].append(np.linalg.norm(moved, axis=-1).ravel())
        self._degrees[rule].append(np.degrees(angle).ravel())


def _row(metres: Array, degrees: Array) -> Row:
    return {
        "cm_mean": 100 * float(metres.mean()),
        "cm_p95": 100 * float(np.quantile(metres, 0.95)),
        "deg_mean": float(degrees.mean()),
        "deg_p95": float(np.quantile(degrees, 0.95)),
    }
