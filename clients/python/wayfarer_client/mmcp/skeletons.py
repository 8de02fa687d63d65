"""Clips on the skeleton that a request has."""

from typing import Final

import numpy as np
from motionmcp.schemas import Joint, Skeleton

from wayfarer_client.bone_map import BoneMap, map_bones
from wayfarer_client.errors import InvalidArgument
from wayfarer_client.messages import Float
from wayfarer_client.quaternions import Array
from wayfarer_client.retarget import Retarget
from wayfarer_client.rig import Node, Rig
from wayfarer_client.tracks import Track
from wayfarer_client.v1 import catalog_pb2

MAX_JOINTS: Final = 1000


def canonical(bones: catalog_pb2.Skeleton, rest_offsets: Float) -> Skeleton:
    """A body's moving bones in T-pose, with Mixamo's names; `rest_offsets` [J, 3], glTF basis."""
    moving = bones.bones[: bones.posed_bones]
    return Skeleton(
        joints=[
            Joint(
                name=bone.mixamo,
                parent=moving[bone.parent].mixamo if bone.parent >= 0 else None,
                rest_translation=tuple(offset.tolist()),
                rest_rotation=(0.0, 0.0, 0.0, 1.0),
            )
            for bone, offset in zip(moving, rest_offsets, strict=False)
        ]
    )


def read(skeleton: Skeleton) -> BoneMap:
    """Finds its bones. Raises InvalidArgument that names the missing ones."""
    if len(skeleton.joints) > MAX_JOINTS:
        raise InvalidArgument(f"{len(skeleton.joints)} joints; allowed are {MAX_JOINTS}")
    names = [joint.name for joint in skeleton.joints]
    nodes = []
    for joint in skeleton.joints:
        values = (*joint.rest_translation, *joint.rest_rotation)
        if not np.isfinite(values).all() or np.linalg.norm(joint.rest_rotation) < 1e-6:
            raise InvalidArgument(f"the rest transform of {joint.name!r} is none")
        parent = -1 if joint.parent is None else names.index(joint.parent)
        nodes.append(Node(joint.name, parent, joint.rest_translation, joint.rest_rotation))
    return map_bones(Rig(tuple(nodes)))


def retargeted(track: Track, bones: BoneMap) -> tuple[Array, Array]:
    """Rotations [N, J, 4] of all joints, local to the parent, and positions of the root [N, 3].

    A root above the hips carries them and does not turn. Raises InvalidArgument if a bone's parent
    is not the bone that it moves with.
    """
    retarget, rig = Retarget(bones, track.agent.rest_offsets), bones.rig
    if len(retarget.loose) > 1:  # the protocol has positions of the root only
        name = rig.nodes[retarget.nodes[retarget.loose[1]]].name
        raise InvalidArgument(f"{name!r} hangs from another bone than it moves with")
    own = np.array([node.rotation for node in rig.nodes], float)
    count = len(track.times)
    rotations = np.tile(own / np.linalg.norm(own, axis=1, keepdims=True), (count, 1, 1))
    roots = np.empty((count, 3))
    hips_over_root = rig.places[retarget.nodes[0]] - rig.places[0]
    for frame in range(count):
        pose = retarget.pose(track.translation[frame], track.rotations[frame], ground=0.0)
        for bone, turn in pose.local.items():
            rotations[frame, retarget.nodes[bone]] = turn
        roots[frame] = pose.places[0] - hips_over_root
    return rotations, roots
