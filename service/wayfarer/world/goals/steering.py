"""What each agent does next: stand, walk, stop or turn; and what its search looks for.

    STANDING ──goal──▶ WALKING ──braking distance──▶ STOPPING ──slow for 0.4 s──▶ STANDING
                          ▲──────not there after all──────┘  ▲
                                                             └─faces its heading─ TURNING

An agent at rest (stopping or standing) that does not face its heading is TURNING until it does.
Goals to pass through cause no braking. An agent whose goal comes to lie behind it stops, turns on
the spot and walks on: on a curve as tight as that it would lean by 30 degrees and more.

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
from wayfarer.terms import STAND, TURN, WALK, weights
from wayfarer.world.agents.goal import GoalColumns
from wayfarer.world.agents.heading import angle_between, facing_of
from wayfarer.world.agents.slots import Gait, Mode, Seeds
from wayfarer.world.agents.style import STRIDE
from wayfarer.world.output.quaternion import row_length
from wayfarer.world.rows import Flags, Float, Index


@dataclass(frozen=True, slots=True)
class Search:
    """How candidates are drawn and judged in one mode."""

    weights: Mapping[str, float]
    candidates: int  # K
    temperature: float  # scale of the latent noise
    policy: float = 1.0  # share of the learned policy in the latents; 0: the prior alone
    zero_latent: bool = False  # candidate 0 has no noise: the policy's mean, or the zero latent
    manner: float = 0.0  # scale of the agent's own latent, which is added to all noise


MANNER: Final = 1.3
"""`Search.manner` of walking: how much agents differ."""


TRIM_GAIN: Final = 0.12
"""Share of a speed error that a step adds to the trim."""

TRIM_MOST: Final = 0.15
"""Bound of the trim, either way."""

STEADY: Final = 0.3
"""Share of the target speed: who is off it by more is setting off or slowing, and not trimmed."""


def default_searches() -> dict[Mode, Search]:
    """The search of each mode.

    Modes of different K go into batches of their own, which costs more than it saves.
    """
    return {
        Mode.STANDING: Search(STAND, candidates=4, temperature=0.5, zero_latent=True),
        Mode.WALKING: Search(WALK, candidates=4, temperature=0.7, zero_latent=True, manner=MANNER),
        Mode.STOPPING: Search(STAND, candidates=4, temperature=0.7, zero_latent=True),
        Mode.TURNING: Search(TURN, candidates=4, temperature=0.7, zero_latent=True),
        Mode.STRAFING: Search(STAND, candidates=4, temperature=0.7, zero_latent=True),
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
    zero_latent: Flags
    manner: Float

    @classmethod
    def of(cls, searches: Mapping[Mode, Search]) -> "Tables":
        """Raises KeyError on an unknown quality term."""
        ordered = [searches[mode] for mode in Mode]
        return cls(
            weights=np.array([weights(dict(s.weights)) for s in ordered], np.float32),
            candidates=np.array([s.candidates for s in ordered]),
            policy=np.array([s.policy for s in ordered], np.float32),
            temperature=np.array([s.temperature for s in ordered], np.float32),
            zero_latent=np.array([s.zero_latent for s in ordered]),
            manner=np.array([s.manner for s in ordered], np.float32),
        )


@dataclass(frozen=True)
class Steering:
    """Distances in metres, horizontal; speeds in m/s; times in s; angles in radians."""

    searches: Mapping[Mode, Search] = field(default_factory=default_searches)
    braking_seconds: float = 0.1  # braking distance = min(radius / 2, 0.15) + this × speed
    braking_margin: float = 0.15
    slowing_distance: float = 0.7  # within this distance the target speed falls with it
    slowest: float = 0.7  # lowest target speed before a stop
    acceleration: float = 2.0  # m/s²: nobody is asked for full speed at once
    coasting_seconds: float = 0.35  # without a goal an agent comes to rest in this × speed
    sharp: float = radians(60)  # a path that turns by more is passed at `corner_speed`
    corner_speed: float = 0.7
    pausing: float = 0.5  # share of the asked speed below which a walker at its goal stops there
    slow: float = 0.15  # below this an agent counts as slow
    slow_seconds: float = 0.4  # an agent that has been slow for this long stands
    resume_margin: float = 0.3  # stopped or pushed so far outside the goal's radius: walk again
    lookahead: float = 1.0  # a point to pass through is aimed at so far ahead
    behind: float = radians(120)  # at rest, an agent first turns to a goal farther aside …
    abeam: float = radians(70)  # … until it is so far aside
    faced: float = radians(8)  # turning ends when the heading is met within this …
    astray: float = radians(14)  # … and begins when it is missed by more
    turn_ahead: float = radians(40)  # largest part of a turn on the spot that one step asks for
    reactions: int = 3  # a standing agent sets off at its own one of this many steps
    side_step_speed: float = 0.6  # at most, when it faces elsewhere than where it goes …
    side_step_acceleration: float = 1.0  # … m/s² …
    side_step_faced: float = radians(20)  # … and only once it faces that way

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

        Who stands with planted feet and is not `ready` [A] stands on; None: all are.
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
        paused = gait.speed < self.pausing * np.minimum(goals.speed, self.slowest)
        paused &= gait.mode == Mode.WALKING
        far = (distance > braking) & ~(gait.arrived & (is_slow | paused))
        at_rest = still | standing | turning | (walking & is_slow)

        waits = np.zeros_like(missed) if ready is None else ~ready
        waits &= gait.planted & is_slow & (standing | (gait.mode == Mode.WALKING))
        missed, strayed = missed & ~waits, strayed & ~waits

        facing = facing_of(seed.rotations[:, -1, 0])
        direction = way / np.maximum(distance, 1e-6)[:, None]
        aside = angle_between(facing, direction)
        behind = aside > np.where(turning, self.abeam, self.behind)
        reverses = missed & far & behind & ~goals.strafe
        about = reverses & (at_rest | is_slow)
        walks = (
            (walking & holds & (goals.through | far) & ~waits)
            | ((still | standing | turning) & missed)
            | (~walking & strayed)
        ) & ~reverses
        has_heading = goals.given & goals.heading.any(-1) & ~waits
        off = angle_between(facing, goals.heading)
        astray = has_heading & (off > np.where(turning, self.faced, self.astray))
        # Side steps begin at rest, and facing as asked.
        side_steps = walks & goals.strafe & (gait.mode == Mode.STRAFING)
        faces = off < np.where(turning, self.faced, self.side_step_faced)
        side_steps |= walks & goals.strafe & at_rest & faces
        turns_first = walks & goals.strafe & at_rest & ~side_steps
        stops_first = walks & goals.strafe & ~at_rest & ~side_steps
        walks &= ~(turns_first | stops_first)
        turns = about | turns_first | (at_rest & astray & ~walks)
        stands = waits | (standing | still) & ~walks & ~turns
        mode = np.select(
            [side_steps, walks, turns, stands],
            [Mode.STRAFING, Mode.WALKING, Mode.TURNING, Mode.STANDING],
            Mode.STOPPING,
        )

        # Without a goal an agent stops as soon as it can; then it stands where it came to rest.
        brakes, rests = walking & ~walks & ~waits, still & ~walks
        turns_away = (about | turns_first) & ~turning
        reaches = holds & ~reverses & ~stops_first
        # The steps of a turn at a goal take an agent nearer to it.
        faces_there = turns & holds & gait.arrived & ~about & ~turns_first
        rest = np.where(reaches[:, None], goals.position[:, :2], self._rest(gait, seed.translation))
        return replace(
            gait,
            mode=mode.astype(np.int8),
            slow_seconds=slow_seconds.astype(np.float32),
            planted=gait.planted & (mode != Mode.WALKING) & (mode != Mode.TURNING),
            stop_place=_choose(
                [
                    (faces_there, goals.position[:, :2]),
                    (rests | turns_away, hips),
                    (brakes, rest),
                ],
                gait.stop_place,
            ),
            # A stopping agent keeps its facing, unless another heading is asked for.
            stop_facing=_choose(
                [
                    (about, direction),
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
        facing = facing_of(seed.rotations[:, -1, 0])
        turned = _turned_towards(facing, gait.stop_facing, self.turn_ahead)
        side_steps = gait.mode == Mode.STRAFING  # the body stands, and is carried; see `carried`
        place = _choose([(side_steps, hips), (walking, self._ahead(hips, goals))], gait.stop_place)
        speed = np.where(walking & ~side_steps, self._speed(hips, gait, goals), 0.0)
        return Targets(
            place=place,
            speed=speed.astype(np.float32),
            facing=_choose(
                [
                    (gait.mode == Mode.TURNING, turned),
                    (~walking, gait.stop_facing),
                    (side_steps, goals.heading),
                ],
                np.zeros_like(goals.heading),
            ),
        )

    def carried(self, gait: Gait, seed: Seeds, goals: GoalColumns) -> Float:
        """Velocity [A, 2] at the end of the step, m/s, of bodies that go in side steps.

        0 for all others, who come to rest by degrees if they have just gone in them.
        """
        way = self._ahead(seed.translation[:, -1, :2], goals) - seed.translation[:, -1, :2]
        distance = row_length(way)
        target = np.minimum(goals.speed, self.side_step_speed)
        slowing = np.where(goals.through, target, distance / (2 * STEP_SECONDS))
        speed = np.minimum(target, slowing) * (gait.mode == Mode.STRAFING)
        change = way * (speed / np.maximum(distance, 1e-6))[:, None] - gait.carried
        most = self.side_step_acceleration * STEP_SECONDS
        length = np.maximum(row_length(change), 1e-9)
        carried = gait.carried + change * np.minimum(1, most / length)[:, None]
        return carried.astype(np.float32)

    def _ahead(self, hips: Float, goals: GoalColumns) -> Float:
        """What to walk to [A, 2]: the goal or, near one to pass through, a point beyond it.

        So nobody slows to meet it. Where the path turns the point is nearer: no corner is cut.
        """
        distance = row_length(goals.position[:, :2] - hips)
        beyond = np.maximum(self.lookahead * np.cos(goals.bend) - distance, 0) * goals.through
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

    def draws_noise(self, mode: NDArray[np.int8], candidates: int) -> Flags:
        """Which agents [A] have a use for noise: not those whose only candidate is without it."""
        drawn: Flags = ~self._tables.zero_latent[mode] | (candidates > 1)
        return drawn

    def scale_noise(self, mode: NDArray[np.int8], noise: Float, manner: Float) -> Float:
        """Standard normal `noise` [A, K, 128] at each mode's temperature, around the share that it
        has of each agent's own `manner` [A, 128].
        """
        scaled = noise * self._tables.temperature[mode][:, None, None]
        scaled[self._tables.zero_latent[mode], 0] = 0.0
        return scaled + (self._tables.manner[mode][:, None] * manner)[:, None]

    @cached_property
    def _tables(self) -> Tables:
        return Tables.of(self.searches)

    def _speed(self, hips: Float, gait: Gait, goals: GoalColumns) -> Float:
        """Target speed on the way [A]: less at the start, before a stop, and at a corner."""
        distance = row_length(goals.position[:, :2] - hips)
        # The model does not know that its steps are shortened: by habit, which costs no speed, …
        habit = np.where(goals.tread > 0, 0, np.clip(gait.shortened, *STRIDE))
        target = goals.speed * (1 + gait.trim) / (1 - habit)
        at_goal = np.where(goals.bend > self.sharp, self.corner_speed, target)
        at_goal = np.where(goals.through, at_goal, self.slowest)
        slowing = target * distance / self.slowing_distance
        # … and on stairs, which does.
        more = self.acceleration * STEP_SECONDS / (1 - habit)
        reachable = gait.speed / (1 - gait.shortened) + more
        return np.minimum(np.minimum(target, reachable), np.maximum(slowing, at_goal))

    def _rest(self, gait: Gait, path: Float) -> Float:
        """Where an agent that begins to brake now would come to rest [A, 2]."""
        direction = path[:, -1, :2] - path[:, 0, :2]
        length = np.maximum(row_length(direction)[:, None], 1e-6)
        return path[:, -1, :2] + direction / length * self.coasting_seconds * gait.speed[:, None]


def _walks(gait: Gait) -> Flags:
    walks: Flags = (gait.mode == Mode.WALKING) | (gait.mode == Mode.STRAFING)
    return walks


def _turned_towards(facing: Float, asked: Float, most: float) -> Float:
    """Unit vectors `facing` [A, 2] turned towards those `asked`, by `most` radians at most.

    Asked for half a turn at once, a body would whirl round at 220 degrees a second.
    """
    crossed = facing[:, 0] * asked[:, 1] - facing[:, 1] * asked[:, 0]
    angle = np.clip(np.arctan2(crossed, (facing * asked).sum(-1)), -most, most)
    cos, sin = np.cos(angle), np.sin(angle)
    x, y = facing.T
    return np.stack([cos * x - sin * y, sin * x + cos * y], -1).astype(np.float32)


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
    steady = goals.given & (gait.mode == Mode.WALKING) & (gait.shortened <= STRIDE[1])
    steady &= np.abs(lacks) < STEADY
    trim = gait.trim + TRIM_GAIN * np.where(steady, lacks, 0)
    return replace(
        gait,
        speed=speed.astype(np.float32),
        trim=np.clip(trim, -TRIM_MOST, TRIM_MOST).astype(np.float32),
        arrived=gait.arrived | there,
    )
