"""Where the clips of a picture come from: files, prepared recordings, random runs."""

from dataclasses import replace
from difflib import get_close_matches
from math import cos, sin, tau
from pathlib import Path
from typing import Final

import numpy as np

from wayfarer.clips.clip import Clip
from wayfarer.clips.files import read_clip
from wayfarer.clips.generate import generate_clip
from wayfarer.errors import InvalidArgument, NotFound
from wayfarer.spec import FPS, GENDERS
from wayfarer.world.agents.goal import Goal
from wayfarer.world.world import World
from wayfarer_lab.evaluation.pictures.files import KINDS_OF
from wayfarer_lab.evaluation.pictures.stills import Watch
from wayfarer_lab.evaluation.tasks import random_specs
from wayfarer_lab.training.mocap.store import Dataset

DISTANCE: Final = (2.0, 6.0)
"""Metres to the next goal of a random run."""


def read_files(paths: list[Path]) -> dict[str, Clip]:
    """Clips by the names of their files. Raises as `read_clip`."""
    for path in paths:
        if path.suffix.lower() in KINDS_OF:
            raise InvalidArgument(f"{path} is no clip; to draw into it: --out {path}", "sources")
    return {str(path): read_clip(path) for path in paths}


def recorded(folder: Path, names: list[str]) -> dict[str, Clip]:
    """Clips of a prepared data folder in their own shape.

    Raises NotFound, with the nearest names, when there is no such clip; DataError for a folder
    that was not prepared.
    """
    data = Dataset.load(folder)
    known = {clip.name: clip for clip in reversed(data.clips) if clip.shape == "own"}
    found = {}
    for name in names:
        if name not in known:
            near = get_close_matches(name, known, n=5, cutoff=0.0)
            raise NotFound(f"{folder} has no clip {name!r}; the nearest: {', '.join(near)}")
        clip = known[name]
        frames = slice(clip.start, clip.stop)
        found[name] = Clip(
            data.translation[frames],
            data.rotations[frames],
            data.contacts[frames],
            clip.gender,
            clip.betas,
        )
    return found


def cut(name: str, clip: Clip, start: float, seconds: float | None) -> Clip:
    """The part of a clip from `start` on. Raises InvalidArgument when nothing is left."""
    first = round(start * clip.fps)
    last = clip.frames if seconds is None else first + max(round(seconds * clip.fps), 1)
    if first >= clip.frames:
        raise InvalidArgument(
            f"{name} is {clip.seconds:.1f} s long; nothing is left from {start:g} s on", "start"
        )
    return replace(clip[first:last], meta=clip.meta)


def random_runs(
    world: World,
    count: int,
    seed: int,
    stops: int = 1,
    seconds: float = 12.0,
    watch: Watch = lambda done, total: None,
) -> list[Clip]:
    """People of both genders in turn, of random shape and heading, each sent to `stops` goals.

    Run i depends on `seed` and i alone, not on `count`. A run ends 1 s after the last stand, or
    at the limit of seconds.
    """
    made = []
    for number in range(count):
        random = np.random.default_rng([seed, number])
        [spec] = random_specs(1, random)
        goals, (x, y) = [], spec.position
        for _ in range(stops):
            angle, distance = random.uniform(0, tau), random.uniform(*DISTANCE)
            x, y = float(x + distance * cos(angle)), float(y + distance * sin(angle))
            goals.append(Goal((x, y, 0.0)))
        spec = replace(spec, gender=GENDERS[number % len(GENDERS)])
        made.append(generate_clip(world, spec, goals)[: round(seconds * FPS)])
        watch(number + 1, count)
    return made


def caption(name: str, clip: Clip) -> str:
    """Describes a clip in a line: who, how long, and how near to its last goal it ends."""
    parts = [name, clip.gender, f"{clip.seconds:.1f} s"]
    if clip.goals:
        left = np.linalg.norm(clip.translation[-1, :2] - np.array(clip.goals[-1][:2]))
        parts.append(f"ends {left:.2f} m from its goal")
    return "  ·  ".join(parts)
