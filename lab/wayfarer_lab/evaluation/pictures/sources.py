"""Where the clips of a picture come from: files, prepared recordings, random runs."""

from dataclasses import replace
from difflib import get_close_matches
from pathlib import Path

from wayfarer.clips.clip import Clip
from wayfarer.clips.files import read_clip
from wayfarer.errors import InvalidArgument, NotFound
from wayfarer_lab.evaluation.pictures.files import KINDS_OF
from wayfarer_lab.training.mocap.store import Dataset


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
