"""A clip to a file of the form that its name asks for, and back."""

from pathlib import Path

from wayfarer.body.library import load_body
from wayfarer.clips.bvh import write_bvh
from wayfarer.clips.clip import Clip
from wayfarer.clips.glb import read_glb, write_glb
from wayfarer.clips.npz import read_npz, write_npz
from wayfarer.errors import InvalidArgument, NotFound

WRITERS = {".glb": write_glb, ".bvh": write_bvh, ".npz": write_npz}
READERS = {".glb": read_glb, ".npz": read_npz}


def check_target(path: Path) -> None:
    """Raises InvalidArgument when no writer fits the name, or its folder does not exist."""
    if path.suffix.lower() not in WRITERS:
        raise InvalidArgument(f"{path.name}: the name must end in {', '.join(WRITERS)}", "target")
    if not path.parent.is_dir():
        raise InvalidArgument(f"{path}: there is no folder {path.parent}", "target")


def write_clip(path: Path, clip: Clip) -> None:
    """Write the clip as GLB, BVH or npz. Raises InvalidArgument as `check_target`."""
    check_target(path)
    WRITERS[path.suffix.lower()](path, clip, load_body(clip.body, clip.gender))


def read_clip(path: Path) -> Clip:
    """Read a clip that Wayfarer wrote as npz or GLB, or an AMASS npz.

    A BVH file is refused: it holds bones without the body around them. Raises InvalidArgument
    for other names, NotFound when there is no such file, DataError when it does not fit.
    """
    read = READERS.get(path.suffix.lower())
    if read is None:
        raise InvalidArgument(f"{path.name}: a clip to read ends in {', '.join(READERS)}", "source")
    if not path.is_file():
        raise NotFound(f"{path}: there is no such file")
    return read(path)
