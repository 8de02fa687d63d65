"""Tables of open rollouts, of networks whose motion is known."""

from pathlib import Path

import numpy as np
import pytest
import torch

from tests.lab.evaluation.fakes import Glide, known_parts, upright_poses
from tests.lab.evaluation.recordings import SPEED, write_recordings
from wayfarer.body.library import load_body
from wayfarer.errors import InvalidArgument
from wayfarer.spec import GENDERS
from wayfarer_lab.evaluation import random_motion
from wayfarer_lab.evaluation.model_parts import Parts
from wayfarer_lab.evaluation.random_motion import Bench, bodies, realism, skating, variants
from wayfarer_lab.evaluation.realism import JudgedMotion
from wayfarer_lab.evaluation.rollout import FrozenPoses
from wayfarer_lab.evaluation.tracks import Recorded

POSES = [FrozenPoses(gender, *upright_poses(2)) for gender in GENDERS]


def bench(parts: Parts | None = None) -> Bench:
    return Bench(parts or known_parts(), load_body("anny52", "male", "low"), seed=0)


@pytest.fixture
def mocap(tmp_path: Path) -> JudgedMotion:
    return JudgedMotion.recorded(Recorded(write_recordings(tmp_path), "heldout"))


def test_variants_are_those_that_the_parts_allow() -> None:
    everything = {name: Glide(int(name[-2])) for name in ("1f", "2f", "ro-1f", "ro-2f")}
    names = [v.name for v in variants(known_parts(predictors=everything))]
    assert {"1f", "ro-2f", "reproj-2f", "ro-reproj-2f", "ro-policy"} <= set(names)
    assert len(set(names)) == len(names) == 12
    assert [v.name for v in variants(known_parts(predictors={"1f": Glide(1)}))] == [
        "1f", "reproj-1f",
    ]  # fmt: skip
    assert "ro-policy" not in [v.name for v in variants(known_parts(policy=None))]


def test_realism_judges_made_and_recorded_motion_alike(mocap: JudgedMotion) -> None:
    tables = realism(bench(), POSES, 2.0, mocap)
    rows = {row["name"]: row for row in tables["Realism"]}
    assert list(rows) == [v.name for v in variants(known_parts())] + ["mocap"]
    for row in rows.values():
        assert row["speed_mps"] == pytest.approx(SPEED, abs=1e-3)
        assert row["contact_strict"] == pytest.approx(np.exp(-(SPEED - 0.075)), abs=1e-3)
        assert row["heel_skating_75mm_s"] == row["heel_skating_200mm_s"] == 1.0
        assert row["both_feet_skating"] == 1.0
        assert row["pose_prior"] == pytest.approx(1.0, abs=1e-4), "all are upright T-poses"
        assert row["deformation_head_mm"] == pytest.approx(0.0, abs=0.01)
    assert rows["ro-2f"]["lost"] == 0 and rows["ro-2f"]["motions"] == 4
    assert rows["ro-2f"]["carried_error_mm"] == pytest.approx(0.0, abs=0.01)
    assert [row["windows"] for row in tables["At walking speed"]] == [
        row["windows"] for row in rows.values()
    ], "1.2 m/s is walking speed"


def test_a_classifier_tells_what_moves_unlike_recorded_people() -> None:
    random = np.random.default_rng(0)
    features = np.abs(random.standard_normal((400, 37))) + 0.1
    features[:, 0], features[:, 1] = 0.0, SPEED  # as fast as what glides here
    people = (features, np.arange(400) % 8)
    one = known_parts(predictors={"ro-1f": Glide(1)}, policy=None)
    row, *_ = realism(bench(one), POSES, 6.0, people=people)["Realism"]
    assert row["auc"] == pytest.approx(1.0) and row["auc_windows"] > 0
    row, *_ = realism(bench(one), POSES, 1.0)["Realism"]
    assert "auc" not in row


def test_a_model_that_loses_its_bodies_is_told_and_not_judged() -> None:
    broken = known_parts(predictors={"ro-2f": Glide(2, speed=float("nan"))}, policy=None)
    for row in realism(bench(broken), POSES, 1.0)["Realism"]:
        assert row["lost"] == 1.0 and "speed_mps" not in row


def test_skating_is_that_of_the_plain_models(mocap: JudgedMotion) -> None:
    rows = skating(bench(), POSES, 5, mocap)["Skating"]
    assert [row["name"] for row in rows] == ["ro-1f", "ro-2f", "ro-policy", "mocap"]
    assert rows[1]["slide_cm_s"] == pytest.approx(100 * SPEED, rel=1e-3)


def test_bodies_differ_in_shape_or_pose_alone(
    mocap: JudgedMotion, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(random_motion, "STEP_LIMIT", 18)
    tables = bodies(bench(), POSES, 2.0, 1, 1.0, mocap)
    shapes, starts, spread = tables["Shapes"], tables["Start poses"], tables["Spread"]
    assert [row["name"] for row in shapes][:1] == ["shape -2.00"]
    assert len(shapes) == 10 + 1 and shapes[-1]["name"] == "mocap"
    assert len(starts) == 2
    # 5 m ahead, 0.75 m short of it, 0.3 m of lead-in at most: in the 17th primitive
    assert {row["steps"] for row in shapes[:-1] + starts} == {17.0}
    assert {row["success_075m"] for row in shapes[:-1]} == {1.0}
    assert spread[0]["steps"] == 0.0 and spread[0]["speed_mps"] == pytest.approx(0.0, abs=1e-3)


def test_goals_lie_ahead_of_the_pose_whatever_its_heading() -> None:
    turned = torch.tensor([0.0, 0.0, np.sin(1.0), np.cos(1.0)]).float()
    poses = []
    for pose in POSES:
        rotations = pose.rotations.clone()
        rotations[:, 0] = turned
        poses.append(FrozenPoses(pose.gender, rotations, pose.betas))
    wanted = variants(known_parts())[-1]
    reached = bench().reach(wanted, poses)
    assert wanted.policy and reached == {"success_075m": 1.0, "steps": 17.0}


def test_the_same_seed_gives_the_same_rows() -> None:
    assert skating(bench(), POSES, 5) == skating(bench(), POSES, 5)


def test_long_enough_stretches_of_locomotion_are_recorded_motion(
    mocap: JudgedMotion, tmp_path: Path
) -> None:
    assert [len(track.hips) for track in mocap.tracks] == [95], "5 frames are excluded"
    with pytest.raises(InvalidArgument, match="no stretch of 96 frames of locomotion"):
        JudgedMotion.recorded(Recorded(tmp_path, "heldout"), 96)
