import numpy as np
import pytest

from tests.world.fakes import BODIES, HIPS_HEIGHT, start_poses
from wayfarer.errors import ArtifactError
from wayfarer.world.agents.agent import AgentSpec
from wayfarer.world.agents.heading import heading_of
from wayfarer.world.agents.spawn import Spawner, load_start_poses
from wayfarer.world.output.quaternion import multiply

SPAWNER = Spawner(BODIES, start_poses())


def test_stands_on_the_floor_at_its_place():
    motion = SPAWNER.stand(AgentSpec(position=(3.0, -4.0)))
    seed = motion.seed
    np.testing.assert_allclose(seed.translation[0], [[3, -4, HIPS_HEIGHT]] * 2, atol=1e-6)
    assert seed.markers[0, :, -2:, 2].min() == pytest.approx(0, abs=1e-6)
    np.testing.assert_array_equal(seed.markers[0, 0], seed.markers[0, 1])
    assert motion.gait.stop_place[0].tolist() == [3, -4]


def test_heading_turns_body_and_markers_about_the_vertical():
    ahead = SPAWNER.stand(AgentSpec(heading=0.0)).seed
    left = SPAWNER.stand(AgentSpec(heading=np.pi / 2)).seed
    x, y, z = np.moveaxis(ahead.markers[0, 0], -1, 0)
    np.testing.assert_allclose(left.markers[0, 0], np.stack([-y, x, z], -1), atol=1e-6)
    assert heading_of(left.rotations[0, 0, 0]) == pytest.approx(np.pi / 2, abs=1e-6)
    np.testing.assert_array_equal(ahead.rotations[0, 0, 1:], left.rotations[0, 0, 1:])


@pytest.mark.parametrize("heading", [-3.0, -0.5, 0.0, 1.0, 3.1])
def test_heading_is_read_back(heading):
    seed = SPAWNER.stand(AgentSpec(heading=heading)).seed
    assert heading_of(seed.rotations[0, 0, 0]) == pytest.approx(heading, abs=1e-5)


def test_noise_seed_chooses_the_pose_and_betas_the_size():
    poses = start_poses()
    for seed in (0, 1, 2, 2**64 - 1):
        rotations = SPAWNER.stand(AgentSpec(noise_seed=seed)).seed.rotations[0, 0]
        np.testing.assert_allclose(rotations, poses[seed % 2], atol=1e-7)
    tall = SPAWNER.stand(AgentSpec(betas=(2.0,) + (0.0,) * 9)).seed.markers[0, 0, :, 2]
    assert np.ptp(tall) == pytest.approx(1.9, abs=1e-5)


def test_quaternion_product_turns_by_the_second_first():
    about_x = np.array([np.sin(np.pi / 4), 0, 0, np.cos(np.pi / 4)])
    about_z = np.array([0, 0, np.sin(np.pi / 4), np.cos(np.pi / 4)])
    np.testing.assert_allclose(multiply(about_z, about_x), [0.5, 0.5, 0.5, 0.5], atol=1e-12)


def test_start_poses_are_checked(tmp_path):
    path = tmp_path / "start_poses.npz"
    with pytest.raises(ArtifactError, match=r"start_poses\.npz"):
        load_start_poses(path)
    path.write_bytes(b"not a zip file")
    with pytest.raises(ArtifactError, match="cannot be read"):
        load_start_poses(path)
    np.savez(path, other=np.zeros(3))
    with pytest.raises(ArtifactError, match="rotations"):
        load_start_poses(path)
    np.savez(path, rotations=np.zeros((2, 21, 4)))
    with pytest.raises(ArtifactError, match=r"found shape \(2, 21, 4\)"):
        load_start_poses(path)
    np.savez(path, rotations=np.full((2, 22, 4), np.nan))
    with pytest.raises(ArtifactError, match="unit length"):
        load_start_poses(path)
    np.savez(path, rotations=start_poses(3))
    assert load_start_poses(path).shape == (3, 22, 4)
