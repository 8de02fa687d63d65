"""Clips as animated GLB: skinned bodies with one animation, for engines and Blender."""

import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import pygltflib as gltf

from wayfarer.body.glb import GlbFile, about_body, add_body
from wayfarer.body.mesh import vertex_normals
from wayfarer.body.rotation import GLTF_FROM_CORE, continuous_quaternions, gltf_quaternion
from wayfarer.body.skeleton import bone_names
from wayfarer.clips.actor import Actor
from wayfarer.clips.clip import Array, Clip
from wayfarer.clips.edit import RootTrack, put_back
from wayfarer.errors import DataError
from wayfarer.spec import POSED_JOINTS

ROOT: Final = "root"
"""Name of the bone with the root motion, if it is apart from the hips."""


def glb_bytes(
    actors: Sequence[Actor],
    names: str = "mixamo",
    title: str = "motion",
    scene: Array | None = None,
) -> bytes:
    """Bodies, skins and one animation of all; glTF basis, linear between keys, one each frame.

    `names`: vocabulary of the bones; `scene`: triangles [T, 3, 3] of the ground, in world space.
    """
    file = GlbFile()
    document = file.document
    animation = gltf.Animation(name=title)
    people, top = [], []
    for actor in actors:
        betas = np.asarray(actor.clip.betas)
        root = "" if actor.root is None else ROOT
        joints, mesh, above = add_body(file, actor.body, betas, actor.look, bone_names(names), root)
        about = {"name": actor.name, "joints": joints[0]}
        if root:
            about["root"] = above
        document.nodes[mesh].name = f"{actor.name} body"  # next to its bones, by the standard
        document.nodes.append(gltf.Node(name=actor.name, children=[above]))
        top += [len(document.nodes) - 1, mesh]
        add_motion(file, animation, actor, joints, above)
        people.append(about_body(actor.body, betas, actor.look) | about)
    document.animations.append(animation)
    if scene is not None and len(scene):
        top.append(_add_scene(file, scene))
    document.scenes.append(gltf.Scene(nodes=top))
    document.scene = 0
    document.extras = {"people": people}
    return file.to_bytes()


def add_motion(
    file: GlbFile,
    animation: gltf.Animation,
    actor: Actor,
    joints: Sequence[int],
    root_node: int = -1,
) -> None:
    """Channels of a clip: translation of the hips, rotations of all, and those of the root."""
    clip, root = actor.clip, actor.root
    times = file.add((actor.start + np.arange(clip.frames) / clip.fps).astype(np.float32))

    def add(values: Array, node: int, channel: str) -> None:
        output = file.add(np.ascontiguousarray(values, np.float32))
        animation.samplers.append(gltf.AnimationSampler(input=times, output=output))
        target = gltf.AnimationChannelTarget(node=node, path=channel)
        sampler = len(animation.samplers) - 1
        animation.channels.append(gltf.AnimationChannel(sampler=sampler, target=target))

    def turns(values: Array) -> Array:
        # neighbours on one half-sphere: a player that does not flip signs itself would spin
        return continuous_quaternions(gltf_quaternion(values))

    add(clip.translation @ GLTF_FROM_CORE.T, joints[0], "translation")
    rotations = turns(clip.rotations)
    for joint in range(rotations.shape[1]):
        add(rotations[:, joint], joints[joint], "rotation")
    if root is not None:
        add(root.places @ GLTF_FROM_CORE.T, root_node, "translation")
        add(turns(root.turns), root_node, "rotation")


def _add_scene(file: GlbFile, triangles: Array) -> int:
    """A mesh of the ground, flat shaded; its node."""
    corners = (triangles.reshape(-1, 3) @ GLTF_FROM_CORE.T).astype(np.float32)
    faces = np.arange(len(corners)).reshape(-1, 3)
    normals = vertex_normals(corners.astype(np.float64), faces)
    normals[np.linalg.norm(normals, axis=-1) < 0.5] = (0, 1, 0)  # of triangles without an area
    document = file.document
    document.materials.append(
        gltf.Material(
            name="ground",
            doubleSided=True,
            pbrMetallicRoughness=gltf.PbrMetallicRoughness(
                baseColorFactor=[0.6, 0.6, 0.6, 1.0], metallicFactor=0.0, roughnessFactor=0.9
            ),
        )
    )
    primitive = gltf.Primitive(
        attributes=gltf.Attributes(
            POSITION=file.add(corners, gltf.ARRAY_BUFFER),
            NORMAL=file.add(normals.astype(np.float32), gltf.ARRAY_BUFFER),
        ),
        material=len(document.materials) - 1,
    )
    document.meshes.append(gltf.Mesh(name="scene", primitives=[primitive]))
    document.nodes.append(gltf.Node(name="scene", mesh=len(document.meshes) - 1))
    return len(document.nodes) - 1


def read_glb(path: Path) -> Clip:
    """Reads a clip of one person that `glb_bytes` made; GLB has no place for contacts and goals.

    Raises DataError for any other file: joints and body of a foreign GLB are not ours.
    """
    try:
        document = gltf.GLTF2.load_binary(path)
        people = document.extras["people"]
        if len(people) != 1:
            raise DataError(f"there are {len(people)} people in it; a clip has one", str(path))
        about, animation = people[0], document.animations[0]
        values = {
            (channel.target.path, channel.target.node): _floats(
                document, animation.samplers[channel.sampler].output
            )
            for channel in animation.channels
        }
        times = _floats(document, animation.samplers[0].input)[:, 0]
        hips = about["joints"]
        turns = [values["rotation", hips + joint] for joint in range(POSED_JOINTS)]
        clip = Clip(
            translation=values["translation", hips] @ GLTF_FROM_CORE,
            rotations=gltf_quaternion(np.stack(turns, axis=1)),
            contacts=np.zeros((len(times), 2), bool),
            gender=about["gender"],
            betas=tuple(about["betas"]),
            body=about["body"],
            fps=round((len(times) - 1) / float(times[-1] - times[0]), 3),
        )
        if "root" not in about:
            return clip
        places = values["translation", about["root"]].astype(np.float64) @ GLTF_FROM_CORE
        _, _, z, w = gltf_quaternion(values["rotation", about["root"]]).T
        return put_back(clip, RootTrack(places, np.unwrap(2 * np.arctan2(z, w))))
    except (
        OSError,
        ValueError,
        KeyError,
        IndexError,
        TypeError,
        ZeroDivisionError,
        struct.error,
    ) as error:
        raise DataError(f"not a clip that Wayfarer wrote as GLB: {error!r}", str(path)) from error


def _floats(document: gltf.GLTF2, accessor: int) -> np.ndarray[Any, np.dtype[np.float32]]:
    """Values of a float accessor as `GlbFile.add` packs them. [n, components]."""
    about = document.accessors[accessor]
    view = document.bufferViews[about.bufferView]
    count = about.count * {gltf.SCALAR: 1, gltf.VEC3: 3, gltf.VEC4: 4}[about.type]
    blob = document.binary_blob()
    return np.frombuffer(blob, np.float32, count, view.byteOffset).reshape(about.count, -1)
