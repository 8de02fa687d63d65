import pytest
import torch

from wayfarer.errors import ArtifactError
from wayfarer_lab.training.dataset import Poses
from wayfarer_lab.training.pose_networks import PosePrior
from wayfarer_lab.training.pose_prior import (
    PosePriorConfig,
    PosePriorTrainer,
    angles,
    load_pose_prior,
    train_pose_prior,
)
from wayfarer_lab.training.rotation import (
    matrix_from_quaternion,
    matrix_from_rotvec,
    quaternion_from_matrix,
)

SMALL = PosePriorConfig(steps=300, batch=128, rate=2e-3)


def bending_poses(seed: int, count: int = 600, spread: float = 1.0) -> Poses:
    """People whose joints all bend together, by an amount of two kinds: easy to code."""
    generator = torch.Generator().manual_seed(seed)
    ways = torch.randn(2, 22, 3, generator=torch.Generator().manual_seed(9)) * 0.4
    amounts = spread * torch.randn(count, 2, generator=generator)
    rotations = matrix_from_rotvec(torch.einsum("nk,kjc->njc", amounts, ways))
    return Poses(
        hips=torch.zeros(count, 3),
        rotations=quaternion_from_matrix(rotations),
        run=torch.ones(count, dtype=torch.long),
        weight=torch.ones(count),
    )


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs") / "prior"
    assert train_pose_prior(SMALL, bending_poses(0), bending_poses(1), folder)
    return folder


def test_a_short_training_learns_poses_it_has_not_seen(trained):
    last = (trained / "log.txt").read_text().splitlines()[-1]
    fresh = PosePriorTrainer(SMALL, bending_poses(0), bending_poses(1)).validate()
    degrees = float(last.split("val/degrees")[1].split()[0])
    assert degrees < 0.3 * fresh["val/degrees"]


def test_usual_poses_lie_near_the_middle_and_rare_ones_do_not(trained):
    prior = load_pose_prior(trained)
    with torch.no_grad():
        usual, rare = (
            prior.encode(matrix_from_quaternion(bending_poses(2, spread=spread).rotations[:, 1:]))
            for spread in (0.3, 2.0)
        )
    assert rare.mean.square().mean() > 3 * usual.mean.square().mean()


def test_angles_are_degrees_between_rotations():
    torch.manual_seed(0)
    turn = matrix_from_rotvec(torch.tensor([[0.0, 0.0, torch.pi / 3], [0.01, 0, 0], [3.1, 0, 0]]))
    base = matrix_from_rotvec(torch.randn(3, 3))
    expected = torch.tensor([60.0, 0.573, 177.617])
    assert torch.allclose(angles(base @ turn, base), expected, atol=0.05)


def test_a_folder_without_a_run_is_refused(tmp_path):
    with pytest.raises(ArtifactError, match="no checkpoint"):
        load_pose_prior(tmp_path)


def test_what_is_loaded_is_what_was_trained(trained):
    loaded = load_pose_prior(trained)
    assert isinstance(loaded, PosePrior)
    saved = torch.load(trained / "last.pt", weights_only=True)["model"]
    assert all(torch.equal(saved[k], v) for k, v in loaded.state_dict().items())
