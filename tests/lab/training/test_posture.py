import pytest
import torch

from wayfarer.body.library import load_body
from wayfarer.body.skeleton import joint_names
from wayfarer.marker_bodies import marker_body
from wayfarer_lab.training.crowd import TrainingCrowd
from wayfarer_lab.training.posture import Posture, off_body
from wayfarer_lab.training.rotation import matrix_from_rotvec


def test_crouching_and_knees_beyond_their_limits_are_priced():
    model = load_body("anny52", "male")
    body, posture = marker_body(model), Posture.from_names(model.marker_names)
    betas = torch.zeros(1, 10)

    def strain(knee_deg: float, hips: float = 0.0) -> float:
        turns = torch.zeros(1, 22, 3)
        for side in ("left", "right"):
            turns[0, joint_names().index(f"{side}_knee"), 0] = -torch.deg2rad(
                torch.tensor(knee_deg)
            )
        place = torch.tensor([[0.0, 0.0, hips]])
        markers, _ = body(place, matrix_from_rotvec(turns), betas)
        resting = body.resting(betas)
        height = -resting[:, 2].amin(-1)  # hips stand at the origin of the T-pose
        return float(posture.strain(markers + height, resting))

    assert strain(0) == strain(60) == 0
    assert 0.5 < strain(145) < 3
    assert strain(-20) > 0.5
    assert strain(30, hips=-0.2) > 1


def test_markers_that_are_no_bodys_are_told_by_how_far_they_miss_it():
    body = marker_body(load_body("anny52", "male"))
    rotations = torch.tensor([0.0, 0, 0, 1]).expand(1, 2, 22, 4)
    place, betas = torch.zeros(1, 2, 3), torch.zeros(1, 10)
    own, _ = body.skin(body.shaped(betas), place, matrix_from_rotvec(torch.zeros(1, 2, 22, 3)))
    miss = torch.tensor([0.0, 0.0, 0.05], requires_grad=True)
    blended = (own + (own + miss)) / 2  # as a step hands it on
    off = off_body(TrainingCrowd(blended, place, rotations, betas), body)
    assert off.item() == pytest.approx(0.05, abs=1e-4)
    off.sum().backward()
    assert miss.grad is not None and miss.grad[2] > 0
