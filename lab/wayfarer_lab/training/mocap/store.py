"""The prepared data set: flat arrays over all frames, and ranges that say which clip is where.

One file, `motion.npz`: arrays per frame, `meta` (JSON: format, fps, one entry per clip), and
where primitives and rollouts may start. Metres, Z up, quaternions x, y, z, w, 40 fps.
"""

import json
import os
import re
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.errors import DataError
from wayfarer.spec import FPS, NEW_FRAMES, POSED_JOINTS, PRIMITIVE_FRAMES, SEED_FRAMES
from wayfarer_lab.training.mocap.rig import MIRROR

FILE = "motion.npz"
FORMAT = 1
ROLLOUT_PRIMITIVES = 10
ROLLOUT_FRAMES = SEED_FRAMES + ROLLOUT_PRIMITIVES * NEW_FRAMES
"""10 primitives that each share 2 frames with the one before: 82 frames, 2.05 s."""

STYLED: Final = re.compile(r"([A-Za-z]+)_(?:[FBS][WR]|ID|TR\d)(?![A-Za-z])")
"""Names of takes of 100STYLE: the style, and what is done in it."""

PLAIN_STYLES: Final = ("Neutral", "Rushed")


@dataclass(frozen=True)
class ClipRange:
    """One clip's frames [start, stop) and what is known of it."""

    start: int
    stop: int
    name: str
    source: str  # clip of the recording
    subject: str
    split: str  # train, validation, heldout
    category: str
    locomotion: bool
    gender: str
    betas: tuple[float, ...]
    shape: str  # "own" proportions or "random"
    augmentation: str  # "" as recorded

    @property
    def style(self) -> str:
        """`Style_Content` for a take of 100STYLE, "" for any other."""
        found = STYLED.match(self.name)
        return found[1] if found else ""

    @property
    def acted(self) -> bool:
        """Whether the take is in an acted style."""
        return self.category == "walk_styled" or self.style not in ("", *PLAIN_STYLES)


@dataclass(frozen=True)
class Dataset:
    """All prepared motion. N frames."""

    translation: NDArray[np.float32]  # [N, 3] hips, world
    rotations: NDArray[np.float32]  # [N, 22, 4] hips in the world, others local to their parent
    contacts: NDArray[np.bool_]  # [N, 2] left, right foot on the floor
    use: NDArray[np.uint8]  # [N] selection.Use; 0 is not to be learnt from
    clips: tuple[ClipRange, ...]

    def windows(self, frames: int) -> NDArray[np.int64]:
        """Start frames of all windows of `frames` frames within one clip, all of them in use."""
        starts = []
        for clip in self.clips:
            good = np.cumsum(np.concatenate([[0], self.use[clip.start : clip.stop] > 0]))
            if len(good) > frames:
                whole = good[frames:] - good[:-frames] == frames
                starts.append(clip.start + np.flatnonzero(whole))
        return np.concatenate(starts) if starts else np.zeros(0, np.int64)

    def save(self, folder: Path) -> None:
        """Writes `motion.npz`; it appears whole or not at all."""
        folder.mkdir(parents=True, exist_ok=True)
        meta = {"format": FORMAT, "fps": FPS, "clips": [asdict(c) for c in self.clips]}
        atomically(
            folder / FILE,
            lambda path: np.savez(
                path,
                translation=self.translation,
                rotations=self.rotations,
                contacts=self.contacts,
                use=self.use,
                primitive_starts=self.windows(PRIMITIVE_FRAMES),
                rollout_starts=self.windows(ROLLOUT_FRAMES),
                meta=np.array(json.dumps(meta)),
            ),
        )

    @classmethod
    def load(cls, folder: Path) -> "Dataset":
        """Reads a prepared folder. Raises DataError when it is not one."""
        path = folder / FILE
        try:
            with np.load(path) as file:
                meta = json.loads(str(file["meta"]))
                arrays = {k: file[k] for k in ("translation", "rotations", "contacts", "use")}
        except (OSError, ValueError, KeyError) as error:
            message = f"not prepared motion ({error}): run `wayfarer data prepare SRC {folder}`"
            raise DataError(message, str(path)) from error
        if meta.get("format") != FORMAT:
            raise DataError(f"format {meta.get('format')}, expected {FORMAT}", str(path))
        clips = tuple(ClipRange(**{**c, "betas": tuple(c["betas"])}) for c in meta["clips"])
        return cls(**arrays, clips=clips)


def mirror(
    translation: NDArray[Any], rotations: NDArray[Any], contacts: NDArray[Any]
) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """Reflects a motion in the plane x = 0: left and right change places.

    translation [..., 3], rotations [..., 22, 4] (x, y, z, w), contacts [..., 2]. Reflecting x
    keeps a rotation's x axis part and its angle's cosine, and negates its y and z parts.
    Mirroring twice gives the motion back.
    """
    if rotations.shape[-2:] != (POSED_JOINTS, 4):
        raise DataError(f"rotations must end in [{POSED_JOINTS}, 4], got {rotations.shape}")
    flipped = translation * np.array([-1, 1, 1], translation.dtype)
    turned = rotations[..., MIRROR, :] * np.array([1, -1, -1, 1], rotations.dtype)
    return flipped, turned, contacts[..., ::-1]


def atomically(path: Path, write: Callable[[Path], object]) -> None:
    """Let `write` fill a temporary file beside `path`, then rename it to `path`."""
    temporary = path.with_name(f".{os.getpid()}-{path.name}")
    try:
        write(temporary)
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)
