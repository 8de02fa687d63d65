"""Motion as a file in the format of its name, and back."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path
from typing import Final

from wayfarer.body.library import load_body
from wayfarer.clips.actor import Actor
from wayfarer.clips.bvh import bvh_text
from wayfarer.clips.clip import Array, Clip
from wayfarer.clips.edit import RootTrack, check_rate, looped, relative_to, resampled, root_track
from wayfarer.clips.glb import glb_bytes, read_glb
from wayfarer.clips.npz import npz_bytes, read_npz
from wayfarer.clips.usd import require_usd, usd_bytes
from wayfarer.clips.vrma import vrma_bytes
from wayfarer.errors import InvalidArgument, NotFound

READERS = {".glb": read_glb, ".npz": read_npz}


class FileFormat(StrEnum):
    """The format of a file."""

    GLB = "glb"  # bodies with skin, any number of people, a scene
    BVH = "bvh"  # bones of one person, as text
    NPZ = "npz"  # one person, in the layout of AMASS
    VRMA = "vrma"  # one person, for any VRM
    USD = "usd"  # UsdSkel: bodies with skin, any number of people, a scene


class BoneNames(StrEnum):
    """Vocabulary of the bones of GLB, BVH and USD."""

    MIXAMO = "mixamo"  # Hips, LeftUpLeg: engines and Blender add-ons know it
    UNITY = "unity"  # Hips, LeftUpperLeg: HumanBodyBones
    VRM = "vrm"  # hips, leftUpperLeg
    UE = "ue"  # pelvis, thigh_l: Unreal's mannequin
    SMPL = "smpl"  # pelvis, left_hip: as in poses of the API


class RootMotion(StrEnum):
    """The place of the travelled path."""

    HIPS = "hips"  # the hips have all
    BONE = "bone"  # on a bone "root" above the hips: ground point and heading
    IN_PLACE = "in_place"  # nowhere: the person stays over the origin


class BodyDetail(StrEnum):
    """Resolution of the bodies' meshes."""

    HIGH = "high"
    LOW = "low"


class FileUnit(StrEnum):
    """Unit of length of a BVH file."""

    METRES = "m"
    CENTIMETRES = "cm"


MEDIA_TYPES: Final = {
    FileFormat.GLB: "model/gltf-binary",
    FileFormat.BVH: "text/plain; charset=us-ascii",
    FileFormat.NPZ: "application/zip",
    FileFormat.VRMA: "model/gltf-binary",
    FileFormat.USD: "model/vnd.usd",
}
CROWDED: Final = (FileFormat.GLB, FileFormat.USD)
"""Formats of several people, and of a scene."""
NO_ROOT: Final = (FileFormat.NPZ, FileFormat.VRMA)
"""Formats that know no bone above the hips."""
NAMED: Final = "files with the path on a bone are glb, bvh and usd"


@dataclass(frozen=True)
class FileOptions:
    """How motion becomes a file. Raises InvalidArgument if options contradict each other."""

    format: FileFormat = FileFormat.GLB
    names: BoneNames = BoneNames.MIXAMO
    fps: float | None = None  # None: as the motion has it, 40
    root: RootMotion = RootMotion.HIPS
    loop: bool = False  # a cycle of steady walking out of it
    unit: FileUnit = FileUnit.METRES
    detail: BodyDetail = BodyDetail.HIGH

    def __post_init__(self) -> None:
        if self.fps is not None:
            check_rate(self.fps)
        if self.format is FileFormat.USD:
            require_usd()
        if self.root is RootMotion.BONE and self.format in NO_ROOT:
            raise InvalidArgument(f"{self.format} has no bone above the hips; {NAMED}", "root")
        if self.unit is not FileUnit.METRES and self.format is not FileFormat.BVH:
            raise InvalidArgument(f"the unit of {self.format} is the metre; bvh has none", "unit")


@dataclass(frozen=True)
class Performance:
    """One person's motion, under a name."""

    name: str
    clip: Clip
    style: int = 0  # seed of its look
    outfit: str = ""  # see `body.outfit.look`
    start: float = 0.0  # seconds after the file's beginning; before, it stands in its first frame


def encode(
    people: Sequence[Performance],
    options: FileOptions,
    title: str = "motion",
    scene: Array | None = None,
) -> bytes:
    """The file. `title`: name of the animation; `scene`: triangles [T, 3, 3] in world space.

    Raises InvalidArgument when the format cannot hold that, or there is no cycle to loop.
    """
    if not people:
        raise InvalidArgument("there is nobody whose motion a file could hold", "people")
    if len(people) > 1 and options.format not in CROWDED:
        raise InvalidArgument(
            f"{options.format} holds one person, not {len(people)}; glb and usd hold several",
            "format",
        )
    actors = [_actor(person, options) for person in people]
    match options.format:
        case FileFormat.GLB:
            return glb_bytes(actors, options.names, title, scene)
        case FileFormat.USD:
            return usd_bytes(actors, options.names, title, scene)
        case FileFormat.VRMA:
            return vrma_bytes(actors[0], title)
        case FileFormat.BVH:
            scale = 100.0 if options.unit is FileUnit.CENTIMETRES else 1.0
            return bvh_text(actors[0], options.names, scale).encode("ascii")
        case FileFormat.NPZ:
            return npz_bytes(actors[0])


def _actor(person: Performance, options: FileOptions) -> Actor:
    body = load_body(person.clip.body, person.clip.gender, options.detail.value)
    clip, root = edited(person.clip, options)
    kept = root if options.root is RootMotion.BONE else None
    return Actor(
        clip, body, person.name, person.style, person.outfit, root=kept, start=person.start
    )


def edited(clip: Clip, options: FileOptions) -> tuple[Clip, RootTrack | None]:
    """The clip in the form of the file, and the path that was removed from it.

    Raises InvalidArgument when there is no cycle to loop.
    """
    if options.loop:
        clip = looped(clip)
    if options.fps is not None:
        clip = _at_rate(clip, options.fps, options.loop)
    if options.root is RootMotion.HIPS:
        return clip, None
    root = root_track(clip, options.loop)
    return relative_to(clip, root), root


def _at_rate(clip: Clip, fps: float, is_loop: bool) -> Clip:
    """The clip at another rate. A cycle is stretched by less than a frame, to keep its last one."""
    if not is_loop:
        return resampled(clip, fps)
    frames = max(round((clip.frames - 1) / clip.fps * fps), 1)
    fitted = replace(clip, fps=(clip.frames - 1) * fps / frames)
    return replace(resampled(fitted, fps), fps=fps)


def format_of(path: Path) -> FileFormat:
    """The format of a file's name. Raises InvalidArgument."""
    suffix = path.suffix.lower().removeprefix(".")
    suffix = "usd" if suffix == "usdc" else suffix
    if suffix not in list(FileFormat):
        known = ", ".join(f".{name}" for name in FileFormat)
        raise InvalidArgument(f"{path.name}: the name must end in {known}", "target")
    return FileFormat(suffix)


def check_target(path: Path) -> None:
    """Raises InvalidArgument when no format fits the name, or its folder does not exist."""
    format_of(path)
    if not path.parent.is_dir():
        raise InvalidArgument(f"{path}: there is no folder {path.parent}", "target")


def write_clip(
    path: Path, clip: Clip, options: FileOptions | None = None, outfit: str = ""
) -> None:
    """Writes a clip in the format of the file's name. `outfit`: see `look`. Raises as `encode`."""
    check_target(path)
    options = replace(options or FileOptions(), format=format_of(path))
    path.write_bytes(encode([Performance("person", clip, outfit=outfit)], options, path.stem))


def read_clip(path: Path) -> Clip:
    """Reads a clip that Wayfarer wrote as npz or GLB, or an AMASS npz.

    A BVH file is refused: it holds bones without the body around them. Raises InvalidArgument
    for other names, NotFound when there is no such file, DataError when it does not fit.
    """
    read = READERS.get(path.suffix.lower())
    if read is None:
        raise InvalidArgument(f"{path.name}: a clip to read ends in {', '.join(READERS)}", "source")
    if not path.is_file():
        raise NotFound(f"{path}: there is no such file")
    return read(path)
