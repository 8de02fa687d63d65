"""What each agent does next: stand, walk or stop; and what the search is told to look for.

    STANDING ──goal──▶ WALKING ──braking distance──▶ STOPPING ──slow for 0.4 s──▶ STANDING
                          ▲──────not there after all──────┘

Pure functions of columns, vectorised over agents. Everything that is tuned stands in the two
tables at the top.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from wayfarer.runtime.rows import Index
from wayfarer.runtime.slots import Gait, Goals, Mode
from wayfarer.spec import STEP_SECONDS
from wayfarer.terms import STAND, WALK, weights

Float = NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class Search:
    """How candidates are drawn and judged in one mode."""

    weights: Mapping[str, float]
    candidates: int  # K
    temperature: float  # scale of the latent noise
    zero_latent: bool = False  # candidate 0 is the zero latent, the most usual motion


def default_searches() -> dict[Mode, Search]:
    """The search of each mode.

    Modes of different K go into batches of their own, which costs more than it saves.
    """
    return {
        Mode.STANDING: Search(STAND, candidates=8, temperature=1.0, zero_latent=True),
        Mode.WALKING: Search(WALK, candidates=8, temperature=1.3),
        Mode.STOPPING: Search(STAND, candidates=8, temperature=1.3, zero_latent=True),
    }


@dataclass(frozen=True, slots=True)
class Steering:
    """Distances in metres, horizontal; speeds in m/s; times in s."""

    searches: Mapping[Mode, Search] = field(default_factory=default_searches)
    braking_seconds: float = 0.35  # braking distance = min(radius / 2, 0.15) + this × speed
    braking_margin: float = 0.15
    slowing_distance: float = 1.0  # from here on the target speed falls with the distance …
    slowest: float = 0.5  # … down to this
    slow: float = 0.15  # below this an agent counts as slow
    slow_seconds: float = 0.4  # slow for so long: it stands
    resume_margin: float = 0.3  # stopped or pushed so far outside the goal's radius: walk again
    drift: float = 0.35  # standing this far from its place, an agent is drawn back to it

    def with_candidates(self, candidates: int) -> "Steering":
        """The same with so many candidates in every mode."""
        searches = {m: replace(s, candidates=candidates) for m, s in self.searches.items()}
        return replace(self, searches=searches)

    def decide(self, gait: Gait, path: Float, goals: Goals) -> Gait:
        """The gait of the next step, from the gait so far and the seed's hips `path` [A, S, 3]."""
        hips = path[:, -1, :2]
        distance = np.linalg.norm(goals.position[:, :2] - hips, axis=-1)
        braking = (
            np.minimum(goals.radius / 2, self.braking_margin) + self.braking_seconds * gait.speed
        )
        walking = gait.mode == Mode.WALKING
        stopping = gait.mode == Mode.STOPPING
        standing = gait.mode == Mode.STANDING

        is_slow = stopping & (gait.speed < self.slow)
        slow_seconds = np.where(is_slow, gait.slow_seconds + STEP_SECONDS, 0.0)
        still = stopping & (slow_seconds >= self.slow_seconds - 1e-3)

        missed = goals.given & ~gait.arrived
        strayed = goals.given & (distance > np.maximum(goals.radius, braking) + self.resume_margin)
        walks = (
            (walking & goals.given & (distance > braking))
            | ((still | standing) & missed)
            | ((stopping | standing) & strayed)
        )
        stands = (standing | still) & ~walks
        mode = np.where(walks, Mode.WALKING, np.where(stands, Mode.STANDING, Mode.STOPPING))

        # Without a goal an agent stops as soon as it can; then it stands where it came to rest.
        brakes = walking & ~walks
        rest = np.where(goals.given[:, None], goals.position[:, :2], self._rest(gait, path))
        stop_place = np.where(brakes[:, None], rest, gait.stop_place)
        stop_place = np.where((still & stands)[:, None], hips, stop_place)
        return Gait(
            mode=mode.astype(np.int8),
            speed=gait.speed,
            slow_seconds=slow_seconds.astype(np.float32),
            stop_place=stop_place.astype(np.float32),
            arrived=gait.arrived,
        )

    def targets(self, gait: Gait, path: Float, goals: Goals) -> tuple[Float, Float]:
        """Target place [A, 3] and target speed [A] of the next step, which `gait` is for."""
        hips = path[:, -1, :2]
        distance = np.linalg.norm(goals.position[:, :2] - hips, axis=-1)
        walking = gait.mode == Mode.WALKING
        standing = gait.mode == Mode.STANDING
        at_place = np.linalg.norm(gait.stop_place - hips, axis=-1) <= self.drift
        place = np.where(walking[:, None], goals.position[:, :2], gait.stop_place)
        # Standing within reach of its place an agent is not pulled anywhere: it would fidget.
        place = np.where((standing & at_place)[:, None], hips, place)
        target = goals.position.copy()
        target[:, :2] = place

        slowing = goals.speed * distance / self.slowing_distance
        speed = np.minimum(goals.speed, np.maximum(slowing, self.slowest))
        return target, np.where(walking, speed, 0.0).astype(np.float32)

    def term_weights(self, mode: NDArray[np.int8]) -> Float:
        """Weights [A, T] in the order of `terms.TERMS`."""
        table = np.array([weights(dict(self.searches[m].weights)) for m in Mode], np.float32)
        return table[mode]

    def candidates(self, mode: NDArray[np.int8]) -> Index:
        """Number of candidates K for each agent [A]."""
        return np.array([self.searches[m].candidates for m in Mode])[mode]

    def scale_noise(self, mode: NDArray[np.int8], noise: Float) -> Float:
        """Standard normal `noise` [A, K, 128] at each mode's temperature."""
        temperature = np.array([self.searches[m].temperature for m in Mode], np.float32)
        zero = np.array([self.searches[m].zero_latent for m in Mode])
        scaled = noise * temperature[mode][:, None, None]
        scaled[zero[mode], 0] = 0.0
        return scaled

    def _rest(self, gait: Gait, path: Float) -> Float:
        """Where an agent that begins to brake now would come to rest [A, 2]."""
        direction = path[:, -1, :2] - path[:, 0, :2]
        length = np.maximum(np.linalg.norm(direction, axis=-1, keepdims=True), 1e-6)
        return path[:, -1, :2] + direction / length * self.braking_seconds * gait.speed[:, None]


def observe(gait: Gait, start: Float, translation: Float, goals: Goals) -> Gait:
    """What the step brought: the gait with its speed, and whether the goal has been reached.

    start [A, 3] is the last frame before the step, translation [A, F, 3] the new frames.
    """
    way = translation[:, -1, :2] - start[:, :2]
    distance = np.linalg.norm(translation[:, :, :2] - goals.position[:, None, :2], axis=-1)
    there = goals.given & (distance <= goals.radius[:, None]).any(-1)
    return replace(
        gait,
        speed=(np.linalg.norm(way, axis=-1) / STEP_SECONDS).astype(np.float32),
        arrived=gait.arrived | there,
    )
