"""The next mode of each agent (stand, walk, stop, turn), and the aim of its search.

    STANDING ──goal──▶ WALKING ──braking distance──▶ STOPPING ──slow for 0.4 s──▶ STANDING
                          ▲──────not there after all──────┘  ▲
                                                             └─faces its heading─ TURNING

An agent at rest (stopping or standing) that does not face its heading is TURNING until it does.
Goals to pass through cause no braking. STRAFING is walking that faces its heading on the way. The
model decides how a body sets off, slows down, turns and steps: it receives a place, a speed and a
facing, from which `motion/trajectory.py` makes the way and the facings of the next second.

These are pure functions of columns, one agent at a time, compiled. Tuned numbers are in the two
tables at the top, and at the top of gait_rules.py.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import radians
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayfarer.terms import STAND, STRAFE, TURN, WALK, weights
from wayfarer.world.agents.goal import GoalColumns
from wayfarer.world.agents.slots import Gait, Mode, Seeds
from wayfarer.world.goals.gait_rules import (
    GaitArrays,
    GoalArrays,
    SteeringNumbers,
    Targets,
    aim_rows,
    decide_rows,
    observe_rows,
)
from wayfarer.world.output.legs import packed
from wayfarer.world.rows import Flags, Float, Index, columns


@dataclass(frozen=True, slots=True)
class Search:
    """How candidates are drawn and judged in one mode."""

    weights: Mapping[str, float]
    candidates: int  # K
    temperature: float = 1.0  # scale of the latent noise
    policy: float = 1.0  # share of the learned policy in the latents; 0: the prior alone
    own: float = 0.85  # share of the noise's variance that is constant for the agent


def default_searches() -> dict[Mode, Search]:
    """The search of each mode: K = 1, so each primitive is what people did, drawn by the policy.

    Constant noise tells moving people apart, and makes standing ones lean ever more to one side.
    """
    return {
        Mode.STANDING: Search(STAND, candidates=1, own=0.35),
        Mode.WALKING: Search(WALK, candidates=1),
        Mode.STOPPING: Search(STAND, candidates=1, own=0.35),
        Mode.TURNING: Search(TURN, candidates=1),
        Mode.STRAFING: Search(STRAFE, candidates=1),
    }


class Tables(NamedTuple):
    """The searches as arrays, by mode."""

    weights: Float  # [M, T] in the order of `terms.TERMS`
    candidates: Index
    policy: Float
    temperature: Float
    own: Float

    @classmethod
    def of(cls, searches: Mapping[Mode, Search]) -> "Tables":
        """Raises KeyError on an unknown quality term."""
        ordered = [searches[mode] for mode in Mode]
        return cls(
            weights=np.array([weights(dict(s.weights)) for s in ordered], np.float32),
            candidates=np.array([s.candidates for s in ordered]),
            policy=np.array([s.policy for s in ordered], np.float32),
            temperature=np.array([s.temperature for s in ordered], np.float32),
            own=np.array([s.own for s in ordered], np.float32),
        )


@dataclass(frozen=True)
class Steering:
    """Numbers of steering. Distances are horizontal, in metres, speeds in m/s, times in s, angles
    in radians.
    """

    searches: Mapping[Mode, Search] = field(default_factory=default_searches)
    braking_seconds: float = 0.1  # braking distance = min(radius / 2, 0.15) + this × speed
    braking_margin: float = 0.15
    coasting_seconds: float = 0.35  # without a goal an agent comes to rest in this × speed
    pausing: float = 0.5  # share of the requested speed below which a walker stops at its goal
    slow: float = 0.15  # below this an agent counts as slow
    slow_seconds: float = 0.4  # an agent that has been slow for this long stands
    resume_margin: float = 0.3  # metres outside the goal's radius beyond which it walks again
    lookahead: float = 1.0  # metres ahead of a point to pass through at which it is aimed at
    lookahead_seconds: float = 0.8  # seconds of walking that replace it, if they are more
    faced: float = radians(8)  # a turn ends within this of the heading
    astray: float = radians(14)  # a turn begins beyond this
    reactions: int = 3  # a standing agent sets off at its own one of this many steps
    turn_radius: float = 0.35  # metres from the spot to the aim of a turn, halfway to the heading
    turn_speed: float = 0.5  # m/s of its steps: without a way, a body turns like a turntable
    climbing: float = 1.8  # steps per second on stairs, where each is as long as a tread
    strafe_speed: float = 1.2  # maximum speed of side steps and steps backward
    strafe_slowest: float = 0.8  # minimum speed of these: with less, a body glides
    weight_shift: float = 0.1  # metres to either side where a standing body is asked to be

    def with_search(
        self,
        candidates: int | None = None,
        policy: float | None = None,
        temperature: float | None = None,
    ) -> "Steering":
        """The same steering with another search in every mode; None keeps a setting."""
        asked = {"candidates": candidates, "policy": policy, "temperature": temperature}
        given: dict[str, Any] = {k: value for k, value in asked.items() if value is not None}
        searches = {mode: replace(s, **given) for mode, s in self.searches.items()}
        return replace(self, searches=searches)

    def advance(self, gait: Gait, goals: GoalColumns) -> Gait:
        """Sends agents that are done with their goal on to the next one. If there are none, `gait`
        itself is returned.

        A goal to pass through is done once it is reached; otherwise an agent has to come to a stand
        there, and to dwell.
        """
        dwelt = gait.slow_seconds >= self.slow_seconds + goals.dwell - 1e-3
        done = goals.through | ((gait.mode == Mode.STANDING) & dwelt)
        onward = goals.more & gait.arrived & done
        if not onward.any():
            return gait
        return replace(
            gait,
            mode=np.where(onward, Mode.WALKING, gait.mode).astype(np.int8),
            slow_seconds=np.where(onward, 0, gait.slow_seconds).astype(np.float32),
            arrived=gait.arrived & ~onward,
            waypoint=gait.waypoint + onward,
        )

    def decide(
        self, gait: Gait, seed: Seeds, goals: GoalColumns, ready: Flags | None = None
    ) -> Gait:
        """The gait of the next step, from the gait so far and the seed that it starts from.

        Standing agents that are not `ready` [A] remain standing; None: all are ready.
        """
        all_ready = np.ones(len(gait.mode), np.bool_)
        after = replace(
            gait,
            mode=gait.mode.copy(),
            rested=gait.rested.copy(),
            slow_seconds=gait.slow_seconds.copy(),
            stop_place=gait.stop_place.copy(),
            stop_facing=gait.stop_facing.copy(),
        )
        decide_rows(
            self._limits,
            columns(GoalArrays, goals),
            columns(GaitArrays, gait),
            seed.translation,
            seed.rotations,
            all_ready if ready is None else ready,
            columns(GaitArrays, after),
        )
        return after

    def targets(self, gait: Gait, seed: Seeds, goals: GoalColumns) -> Targets:
        """The aims of the next step, which has the gait `gait`."""
        count = len(gait.mode)
        place, facing = np.empty((count, 2), np.float32), np.empty((count, 2), np.float32)
        found = Targets(place, np.empty(count, np.float32), facing)
        aim_rows(
            self._limits,
            columns(GoalArrays, goals),
            columns(GaitArrays, gait),
            seed.translation,
            seed.rotations,
            found,
        )
        return found

    def term_weights(self, mode: NDArray[np.int8]) -> Float:
        """Weights [A, T] in the order of `terms.TERMS`."""
        return self._tables.weights[mode]

    def candidates(self, mode: NDArray[np.int8]) -> Index:
        """Number of candidates K for each agent [A]."""
        return self._tables.candidates[mode]

    def policy(self, mode: NDArray[np.int8]) -> Float:
        """Share of the policy [A] in each agent's latents."""
        return self._tables.policy[mode]

    def noise(self, mode: NDArray[np.int8], drawn: Float, own: Float) -> Float:
        """Noise [A, K, 128] at each mode's temperature, from the step's draws [A, K, 128] and the
        agents' own noise [A, 128], both ~ N(0, I).
        """
        share, scale = self._tables.own[mode], self._tables.temperature[mode]
        new, kept = scale * np.sqrt(1 - share), scale * np.sqrt(share)
        return new[:, None, None] * drawn + (kept[:, None] * own)[:, None]

    @cached_property
    def _tables(self) -> Tables:
        return Tables.of(self.searches)

    @cached_property
    def _limits(self) -> SteeringNumbers:
        return SteeringNumbers(*(float(getattr(self, name)) for name in SteeringNumbers._fields))


def observe(gait: Gait, start: Float, translation: Float, goals: GoalColumns) -> Gait:
    """The gait after the step, with its speed and whether the goal has been reached.

    Walkers do not go exactly at the requested speed, and each has an individual error. The *trim*
    follows the error of agents that walk steadily, and `Steering` raises its requests by it.

    start [A, 3] is the last frame before the step, translation [A, F, 3] the new frames.
    """
    after = replace(
        gait, speed=gait.speed.copy(), trim=gait.trim.copy(), arrived=gait.arrived.copy()
    )
    hips, way = packed(translation), packed(start)
    observe_rows(columns(GoalArrays, goals), hips, way, columns(GaitArrays, after))
    return after
