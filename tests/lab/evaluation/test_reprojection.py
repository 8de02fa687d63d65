"""Reprojection by optimisation: it finds known bodies, and stands in for the regressor."""

import pytest
import torch

from tests.lab.evaluation.fakes import known_parts, upright_poses
from wayfarer.body.library import load_body
from wayfarer.engines.torch.marker_bodies import marker_body
from wayfarer.motion.posing import from_6d, to_6d
from wayfarer.motion.regressor import Pose
from wayfarer.spec import GENDERS
from wayfarer_lab.evaluation.fitted import FittedStep, fit_body
from wayfarer_lab.evaluation.model_parts import Variant
from wayfarer_lab.evaluation.models import Primitives
from wayfarer_lab.evaluation.random_motion import Bench
from wayfarer_lab.evaluation.reprojection import reprojection
from wayfarer_lab.evaluation.rollout import FrozenPoses

POSES = [FrozenPoses(gender, *upright_poses(2)) for gender in GENDERS]


def test_a_known_pose_is_found_from_its_markers() -> None:
    generator = torch.Generator().manual_seed(0)
    body = marker_body(load_body("anny52", "female"))
    shape = body.shaped(torch.randn(3, 10, generator=generator))
    still = torch.eye(3)[:, :, None, None, None].expand(3, 3, 22, 1, 3)
    start = Pose(torch.zeros(3, 1, 3), still)
    turned = from_6d(to_6d(still) + 0.1 * torch.randn(6, 22, 4, 3, generator=generator))
    hips = 0.1 * torch.randn(3, 4, 3, generator=generator)
    markers = body.blend(shape, body.place(shape, hips, turned)).transpose(-1, -2)
    found = fit_body(body, shape, markers, start, 200)
    made = body.blend(shape, body.place(shape, found.hips, found.rotations)).transpose(-1, -2)
    assert (made - markers).norm(dim=-1).mean() < 0.006
    assert (found.hips - hips).norm(dim=0).max() < 0.02
    early = fit_body(body, shape, markers, start, 30)
    worse = body.blend(shape, body.place(shape, early.hips, early.rotations)).transpose(-1, -2)
    assert (worse - markers).norm(dim=-1).mean() > 0.01, "the check can fail"


def test_a_variant_optimises_in_place_of_its_regressor() -> None:
    parts = known_parts()
    step = parts.step("male", Variant("fit", "ro-2f", fitted=7))
    assert isinstance(step, FittedStep) and step.iterations == 7
    assert not isinstance(parts.step("male", Variant("plain", "ro-2f")), FittedStep)


def test_the_table_has_accuracy_time_and_realism() -> None:
    _, betas = upright_poses(3)
    standing = torch.eye(3).expand(3, 10, 22, 3, 3)
    truth = Primitives(torch.zeros(3, 10, 3), standing, betas)
    bench = Bench(known_parts(), load_body("anny52", "male", "low"), seed=0)
    rows = reprojection(bench, POSES, 6, {"male": truth}, [20])["Reprojection"]
    assert [row["name"] for row in rows] == ["regressed", "optimised, 20 iterations"]
    fitted = rows[1]
    assert fitted["amd_mm"] == pytest.approx(0, abs=0.5), "it begins where it ends"
    assert fitted["ms_per_primitive"] > 0 and fitted["lost"] == 0
    assert 0 <= fitted["heel_skating_75mm_s"] <= 1
