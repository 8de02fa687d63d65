"""Clips on the skeleton that a client sends."""

from typing import Final

import numpy as np
from motionmcp.schemas import Joint, Skeleton

from wayfarer.body.library import load_body
from wayfarer.body.proportions import BodyFit, fit_betas
from wayfarer.body.rotation import GLTF_FROM_CORE, gltf_quaternion
from wayfarer.body.skeleton import bone_names
from wayfarer.characters.bone_map import BoneMap, map_bones
from wayfarer.characters.joints import character_joints
from wayfarer.characters.retarget import Retarget
from wayfarer.characters.rig import Node, Rig
from wayfarer.clips.clip import Array, Clip
from wayfarer.errors import InvalidArgument
from wayfarer.spec import POSED_JOINTS

MOST_JOINTS: Final = 1000


def canonical(body_name: str, gender: str = "female") -> Skeleton:
    """The mean body's 22 moving bones in T-pose, with Mixamo's names."""
    body = load_body(body_name, gender)
    rest = body.rest_joints(np.zeros(body.betas)) @ GLTF_FROM_CORE.T
    names = bone_names("mixamo")
    joints = []
    for k, parent in enumerate(body.parents[:POSED_JOINTS].tolist()):
        offset = rest[k] - rest[parent] if parent >= 0 else rest[k]
        joints.append(
            Joint(
                name=names[k],
                parent=names[parent] if parent >= 0 else None,
                rest_translation=tuple(offset.tolist()),
                rest_rotation=(0.0, 0.0, 0.0, 1.0),
            )
        )
    return Skeleton(joints=joints)


def read(skeleton: Skeleton) -> BoneMap:
    """Finds its bones. Raises InvalidArgument that names the missing ones."""
    if len(skeleton.joints) > MOST_JOINTS:
        raise InvalidArgument(f"{len(skeleton.joints)} joints; allowed are {MOST_JOINTS}")
    names = [joint.name for joint in skeleton.joints]
    nodes = []
    for joint in skeleton.joints:
        values = (*joint.rest_translation, *joint.rest_rotation)
        if not np.isfinite(values).all() or np.linalg.norm(joint.rest_rotation) < 1e-6:
            raise InvalidArgument(f"the rest transform of {joint.name!r} is none")
        parent = -1 if joint.parent is None else names.index(joint.parent)
        nodes.append(Node(joint.name, parent, joint.rest_translation, joint.rest_rotation))
    return map_bones(Rig(tuple(nodes)))


def body_for(bones: BoneMap) -> BodyFit:
    """The body with the skeleton's proportions. Raises InvalidArgument."""
    joints, floor = character_joints(bones)
    return fit_betas({b: GLTF_FROM_CORE @ place for b, place in joints.items()}, floor)


def retargeted(clip: Clip, bones: BoneMap) -> tuple[Array, Array]:
    """Rotations [N, J, 4] of all joints, local to the parent, and positions of the root [N, 3].

    A root above the hips carries them and does not turn. Raises InvalidArgument if a bone's parent
    is not the bone that it moves with.
    """
    body = load_body(clip.body, clip.gender)
    rest = body.rest_joints(np.asarray(clip.betas))
    rest[1:] -= rest[body.parents[1:]]
    retarget = Retarget(bones, rest @ GLTF_FROM_CORE.T)
    rig = bones.rig
    if len(retarget.loose) > 1:  # the protocol has positions of the root only
        name = rig.nodes[retarget.nodes[retarget.loose[1]]].name
        raise InvalidArgument(f"{name!r} hangs from another bone than it moves with")
    own = np.array([node.rotation for node in rig.nodes], float)
    rotations = np.tile(own / np.linalg.norm(own, axis=1, keepdims=True), (clip.frames, 1, 1))
    roots = np.empty((clip.frames, 3))
    hips_over_root = rig.places[retarget.nodes[0]] - rig.places[0]
    places = clip.translation @ GLTF_FROM_CORE.T
    turns = gltf_quaternion(np.asarray(clip.rotations, np.float64))
    for frame in range(clip.frames):
        pose = retarget.pose(places[frame], turns[frame], ground=0.0)
        for bone, turn in pose.local.items():
            rotations[frame, retarget.nodes[bone]] = turn
        roots[frame] = pose.places[0] - hips_over_root
    return rotations, roots
