"""What each agent does next: stand, walk, stop or turn; and what its search looks for.

    STANDING ──goal──▶ WALKING ──braking distance──▶ STOPPING ──slow for 0.4 s──▶ STANDING
                          ▲──────not there after all──────┘  ▲
                                                             └─faces its heading─ TURNING

An agent at rest (stopping or standing) that does not face its heading is TURNING until it does.
Goals to pass through cause no braking. STRAFING is walking that faces its heading on the way. How
a body sets off, slows down, turns and steps is the model's: it is asked for a place, a speed and a
facing, of which `motion/trajectory.py` makes the way and the facings of the next second.

Pure functions of columns, vectorised over agents. Everything that is tuned stands in the two
tables at the top.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import radians
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayfarer.spec import STEP_SECONDS
from wayfarer.terms import STAND, STRAFE, TURN, WALK, weights
from wayfarer.world.agents.goal import GoalColumns
from wayfarer.world.agents.heading import angle_between, facing_of
from wayfarer.world.agents.slots import Gait, Mode, Seeds
from wayfarer.world.output.quaternion import row_length
from wayfarer.world.rows import Flags, Float, Index


@dataclass(frozen=True, slots=True)
class Search:
    """How candidates are drawn and judged in one mode."""

    weights: Mapping[str, float]
    candidates: int  # K
    temperature: float = 1.0  # scale of the latent noise
    policy: float = 1.0  # share of the learned policy in the latents; 0: the prior alone
    own: float = 0.5  # share of the noise's variance that is the agent's own for ever


TRIM_GAIN: Final = 0.12
"""Share of a speed error that a step adds to the trim."""

TRIM_MOST: Final = 0.15
"""Bound of the trim, either way."""

PACE: Final = 0.7
"""m/s: nobody who walks to a goal is slower before its end, unless that is asked."""

STEADY: Final = 0.3
"""Share of the target speed: who is off it by more is setting off or slowing, and not trimmed."""


def default_searches() -> dict[Mode, Search]:
    """The search of each mode: K = 1, so each primitive is what people did, drawn by the policy.

    Noise that stays makes who stands lean ever more to one side: there is less of it.
    """
    return {
        Mode.STANDING: Search(STAND, candidates=1, own=0.2),
        Mode.WALKING: Search(WALK, candidates=1, temperature=0.8),
        Mode.STOPPING: Search(STAND, candidates=1, own=0.2),
        Mode.TURNING: Search(TURN, candidates=1),
        Mode.STRAFING: Search(STRAFE, candidates=1, temperature=0.8),
    }


class Targets(NamedTuple):
    """What the next step aims at."""

    place: Float  # [A, 2] metres, in plan: the model walks on a flat floor
    speed: Float  # [A] m/s
    facing: Float  # [A, 2] unit vector, or zero: the way to the place


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
    """Distances in metres, horizontal; speeds in m/s; times in s; angles in radians."""

    searches: Mapping[Mode, Search] = field(default_factory=default_searches)
    braking_seconds: float = 0.1  # braking distance = min(radius / 2, 0.15) + this × speed
    braking_margin: float = 0.15
    coasting_seconds: float = 0.35  # without a goal an agent comes to rest in this × speed
    pausing: float = 0.5  # share of the asked speed below which a walker at its goal stops there
    slow: float = 0.15  # below this an agent counts as slow
    slow_seconds: float = 0.4  # an agent that has been slow for this long stands
    resume_margin: float = 0.3  # stopped or pushed so far outside the goal's radius: walk again
    lookahead: float = 1.0  # a point to pass through is aimed at so far ahead, …
    lookahead_seconds: float = 0.8  # … or as far as this × speed
    faced: float = radians(8)  # turning ends when the heading is met within this …
    astray: float = radians(14)  # … and begins when it is missed by more
    reactions: int = 3  # a standing agent sets off at its own one of this many steps
    turn_radius: float = 0.4  # who turns on the spot aims so far off it, halfway to the heading, …
    turn_speed: float = 0.5  # … and steps so fast: asked for no way, a body turns like a turntable
    climbing: float = 1.5  # steps a second on stairs, where each is as long as a tread
    strafe_speed: float = 1.2  # at most, when it faces elsewhere than where it goes, …
    strafe_slowest: float = 0.6  # … and at least: asked for less, a body glides

    def with_search(
        self,
        candidates: int | None = None,
        policy: float | None = None,
        temperature: float | None = None,
    ) -> "Steering":
        """The same with another search in every mode; None leaves a setting as it is."""
        asked = {"candidates": candidates, "policy": policy, "temperature": temperature}
        given: dict[str, Any] = {k: value for k, value in asked.items() if value is not None}
        searches = {mode: replace(s, **given) for mode, s in self.searches.items()}
        return replace(self, searches=searches)

    def advance(self, gait: Gait, goals: GoalColumns) -> Gait:
        """Send those on who are done with their goal and have another one after it.

        A goal to pass through is done with once it is reached; else an agent has to come to a
        stand there, and to dwell.
        """
        dwelt = gait.slow_seconds >= self.slow_seconds + goals.dwell - 1e-3
        done = goals.through | ((gait.mode == Mode.STANDING) & dwelt)
        onward = goals.more & gait.arrived & done
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

        Who stands and is not `ready` [A] stands on; None: all are.
        """
        hips = seed.translation[:, -1, :2]
        way = goals.position[:, :2] - hips
        distance = row_length(way)
        braking = (
            np.minimum(goals.radius / 2, self.braking_margin) + self.braking_seconds * gait.speed
        )
        walking = _walks(gait)
        stopping = gait.mode == Mode.STOPPING
        standing = gait.mode == Mode.STANDING
        turning = gait.mode == Mode.TURNING

        is_slow = gait.speed < self.slow
        counts = standing | (stopping & is_slow)
        slow_seconds = np.where(counts, gait.slow_seconds + STEP_SECONDS, 0.0)
        still = stopping & (slow_seconds >= self.slow_seconds - 1e-3)

        # A goal that has been passed through, and that none follows, holds nobody.
        holds = goals.given & ~(goals.through & gait.arrived)
        missed = holds & ~gait.arrived
        strayed = holds & (distance > np.maximum(goals.radius, braking) + self.resume_margin)
        # Who comes to rest within reach is there; who walks on at that pace would only sway.
        paused = gait.speed < self.pausing * np.minimum(goals.speed, PACE)
        paused &= gait.mode == Mode.WALKING
        far = (distance > braking) & ~(gait.arrived & (is_slow | paused))
        at_rest = still | standing | turning | (walking & is_slow)

        waits = np.zeros_like(missed) if ready is None else ~ready
        waits &= gait.rested & is_slow & (standing | (gait.mode == Mode.WALKING))
        missed, strayed = missed & ~waits, strayed & ~waits

        facing = facing_of(seed.rotations[:, -1, 0])
        walks = (
            (walking & holds & (goals.through | far) & ~waits)
            | ((still | standing | turning) & missed)
            | (~walking & strayed)
        )
        has_heading = goals.given & goals.heading.any(-1) & ~waits
        off = angle_between(facing, goals.heading)
        astray = has_heading & (off > np.where(turning, self.faced, self.astray))
        turns = at_rest & astray & ~walks
        stands = waits | (standing | still) & ~walks & ~turns
        mode = np.select(
            [walks & goals.strafe, walks, turns, stands],
            [Mode.STRAFING, Mode.WALKING, Mode.TURNING, Mode.STANDING],
            Mode.STOPPING,
        )

        # Without a goal an agent stops as soon as it can; then it stands where it came to rest.
        brakes, rests = walking & ~walks & ~waits, still & ~walks
        # Who comes to rest at the edge of a goal goes on to it: else it would sway out of reach.
        edges = rests & holds & (distance > goals.radius / 2)
        # The steps of a turn at a goal take an agent nearer to it.
        faces_there = turns & holds & gait.arrived
        rest = np.where(holds[:, None], goals.position[:, :2], self._rest(gait, seed.translation))
        return replace(
            gait,
            mode=mode.astype(np.int8),
            rested=stands,
            slow_seconds=slow_seconds.astype(np.float32),
            stop_place=_choose(
                [
                    (faces_there | edges, goals.position[:, :2]),
                    (rests | (turning & ~turns), hips),
                    (brakes, rest),
                ],
                gait.stop_place,
            ),
            # A stopping agent keeps its facing, unless another heading is asked for.
            stop_facing=_choose(
                [
                    (has_heading & ~walks, goals.heading),
                    (brakes | rests, facing),
                ],
                gait.stop_facing,
            ),
        )

    def targets(self, gait: Gait, seed: Seeds, goals: GoalColumns) -> Targets:
        """What the next step, which `gait` is for, aims at."""
        hips = seed.translation[:, -1, :2]
        walking = _walks(gait)
        turning = gait.mode == Mode.TURNING
        arc = facing_of(seed.rotations[:, -1, 0]) + gait.stop_facing
        arc *= self.turn_radius / np.maximum(row_length(arc), 0.1)[:, None]
        place = _choose(
            [(walking, self._ahead(hips, goals)), (turning, gait.stop_place + arc)],
            gait.stop_place,
        )
        facing = _choose(
            [(gait.mode == Mode.STRAFING, goals.heading), (walking, np.zeros_like(goals.heading))],
            gait.stop_facing,
        )
        most = np.where(goals.strafe, self.strafe_speed, np.inf)
        most = np.where(goals.tread > 0, self.climbing * goals.tread, most)
        least = np.where(goals.strafe, self.strafe_slowest, 0.0)
        speed = np.clip(goals.speed * (1 + gait.trim), least, most)
        speed = np.select([walking, turning], [speed, self.turn_speed], 0.0)
        return Targets(place, speed.astype(np.float32), facing)

    def _ahead(self, hips: Float, goals: GoalColumns) -> Float:
        """What to walk to [A, 2]: the goal or, near one to pass through, a point beyond it.

        So nobody slows to meet it. Where the path turns the point is nearer: no corner is cut.
        """
        distance = row_length(goals.position[:, :2] - hips)
        lookahead = np.maximum(self.lookahead, self.lookahead_seconds * goals.speed)
        beyond = np.maximum(lookahead * np.cos(goals.bend) - distance, 0) * goals.through
        return goals.position[:, :2] + goals.onward * beyond[:, None]

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
        """Noise [A, K, 128] at each mode's temperature, of what is drawn for the step [A, K, 128]
        and what is each agent's own [A, 128], both ~ N(0, I).
        """
        share, scale = self._tables.own[mode], self._tables.temperature[mode]
        new, kept = scale * np.sqrt(1 - share), scale * np.sqrt(share)
        return new[:, None, None] * drawn + (kept[:, None] * own)[:, None]

    @cached_property
    def _tables(self) -> Tables:
        return Tables.of(self.searches)

    def _rest(self, gait: Gait, path: Float) -> Float:
        """Where an agent that begins to brake now would come to rest [A, 2]."""
        direction = path[:, -1, :2] - path[:, 0, :2]
        length = np.maximum(row_length(direction)[:, None], 1e-6)
        return path[:, -1, :2] + direction / length * self.coasting_seconds * gait.speed[:, None]


def _walks(gait: Gait) -> Flags:
    walks: Flags = (gait.mode == Mode.WALKING) | (gait.mode == Mode.STRAFING)
    return walks


def _choose(cases: Sequence[tuple[Flags, Float]], default: Float) -> Float:
    """Rows [A, 2] of the first case that holds [A]."""
    for holds, values in reversed(cases):
        default = np.where(holds[:, None], values, default)
    return default.astype(np.float32)


def observe(gait: Gait, start: Float, translation: Float, goals: GoalColumns) -> Gait:
    """What the step brought: the gait with its speed, and whether the goal has been reached.

    Walkers do not go exactly as fast as the model is asked for, and each errs in a way of its own:
    the *trim* follows the error of those who walk steadily, and `Steering` asks for so much more.

    start [A, 3] is the last frame before the step, translation [A, F, 3] the new frames.
    """
    way = translation[:, -1, :2] - start[:, :2]
    distance = row_length(translation[:, :, :2] - goals.position[:, None, :2])
    there = goals.given & (distance <= goals.radius[:, None]).any(-1)
    speed = row_length(way) / STEP_SECONDS
    lacks = 1 - speed / np.maximum(goals.speed, 1e-3)
    steady = goals.given & _walks(gait)
    steady &= np.abs(lacks) < STEADY
    trim = gait.trim + TRIM_GAIN * np.where(steady, lacks, 0)
    return replace(
        gait,
        speed=speed.astype(np.float32),
        trim=np.clip(trim, -TRIM_MOST, TRIM_MOST).astype(np.float32),
        arrived=gait.arrived | there,
    )
