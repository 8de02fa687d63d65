"""Clips on a user's own character: its file with the motion in it."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np

from wayfarer.body.library import load_body
from wayfarer.body.proportions import BodyFit, fit_betas
from wayfarer.body.rotation import GLTF_FROM_CORE, gltf_quaternion
from wayfarer.characters.character import Character
from wayfarer.clips.clip import Clip
from wayfarer.clips.files import FileFormat, FileOptions, RootMotion, edited
from wayfarer.errors import InvalidArgument, NotFound
from wayfarer.spec import FPS


def read_character(path: Path, options: FileOptions) -> Character:
    """Raises InvalidArgument when it cannot be animated with these options; NotFound."""
    if options.format is not FileFormat.GLB:
        raise InvalidArgument("a character with its motion is written as .glb", "target")
    if options.root is RootMotion.BONE:
        raise InvalidArgument("a character has its own bones: root is hips or in_place", "root")
    if not path.is_file():
        raise NotFound(f"{path}: there is no such file")
    return Character.read(path)


def body_of(character: Character, gender: str | None = None) -> BodyFit:
    """The body with its proportions. Raises InvalidArgument."""
    joints, floor = character.joints()
    # from glTF's axes into ours; the map is its own inverse
    return fit_betas({b: GLTF_FROM_CORE @ place for b, place in joints.items()}, floor, gender)


def on_character(
    clip: Clip, character: Character, options: FileOptions, title: str, scale: float = 1.0
) -> bytes:
    """The character's file with the clip as its first animation. Raises InvalidArgument.

    `scale`: ratio of the character's size to that of the clip's body. Lengths are multiplied by it
    and times by its square root, as pendulums swing: so do legs of people and animals of any size.
    """
    if scale != 1.0:
        clip = replace(clip, fps=clip.fps / math.sqrt(scale))
        options = replace(options, fps=options.fps or FPS)
    clip, _ = edited(clip, options)
    body = load_body(clip.body, clip.gender)
    rest = body.rest_joints(np.asarray(clip.betas))
    rest[1:] -= rest[body.parents[1:]]
    return character.animate(
        scale * clip.translation @ GLTF_FROM_CORE.T,
        gltf_quaternion(np.asarray(clip.rotations, np.float64)),
        scale * rest @ GLTF_FROM_CORE.T,
        clip.fps,
        title,
        ground=0.0,
    )
