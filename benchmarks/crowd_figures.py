"""Figures of a crowd's tracks."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.bench import Row
from benchmarks.crowd_cases import SPEED, Case
from wayfarer_lab.evaluation.scenes.overlap import segment_distance

Array = NDArray[np.float64]

RATE = 10.0
"""Samples of a track per second."""

WIDTH, DEPTH = 0.42, 0.22
"""Size of a body from above in metres, as a capsule across its facing."""

OVERLAPS = 0.01, 0.05
"""Metres by which bodies touch, and stand in each other."""

STILL = 0.3
"""Metres of progress below which an agent stands still."""

DOORWAY = 0.6
"""Metres from the door's line within which a person is in the door."""

WAITS = 4.0
"""Metres from the door's line within which a person waits for it."""


@dataclass(frozen=True)
class Tracks:
    """Places of people, ten times per second."""

    place: Array  # [T, N, 2] metres
    facing: Array | None  # [T, N, 2] unit vectors; None: not known, bodies are discs
    reached: Array  # [N] seconds at which they were at their goals; inf: never
    events: Counter[str]
    told: list[tuple[float, int]]  # seconds at which `BLOCKED` came, and about whom
    wall_s: float  # seconds of the computer


def figures(case: Case, tracks: Tracks) -> Row:
    """The figures of one run."""
    walkers = np.array([k for k in range(len(case.goals)) if case.goals[k] is not None])
    reached = tracks.reached[walkers]
    row: Row = {
        "there": f"{int(np.isfinite(reached).sum())}/{len(walkers)}",
        "all_s": float(reached.max()) if np.isfinite(reached).all() else None,
    }
    row["after_s"] = float(np.ptp(reached)) if np.isfinite(reached).all() else None
    row |= dict.fromkeys(("through_s", "flow", "per_m", "door_idle_s"))
    if case.door is not None:
        row |= door_figures(case.door, tracks.place[:, walkers])
    row["m/s"] = mean_speed(tracks.place[:, walkers], reached)
    if case.stream is not None:
        row |= stream_figures(case.stream, tracks.place[:, walkers])
    row["still_s"] = longest_still(tracks.place[:, walkers], reached)
    told = [(at, int(np.flatnonzero(walkers == who)[0])) for at, who in tracks.told]
    row["untold_s"] = longest_still(tracks.place[:, walkers], reached, told)
    row["overlap_cm"], row["overlap_%"], row["deep_%"] = overlap(tracks)
    row["walked_on_m"] = walked_after(tracks.place[:, walkers], reached)
    row["events"] = " ".join(f"{name} {count}" for name, count in sorted(tracks.events.items()))
    row["wall_s"] = tracks.wall_s
    return row


def door_figures(door: float, place: Array) -> Row:
    """Flow through the door in people per second, also per metre; and the time for which it was
    empty although somebody waited before it.
    """
    side = np.sign(place[0, :, 1])
    through = (place[..., 1] * side) < 0  # [T, N]
    crossed = np.where(through.any(0), through.argmax(0), -1)
    times = np.sort(crossed[crossed >= 0]) / RATE
    flow = float((len(times) - 1) / (times[-1] - times[0])) if len(times) > 1 else None
    busy = (np.abs(place[..., 1]) < DOORWAY) & (np.abs(place[..., 0]) < door / 2 + 0.1)
    moved = moved_within(place, 2.0)
    waits = ~through & (np.abs(place[..., 1]) < WAITS) & (moved < STILL)
    idle = ~busy.any(1) & waits.any(1)
    return {
        "through_s": float(times[-1]) if len(times) == place.shape[1] else None,
        "flow": flow,
        "per_m": None if flow is None else flow / door,
        "door_idle_s": longest(idle[:, None]),
    }


def moved_within(place: Array, seconds: float) -> Array:
    """Metres by which people have moved within the last `seconds`. [T, N]"""
    back = round(seconds * RATE)
    before = np.concatenate([np.repeat(place[:1], back, 0), place])[: len(place)]
    found: Array = np.linalg.norm(place - before, axis=-1)
    found[:back] = np.inf
    return found


def mean_speed(place: Array, reached: Array) -> float | None:
    """Mean m/s of those on their way, each over a second, from 3 to 15 s after the start."""
    second = round(RATE)
    speed = np.linalg.norm(place[second:] - place[:-second], axis=-1)  # of the second that begins
    on = (np.arange(len(speed))[:, None] + second) / RATE < reached
    window = slice(3 * second, 15 * second)
    known = on[window] & np.isfinite(speed[window])
    return float(speed[window][known].mean()) if known.any() else None


def stream_figures(width: float, place: Array) -> Row:
    """People per m² and m/s of the middle half of a stream along y, from 4 s after the start on.

    Its front disperses. Also the speed that Weidmann's fundamental diagram has at that density.
    """
    second, quarter = round(RATE), place.shape[1] // 4
    densities, speeds = [], []
    for now, then in zip(place[4 * second : -second], place[5 * second :], strict=True):
        middle = now[:, 1].argsort()[quarter:-quarter]
        densities.append((len(middle) - 1) / (width * np.ptp(now[middle, 1])))
        speeds.append(np.linalg.norm(then[middle] - now[middle], axis=-1).mean())
    density = float(np.mean(densities))
    diagram = SPEED * (1 - np.exp(-1.913 * (1 / density - 1 / 5.4)))
    return {"m/s": float(np.mean(speeds)), "per_m2": density, "diagram_m/s": float(diagram)}


def longest(holds: Array) -> float:
    """Longest run of True in any column, seconds."""
    best = run = np.zeros(holds.shape[1])
    for line in holds:
        run = np.where(line, run + 1, 0)
        best = np.maximum(best, run)
    return float(best.max(initial=0)) / RATE


def longest_still(place: Array, reached: Array, told: Sequence[tuple[float, int]] = ()) -> float:
    """Longest time for which a person before its goal has not advanced by `STILL`. What follows an
    event that `told` it (seconds, and the person) does not count.
    """
    anchor, since, most = place[0].copy(), np.zeros(place.shape[1]), 0.0
    for step, line in enumerate(place):
        on = (np.linalg.norm(line - anchor, axis=-1) > STILL) | (step / RATE >= reached)
        anchor[on] = line[on]
        since = np.where(on, 0, since + 1 / RATE)
        since[[who for at, who in told if round(at * RATE) == step]] = -np.inf  # until it moves on
        most = max(most, float(since.max(initial=0)))
    return most


def overlap(tracks: Tracks) -> tuple[float | None, float | None, float | None]:
    """Maximum depth of two overlapping bodies, cm, and the shares of bodies and times, %, that
    overlap by more than each of `OVERLAPS`.
    """
    place, facing = tracks.place, tracks.facing
    if facing is None or place.shape[1] < 2:
        return None, None, None
    across = np.stack([facing[..., 1], -facing[..., 0]], -1) * (WIDTH - DEPTH) / 2
    one, other = np.triu_indices(place.shape[1], 1)
    deepest, bodies = 0.0, [0, 0]
    for line, side in zip(place, across, strict=True):
        near = np.linalg.norm(line[one] - line[other], axis=-1) < WIDTH
        a, b = one[near], other[near]
        apart = segment_distance(
            line[a] - side[a], line[a] + side[a], line[b] - side[b], line[b] + side[b]
        )
        depth = DEPTH - apart
        deepest = max(deepest, float(depth.max(initial=0)))
        for k, least in enumerate(OVERLAPS):
            bodies[k] += len(np.unique(np.concatenate([a[depth > least], b[depth > least]])))
    some, deep = (100 * count / (place.shape[0] * place.shape[1]) for count in bodies)
    return 100 * deepest, some, deep


def walked_after(place: Array, reached: Array) -> float | None:
    """Maximum metres that a person walked later than 15 s after the first arrival."""
    if not np.isfinite(reached).any():
        return None
    start = round((reached.min() + 15) * RATE)
    rough = place[start :: round(RATE)]
    if len(rough) < 2:
        return None
    return float(np.linalg.norm(np.diff(rough, axis=0), axis=-1).sum(0).max())
