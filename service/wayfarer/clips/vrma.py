"""Clips as VRM animations (VRMC_vrm_animation 1.0): bones and motion for any VRM, without a body.

A GLB whose nodes stand in the T-pose; the extension maps nodes to humanoid bones. Only
the hips are moved, the others turn: players scale by the hips' height at rest.
"""

from typing import Final

import numpy as np
import pygltflib as gltf

from wayfarer.body.glb import GlbFile, add_joints
from wayfarer.body.skeleton import bone_names
from wayfarer.clips.actor import Actor
from wayfarer.clips.glb import add_motion
from wayfarer.spec import POSED_JOINTS

EXTENSION: Final = "VRMC_vrm_animation"


def vrma_bytes(actor: Actor, title: str = "motion") -> bytes:
    """The motion of one person, all of it in the hips."""
    file = GlbFile()
    document = file.document
    names = bone_names("vrm")
    joints = add_joints(file, actor.body, np.asarray(actor.clip.betas), names)
    animation = gltf.Animation(name=title)
    add_motion(file, animation, actor, joints)
    document.animations.append(animation)
    document.scenes.append(gltf.Scene(nodes=[joints[0]]))
    document.scene = 0
    bones = {names[joint]: {"node": joints[joint]} for joint in range(POSED_JOINTS)}
    document.extensionsUsed = [EXTENSION]
    document.extensions = {
        EXTENSION: {"specVersion": "1.0", "humanoid": {"humanBones": bones}},
    }
    return file.to_bytes()
