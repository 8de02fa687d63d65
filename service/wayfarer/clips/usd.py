"""Clips as USD: each person a SkelRoot with skeleton, skinned mesh and animation (UsdSkel).

glTF's basis (Y up, metres), one time code per frame; a binary file (crate), as `.usd` or `.usdc`.
Needs the package usd-core, which the extra `usd` brings.
"""

import re
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wayfarer.body.mesh import vertex_normals
from wayfarer.body.rotation import GLTF_FROM_CORE, gltf_quaternion
from wayfarer.body.skeleton import bone_names
from wayfarer.body.wardrobe import dressed
from wayfarer.clips.actor import Actor
from wayfarer.clips.clip import Array
from wayfarer.clips.glb import ROOT
from wayfarer.errors import InvalidArgument

EXTENT_M = 1.5
"""Metres around the hips that contain any body."""


def usd_bytes(
    actors: Sequence[Actor],
    names: str = "mixamo",
    title: str = "motion",
    scene: Array | None = None,
) -> bytes:
    """A stage with all of them; arguments as for `glb_bytes`. Raises as `require_usd`."""
    require_usd()
    from pxr import Gf, Usd, UsdGeom

    stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    fps = actors[0].clip.fps
    stage.SetTimeCodesPerSecond(fps)
    stage.SetFramesPerSecond(fps)
    stage.SetStartTimeCode(0)
    stage.SetEndTimeCode(max(actor.clip.frames + actor.start * fps for actor in actors) - 1)
    world = UsdGeom.Xform.Define(stage, "/World")
    stage.SetDefaultPrim(world.GetPrim())
    taken: set[str] = set()
    for actor in actors:
        _add_actor(stage, f"/World/{_identifier(actor.name, taken)}", actor, names, title)
    if scene is not None and len(scene):
        mesh = UsdGeom.Mesh.Define(stage, f"/World/{_identifier('scene', taken)}")
        corners = scene.reshape(-1, 3) @ GLTF_FROM_CORE.T
        _shape(mesh, corners, np.arange(len(corners)).reshape(-1, 3))
        mesh.CreateDisplayColorAttr([Gf.Vec3f(0.6, 0.6, 0.6)])
        mesh.CreateDoubleSidedAttr(True)
    with TemporaryDirectory() as folder:
        path = Path(folder) / "motion.usdc"
        stage.GetRootLayer().Export(str(path))
        return path.read_bytes()


def require_usd() -> None:
    """Raises InvalidArgument when usd-core is not installed."""
    if find_spec("pxr") is None:
        raise InvalidArgument("USD files need a package: pip install usd-core", "format")


def _identifier(name: str, taken: set[str]) -> str:
    """A new name that USD allows."""
    plain = re.sub(r"\W", "_", name, flags=re.ASCII) or "person"
    plain = f"_{plain}" if plain[0].isdigit() else plain
    found, count = plain, 1
    while found in taken:
        count += 1
        found = f"{plain}_{count}"
    taken.add(found)
    return found


def _add_actor(stage: Any, path: str, actor: Actor, names: str, title: str) -> None:
    from pxr import Gf, UsdGeom, UsdSkel, Vt

    (body, worn), clip = dressed(actor.body, actor.look), actor.clip
    betas = body.check_betas(np.asarray(clip.betas))
    root = UsdSkel.Root.Define(stage, path)
    paths = _joint_paths(body.parents, bone_names(names), ROOT if actor.root else "")
    rest, bind = _rest_and_bind(actor, betas)
    skeleton = UsdSkel.Skeleton.Define(stage, f"{path}/skeleton")
    skeleton.CreateJointsAttr(paths)
    skeleton.CreateRestTransformsAttr([Gf.Matrix4d(m.T.tolist()) for m in rest])
    skeleton.CreateBindTransformsAttr([Gf.Matrix4d(m.T.tolist()) for m in bind])
    taken = {"skeleton", "body"}
    animation = UsdSkel.Animation.Define(stage, f"{path}/{_identifier(title, taken)}")
    animation.CreateJointsAttr(paths)
    translations, rotations = _channels(actor, rest)
    moved, turned = animation.CreateTranslationsAttr(), animation.CreateRotationsAttr()
    scaled = animation.CreateScalesAttr()
    scaled.Set([Gf.Vec3h(1, 1, 1)] * len(paths))
    for frame in range(clip.frames):
        code = frame + actor.start * clip.fps
        moved.Set(Vt.Vec3fArray.FromNumpy(translations[frame]), code)
        quaternions = [Gf.Quatf(w, Gf.Vec3f(x, y, z)) for x, y, z, w in rotations[frame].tolist()]
        turned.Set(Vt.QuatfArray(quaternions), code)
    binding = UsdSkel.BindingAPI.Apply(skeleton.GetPrim())
    binding.CreateAnimationSourceRel().SetTargets([animation.GetPath()])
    mesh = UsdGeom.Mesh.Define(stage, f"{path}/body")
    vertices = (body.bind_vertices + body.bind_vertices_dirs @ betas) @ GLTF_FROM_CORE.T
    _shape(mesh, vertices, body.faces)
    mesh.CreateDoubleSidedAttr(True)  # the inside of a sleeve is visible
    colours = actor.look.linear[worn]
    shown = mesh.CreateDisplayColorPrimvar(UsdGeom.Tokens.uniform)
    shown.Set(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(colours[:, :3], np.float32)))
    skin = UsdSkel.BindingAPI.Apply(mesh.GetPrim())
    skin.CreateSkeletonRel().SetTargets([skeleton.GetPath()])
    influences = body.skin_joints.shape[1]
    joints = (body.skin_joints + (actor.root is not None)).astype(np.int32)
    weights = body.skin_weights.astype(np.float32)
    indices = skin.CreateJointIndicesPrimvar(False, influences)
    indices.Set(Vt.IntArray.FromNumpy(np.ascontiguousarray(joints.reshape(-1))))
    shares = skin.CreateJointWeightsPrimvar(False, influences)
    shares.Set(Vt.FloatArray.FromNumpy(np.ascontiguousarray(weights.reshape(-1))))
    skin.CreateGeomBindTransformAttr(Gf.Matrix4d(1))
    places = clip.translation if actor.root is None else clip.translation + actor.root.places
    around = np.stack([places.min(0), places.max(0)]) @ GLTF_FROM_CORE.T
    around = np.stack([around.min(0) - EXTENT_M, around.max(0) + EXTENT_M])
    UsdGeom.Boundable(root.GetPrim()).CreateExtentAttr(
        Vt.Vec3fArray.FromNumpy(around.astype(np.float32))
    )


def _joint_paths(parents: NDArray[np.int64], names: Sequence[str], root: str) -> list[str]:
    paths: list[str] = []
    for parent, name in zip(parents.tolist(), names, strict=True):
        above = paths[parent] if parent >= 0 else root
        paths.append(f"{above}/{name}" if above else name)
    return [root, *paths] if root else paths


def _rest_and_bind(actor: Actor, betas: Array) -> tuple[Array, Array]:
    """Rest transforms relative to the parent, and bind transforms in the world [J, 4, 4]."""
    body = actor.body
    places = body.rest_joints(betas)
    local = places.copy()
    local[1:] -= places[body.parents[1:]]
    rest, bind = np.tile(np.eye(4), (2, len(places), 1, 1))
    rest[:, :3, 3] = local @ GLTF_FROM_CORE.T
    turn = GLTF_FROM_CORE @ body.bind_to_rest @ GLTF_FROM_CORE.T
    bind[:, :3, :3] = np.swapaxes(turn, -1, -2)
    bind[:, :3, 3] = (body.bind_joints + body.bind_joints_dirs @ betas) @ GLTF_FROM_CORE.T
    if actor.root is not None:
        rest, bind = (np.concatenate([np.eye(4)[None], m]) for m in (rest, bind))
    return rest, bind


def _channels(actor: Actor, rest: Array) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Translations [N, J, 3] and rotations [N, J, 4] of all joints, local to the parent."""
    clip, above = actor.clip, int(actor.root is not None)
    translations = np.tile(rest[:, :3, 3], (clip.frames, 1, 1))
    rotations = np.tile([0.0, 0, 0, 1], (clip.frames, len(rest), 1))
    translations[:, above] = clip.translation @ GLTF_FROM_CORE.T
    posed = clip.rotations.shape[1]
    rotations[:, above : above + posed] = gltf_quaternion(np.asarray(clip.rotations, np.float64))
    if actor.root is not None:
        translations[:, 0] = actor.root.places @ GLTF_FROM_CORE.T
        rotations[:, 0] = gltf_quaternion(actor.root.turns)
    return translations.astype(np.float32), rotations.astype(np.float32)


def _shape(mesh: Any, vertices: Array, faces: NDArray[np.int64]) -> None:
    from pxr import UsdGeom, Vt

    points = np.ascontiguousarray(vertices, np.float32)
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points))
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray(len(faces), 3))
    order = np.ascontiguousarray(faces.reshape(-1), np.int32)
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(order))
    mesh.CreateNormalsAttr(
        Vt.Vec3fArray.FromNumpy(vertex_normals(points, faces).astype(np.float32))
    )
    mesh.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    mesh.CreateExtentAttr(Vt.Vec3fArray.FromNumpy(np.stack([points.min(0), points.max(0)])))
