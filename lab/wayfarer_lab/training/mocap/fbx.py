"""Reader for FBX motions, through the bindings of `ufbx`.

The axes and the unit that a file declares are converted to Y up and metres. A joint keeps the
places that it has in the file: where bones stretch or hips move below a still root, offsets move.

The zero pose is the first of these that stands: the pose of the skin's binding, the bind pose, all
rotations zero, the pose in which the file was saved. If none does, it is all rotations zero, which
files of the same rig share.

Files are read in a separate process: the bindings (0.0.5) can crash, and one file must not end
a run over many.
"""

import ctypes
import os
from collections.abc import Iterator
from dataclasses import dataclass
from multiprocessing import get_context
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np

from wayfarer.errors import DataError
from wayfarer_lab.training.mocap.joints import joint_map
from wayfarer_lab.training.mocap.resample import nearest_rotations
from wayfarer_lab.training.mocap.skeleton import Array, MocapSkeleton, SkeletonMotion
from wayfarer_lab.training.mocap.stance import standing_frame, stands

SUFFIX = ".fbx"
SLOWEST, FASTEST = 23.9, 1000.0
"""Rates (1/s) of keys that are taken as the rate of recording; others were set by hand."""
USUAL_RATE = 60.0
"""Rate at which hand-set keys of a file with an odd rate are sampled."""
STILL = 1e-6
"""Metres and units of a matrix below which a take does not move."""
MOVED = 1e-4
"""Metres by which the offset of a joint may move and count as still."""


@dataclass(frozen=True)
class FbxTake:
    """One animation of a file."""

    name: str
    motion: SkeletonMotion  # metres, Y up


def read_fbx(path: Path) -> list[FbxTake]:
    """The takes of a file in which its person moves.

    Raises DataError if it is no FBX, has no person, more than one, or no animation of them.
    """
    context = get_context("spawn")
    ours, theirs = context.Pipe(duplex=False)
    reader = context.Process(target=_send, args=(path, theirs), daemon=True)
    reader.start()
    theirs.close()
    try:
        takes: list[FbxTake] | str = ours.recv()
    except EOFError:
        raise DataError("the FBX reader crashed on this file", str(path)) from None
    finally:
        ours.close()
        reader.join()
    if isinstance(takes, str):
        raise DataError(takes, str(path))
    return takes


def _send(path: Path, pipe: Connection) -> None:
    """Runs in the reader's process, which ends without freeing what the bindings hold."""
    try:
        takes: list[FbxTake] | str = _read(path)
    except DataError as error:
        takes = str(error)
    pipe.send(takes)
    pipe.close()
    os._exit(0)


def _read(path: Path) -> list[FbxTake]:
    try:
        import ufbx
    except ImportError as error:
        raise DataError("FBX needs the package ufbx: pip install './lab[train]'") from error
    try:
        scene = ufbx.load_file(
            str(path),
            target_axes=ufbx.axes_right_handed_y_up,
            target_unit_meters=1.0,
            ignore_geometry=True,
        )
    except (ufbx.UfbxError, OSError, RuntimeError) as error:
        raise DataError(f"cannot be read as FBX: {error}") from error
    return _takes(ufbx, scene)


def _items(things: Any) -> list[Any]:
    """The things of one of the bindings' lists.

    Version 0.0.5 hands them out without counting the reference, so the count is raised here.
    """
    found = []
    for k in range(len(things)):
        thing = things[k]
        ctypes.pythonapi.Py_IncRef(ctypes.py_object(thing))
        found.append(thing)
    return found


def _takes(ufbx: Any, scene: Any) -> list[FbxTake]:
    nodes = _items(scene.nodes)
    rows = _person(nodes)
    kept = sorted(set(rows), key=lambda k: (_depth(nodes[k]), k))
    parents = [_nearest(nodes, k, kept) for k in kept]
    if parents[1:].count(-1) or parents[0] != -1:
        raise DataError(f"its joints do not hang from {nodes[rows[0]].name!r}")
    at = {k: i for i, k in enumerate(kept)}
    ours = [at[k] for k in rows]
    fps = _rate(scene)
    zeros = list(_zero_poses(scene, nodes, kept, parents))
    names = [nodes[k].name for k in kept]
    takes: list[FbxTake] = []
    for stack in _items(scene.anim_stacks):
        baked = ufbx.bake_anim(scene, stack.anim)
        first, last = baked.key_time_min, baked.key_time_max
        times = first + np.arange(int((last - first) * fps + 1e-3) + 1) / fps
        worlds = np.array([_worlds_at(scene, stack.anim, t, kept) for t in times])
        if (np.ptp(worlds, axis=0) < STILL).all():
            continue
        motion = _motion(names, parents, worlds, zeros, ours, fps)
        if not any(_same(motion, other.motion) for other in takes):
            takes.append(FbxTake(stack.name, motion))
    if not takes:
        raise DataError(f"none of its {len(scene.anim_stacks)} takes moves its joints")
    return takes


def _person(nodes: list[Any]) -> list[int]:
    """The nodes that are our 22 joints. Raises DataError if there is no person, or are two."""
    groups: dict[str, list[int]] = {}
    for k, node in enumerate(nodes[1:], start=1):
        space = node.name.rpartition(":")[0]
        for group in (f"{space}:", [nodes[a].name for a in _line(node)][-1]):
            groups.setdefault(group, []).append(k)
    everybody = list(range(1, len(nodes)))
    people: dict[tuple[int, ...], str] = {}
    for name, group in groups.items():
        try:
            people[tuple(group[j] for j in joint_map(_tree(nodes, group)))] = name.strip(":")
        except DataError:
            continue
    if len(people) > 1:
        raise DataError(
            f"{len(people)} people ({', '.join(people.values())}): export a file for each"
        )
    if people:
        return list(next(iter(people)))
    return [everybody[j] for j in joint_map(_tree(nodes, everybody))]


def _tree(nodes: list[Any], group: list[int]) -> MocapSkeleton:
    """Names and parents of some nodes; offsets do not matter to names."""
    at = {k: i for i, k in enumerate(group)}
    above = [nodes[k].parent.typed_id if nodes[k].parent is not None else -1 for k in group]
    parents = tuple(at.get(k, -1) for k in above)
    names = tuple(nodes[k].name for k in group)
    return MocapSkeleton(names, parents, np.zeros((len(group), 3)), {})


def _line(node: Any) -> list[int]:
    """Indices of a node and those above it, without the scene's root."""
    found = []
    while node is not None and not node.is_root:
        found.append(node.typed_id)
        node = node.parent
    return found


def _depth(node: Any) -> int:
    return len(_line(node))


def _nearest(nodes: list[Any], node: int, kept: list[int]) -> int:
    """Position in `kept` of the nearest node above; -1: none."""
    return next((kept.index(k) for k in _line(nodes[node])[1:] if k in kept), -1)


def _rate(scene: Any) -> float:
    """Frames per second: that of the keys if they are evenly spaced, otherwise the file's."""
    keys = max((_items(c.keyframes) for c in _items(scene.anim_curves)), key=len, default=[])
    gaps = np.diff([key.time for key in keys])
    if len(gaps) > 2:
        usual = float(np.median(gaps))
        even = (np.abs(gaps - usual) < 0.05 * usual).mean() > 0.9
        if even and SLOWEST <= 1 / usual <= FASTEST:
            return round(1 / usual, 3)
    declared = float(scene.settings.frames_per_second)
    return declared if SLOWEST <= declared <= FASTEST else USUAL_RATE


def _matrices(found: list[Any]) -> Array:
    """[K, 3, 4] of the bindings' matrices, which name columns."""
    return np.swapaxes(np.array(found), -1, -2)


def _worlds(scene: Any, kept: list[int]) -> Array:
    """World transforms [K, 3, 4] of the kept nodes."""
    nodes = _items(scene.nodes)
    return _matrices([nodes[k].node_to_world for k in kept])


def _worlds_at(scene: Any, anim: Any, time: float, kept: list[int]) -> Array:
    """World transforms [K, 3, 4] at a time, in seconds."""
    moment = scene.evaluate(anim, time)
    try:
        return _worlds(moment, kept)
    finally:
        moment.free()


def _zero_poses(
    scene: Any, nodes: list[Any], kept: list[int], parents: list[int]
) -> Iterator[Array]:
    """World transforms [K, 3, 4] of poses in which the file's rig may stand, best first.

    Missing parts of a pose hang from their parents as in the file's saved pose.
    """
    saved = _worlds(scene, kept)
    bound: dict[int, Any] = {}
    for cluster in _items(scene.skin_clusters):
        if cluster.bone_node is not None:
            bound.setdefault(cluster.bone_node.typed_id, cluster.bind_to_world)
    posed: dict[int, Any] = {}
    for pose in _items(scene.poses):
        if pose.is_bind_pose:
            for bone in _items(pose.bone_poses):
                posed.setdefault(bone.bone_node.typed_id, bone.bone_to_world)
    for known in (bound, posed):
        if kept[0] not in known:
            continue
        found = np.empty_like(saved)
        for i, (k, parent) in enumerate(zip(kept, parents, strict=True)):
            if k in known:
                found[i] = _matrices([known[k]])[0]
            else:
                found[i] = (_square(found[parent]) @ np.linalg.inv(_square(saved[parent])))[
                    :3
                ] @ _square(saved[i])
        yield found
    yield saved


def _square(matrix: Array) -> Array:
    return np.vstack([matrix, [0.0, 0.0, 0.0, 1.0]])


def _motion(
    names: list[str],
    parents: list[int],
    worlds: Array,
    zeros: list[Array],
    ours: list[int],
    fps: float,
) -> SkeletonMotion:
    """The motion [N, K, 3, 4] relative to the best zero pose. `zeros` ends with the saved pose."""
    places, turns = worlds[..., 3], nearest_rotations(worlds[..., :3])
    plain = _unturned(places, turns, parents)
    *bound, saved = zeros
    for zero in bound:
        rest = zero[:, :, 3] * _size(places, parents) / _size(zero[None, :, :, 3], parents)
        if stands(rest[ours]):
            return _relative(names, parents, worlds, zero[..., :3], rest, fps)
    if not stands(plain[ours]) and _erect(saved[ours, :, 3]):
        return _relative(names, parents, worlds, saved[..., :3], saved[..., 3], fps)
    return _relative(names, parents, worlds, np.broadcast_to(np.eye(3), turns[0].shape), plain, fps)


def _unturned(places: Array, turns: Array, parents: list[int]) -> Array:
    """Places [K, 3] of the joints with all rotations zero, by their first frame."""
    rest = np.zeros(places.shape[1:])
    for j, parent in enumerate(parents):
        if parent >= 0:
            rest[j] = rest[parent] + turns[0, parent].T @ (places[0, j] - places[0, parent])
    return rest


def _size(places: Array, parents: list[int]) -> float:
    """Mean length of the bones of a motion [N, K, 3]."""
    bones = places[:, 1:] - places[:, parents[1:]]
    return float(np.linalg.norm(bones, axis=-1).mean())


def _erect(rest: Array) -> bool:
    """Whether a pose [22, 3] is one of standing, Y up; a moment of a walk is none."""
    return standing_frame(np.stack([rest, rest]), "y", 1.0) is not None


def _relative(
    names: list[str], parents: list[int], worlds: Array, zero: Array, rest: Array, fps: float
) -> SkeletonMotion:
    """Rotations relative to a zero pose with axes `zero` [K, 3, 3] and places `rest` [K, 3]."""
    places = worlds[..., 3]
    turns = nearest_rotations(worlds[..., :3] @ np.linalg.inv(zero))
    local, offsets, shifts = turns.copy(), rest.copy(), {}
    for j, parent in enumerate(parents):
        if parent < 0:
            continue
        back = np.swapaxes(turns[:, parent], -1, -2)
        local[:, j] = back @ turns[:, j]
        offsets[j] = rest[j] - rest[parent]
        moved = (back @ (places[:, j] - places[:, parent])[..., None])[..., 0]
        if not np.allclose(moved, offsets[j], atol=MOVED):
            shifts[j] = moved
    skeleton = MocapSkeleton(tuple(names), tuple(parents), offsets, {})
    return SkeletonMotion(skeleton, places[:, 0], local, fps, shifts)


def _same(a: SkeletonMotion, b: SkeletonMotion) -> bool:
    return len(a) == len(b) and np.allclose(a.root, b.root) and np.allclose(a.local, b.local)
