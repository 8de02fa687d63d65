"""Open rollouts of networks that know one motion."""

from pathlib import Path

import numpy as np
import pytest
import torch

from tests.lab.evaluation.fakes import Glide, known_parts, upright_poses
from tests.lab.evaluation.recordings import SPEED, write_recordings
from wayfarer.errors import InvalidArgument
from wayfarer.spec import FPS
from wayfarer_lab.evaluation.model_parts import Variant
from wayfarer_lab.evaluation.rollout import (
    FrozenPoses,
    Rollout,
    prior_poses,
    random_goals,
    recorded_poses,
    roll_out,
    standing_poses,
)
from wayfarer_lab.evaluation.tracks import Recorded
from wayfarer_lab.training.pose_networks import PosePrior

POSES = FrozenPoses("male", *upright_poses(3))


def rolled(variant: Variant, frames: int = 80, **changed: object) -> Rollout:
    return roll_out(known_parts(**changed), variant, POSES, frames, torch.Generator())


@pytest.mark.parametrize(("name", "every"), [("ro-1f", 9), ("ro-2f", 8)])
def test_bodies_go_on_from_where_they_stand(name: str, every: int) -> None:
    made = rolled(Variant(name, name))
    assert made.seam_every == every
    assert made.markers.shape[:2] == (3, 9 * every if every == 9 else 80)
    step = np.diff(made.hips, axis=1)
    assert step[..., 1] == pytest.approx(SPEED / FPS, abs=1e-5)
    assert made.markers[..., 2].min(-1) == pytest.approx(0.0, abs=1e-4), "soles on the floor"
    assert made.hips[:, 0, 1] == pytest.approx(10 * SPEED / FPS, abs=2e-3), "after the lead-in"


def test_without_a_one_frame_model_the_first_seed_stands_still() -> None:
    made = rolled(Variant("ro-2f", "ro-2f"), predictors={"ro-2f": Glide(2)})
    assert made.hips[:, 0, 1] == pytest.approx(9 * SPEED / FPS, abs=2e-3)


def test_what_is_handed_on_parts_from_the_body_the_less_it_is_reprojected() -> None:
    predictors = {"ro-2f": Glide(2, parting=0.05)}
    parted = [
        np.abs(made.carried - made.reprojected()).max()
        for blend in (0.0, 0.5, 1.0)
        for made in [rolled(Variant("x", "ro-2f", blend=blend), predictors=predictors)]
    ]
    assert parted[0] > parted[1] > 1e-3
    assert parted[2] == pytest.approx(0.0, abs=1e-6)


def test_bodies_that_break_are_told_from_sound_ones() -> None:
    markers, hips = np.zeros((3, 8, 67, 3)), np.zeros((3, 8, 3))
    markers[1, 4, 5] = 3.5
    markers[2, 0, 0] = np.nan
    made = Rollout(markers, hips, np.zeros((3, 8, 22, 4)), np.zeros((3, 1, 2, 67, 3)), 8)
    assert len(made.sound().tracks()) == 1 and len(made.sound().carried) == 1


def test_a_variant_needs_its_parts() -> None:
    with pytest.raises(InvalidArgument, match=r"'2f'.*\['ro-1f', 'ro-2f'\]"):
        rolled(Variant("2f", "2f"))
    with pytest.raises(InvalidArgument, match="policy"):
        rolled(Variant("ro-policy", "ro-2f", policy=True), policy=None)


def test_poses_come_from_frames_in_use(tmp_path: Path) -> None:
    recorded = Recorded(write_recordings(tmp_path), "heldout")
    male, female = recorded_poses(recorded, 5, np.random.default_rng(0))
    assert (len(male.betas), len(female.betas)) == (3, 2)
    assert (male.gender, female.gender) == ("male", "female")
    recorded.data.use[:] = 0
    with pytest.raises(InvalidArgument, match="no frames of male bodies in use"):
        recorded_poses(recorded, 5, np.random.default_rng(0))


def test_shipped_poses_need_no_data() -> None:
    male, _ = standing_poses(4, np.random.default_rng(0))
    assert male.rotations.shape == (2, 22, 4) and male.betas.abs().max() <= 2.5


def test_poses_can_be_the_pose_prior_s() -> None:
    torch.manual_seed(0)
    male, female = prior_poses(PosePrior(), 5, np.random.default_rng(0))
    assert len(male.rotations) == 3 and len(female.rotations) == 2
    assert torch.allclose(male.rotations.norm(dim=-1), torch.ones(3, 22), atol=1e-5)
    assert (male.rotations[:, 0] == torch.tensor([0.0, 0, 0, 1])).all() and not male.betas.any()
    assert not torch.equal(male.rotations[0], male.rotations[1])


def test_goals_change_when_they_are_reached() -> None:
    goals = random_goals(2, np.random.default_rng(0))
    first = goals(torch.full((2, 2), 100.0)).clone()
    assert first.abs().max() <= 10.0
    there = torch.stack([first[0, :2], torch.tensor([100.0, 100.0])])
    second = goals(there)
    assert not torch.equal(second[0], first[0]) and torch.equal(second[1], first[1])
