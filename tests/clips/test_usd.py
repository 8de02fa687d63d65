"""The stage is read by USD itself: valid, joints where the body has them, skin as ours."""

import numpy as np
import pytest

from wayfarer.body.library import load_body
from wayfarer.body.outfit import look
from wayfarer.body.rotation import GLTF_FROM_CORE
from wayfarer.body.wardrobe import dressed
from wayfarer.clips.files import (
    BodyDetail,
    FileFormat,
    FileOptions,
    Performance,
    RootMotion,
    encode,
)

pxr = pytest.importorskip("pxr", reason="needs usd-core")


@pytest.fixture(scope="module", params=[RootMotion.HIPS, RootMotion.BONE])
def stage(request, clip, tmp_path_factory):
    options = FileOptions(FileFormat.USD, root=request.param, detail=BodyDetail.LOW)
    people = [Performance("Ada", clip), Performance("1 Bob?", clip, style=2)]
    ground = np.array([[[-2, -2, 0], [5, -2, 0], [5, 9, 0]]], float)
    path = tmp_path_factory.mktemp("usd") / "a.usdc"
    path.write_bytes(encode(people, options, "walk", ground))
    return pxr.Usd.Stage.Open(str(path))


def test_validators_find_nothing(stage):
    from pxr import UsdValidation

    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    assert len(validators) > 20
    found = UsdValidation.ValidationContext(validators).Validate(stage)
    assert [f"{error.GetName()}: {error.GetMessage()}" for error in found] == []
    assert stage.GetDefaultPrim().GetPath() == "/World"
    assert [str(p.GetPath()) for p in stage.GetPrimAtPath("/World").GetChildren()] == [
        "/World/Ada", "/World/_1_Bob_", "/World/scene",
    ]  # fmt: skip


@pytest.mark.parametrize("frame", [0, 9, 19])
def test_joints_and_skin(stage, clip, frame):
    from pxr import Usd, UsdGeom, UsdSkel

    root = UsdSkel.Root(stage.GetPrimAtPath("/World/Ada"))
    cache = UsdSkel.Cache()
    cache.Populate(root, Usd.PrimDefaultPredicate)
    query = cache.GetSkelQuery(UsdSkel.Skeleton(stage.GetPrimAtPath("/World/Ada/skeleton")))
    body = load_body("anny52", clip.gender, "low")
    turns, places = clip.pose(body)
    joints = np.array(query.ComputeJointSkelTransforms(frame))[-len(places[0]) :]
    np.testing.assert_allclose(joints[:, 3, :3], places[frame] @ GLTF_FROM_CORE.T, atol=1e-3)
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/World/Ada/body"))
    points = mesh.GetPointsAttr().Get()
    transforms = query.ComputeSkinningTransforms(frame)
    cache.GetSkinningQuery(mesh.GetPrim()).ComputeSkinnedPoints(transforms, points, frame)
    wanted = (
        dressed(body, look(0, clip.gender))[0].skin(
            np.asarray(clip.betas), turns[frame], places[frame]
        )
        @ GLTF_FROM_CORE.T
    )
    np.testing.assert_allclose(np.array(points), wanted, atol=1e-3)
