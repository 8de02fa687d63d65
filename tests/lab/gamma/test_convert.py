"""Imported weights give what GAMMA-release's networks give (`release.py`), on made-up weights."""

import numpy as np
import pytest
import torch

from tests.lab.gamma import release
from wayfarer.body.rotation import GLTF_FROM_CORE
from wayfarer.errors import ArtifactError
from wayfarer.motion.policy import Condition
from wayfarer_lab.gamma.convert import load_policy, load_predictor, load_regressor
from wayfarer_lab.training.smpl_joints import SmplJoints

CLOSE = {"atol": 2e-5, "rtol": 1e-5}


@pytest.fixture(autouse=True)
def _same_weights():
    torch.manual_seed(4)


@pytest.mark.parametrize(("seed_frames", "prefix"), [(1, ""), (2, ""), (2, "predictor.")])
def test_the_predictor_decodes_and_encodes_alike(seed_frames, prefix, tmp_path) -> None:
    theirs = release.Predictor().eval()
    ours = load_predictor(release.save(tmp_path / "e.ckp", theirs, prefix), seed_frames)
    seed, future = torch.randn(seed_frames, 3, 201), torch.randn(10 - seed_frames, 3, 201)
    latent = torch.randn(3, 5, 128)
    with torch.no_grad():
        expected = [theirs.decode(seed, latent[:, k], 10 - seed_frames) for k in range(5)]
        mean, log_variance = theirs.encode(seed, future)
        found = ours.decode(seed.transpose(0, 1), latent)
        posterior = ours.encode(seed.transpose(0, 1), future.transpose(0, 1))
    torch.testing.assert_close(found, torch.stack(expected, 1).permute(2, 1, 0, 3), **CLOSE)
    torch.testing.assert_close(posterior.mean, mean, **CLOSE)
    torch.testing.assert_close(posterior.log_variance, log_variance, **CLOSE)


@pytest.mark.parametrize("seed_frames", [1, 2])
def test_the_policy_acts_alike_whatever_else_is_asked(seed_frames, tmp_path) -> None:
    theirs = release.Policy().eval()
    theirs.pnet.out_fc.weight.data *= 20  # some log variances shall pass the limits
    ours = load_policy(release.save(tmp_path / "e.ckp", theirs))
    seed, goal = torch.randn(4, seed_frames, 67, 3), torch.randn(4, 3) * 5
    ways = torch.nn.functional.normalize(goal[:, None, None] - seed, dim=-1)
    state = torch.cat([seed.flatten(2), ways.flatten(2)], -1)
    asked = Condition(goal, torch.rand(4), torch.randn(4, 2), torch.rand(4, 12), torch.zeros(4, 8))
    with torch.no_grad():
        mean, log_variance = theirs(state.transpose(0, 1))
        found = ours(seed.flatten(2), asked)
    assert (log_variance.abs() > 2.5).any()
    torch.testing.assert_close(found.mean, mean, **CLOSE)
    torch.testing.assert_close(found.log_std.exp() ** 2, log_variance.clamp(-2.5, 2.5).exp())


def rotations_of(numbers: np.ndarray) -> np.ndarray:
    """[..., 6] → [..., 3, 3] by Gram-Schmidt on the columns of a 3 × 2 matrix."""
    a, b = np.moveaxis(numbers.reshape(*numbers.shape[:-1], 3, 2), -1, 0)
    x = a / np.linalg.norm(a, axis=-1, keepdims=True)
    y = b - (x * b).sum(-1, keepdims=True) * x
    y = y / np.linalg.norm(y, axis=-1, keepdims=True)
    return np.stack([x, y, np.cross(x, y)], -1)


def joints_of(rest, root_at, turns) -> np.ndarray:
    """Places of a chain of joints [3, 3]: rest places, the first at `root_at`, local rotations."""
    places, world = [root_at], turns[0]
    for j in (1, 2):
        places.append(places[-1] + world @ (rest[j] - rest[j - 1]))
        world = world @ turns[j]
    return np.array(places)


def test_the_regressor_finds_the_same_body_in_our_frame(tmp_path) -> None:
    theirs = release.Regressor().eval()
    theirs.pnet.out_fc.bias.data[3:135] += torch.tensor([1.0, 0, 0, 1, 0, 0]).repeat(22) / 3
    rng = np.random.default_rng(0)
    root = SmplJoints(rng.normal(size=(22, 3)), rng.normal(0, 0.01, (22, 3, 16)))
    ours = load_regressor(release.save(tmp_path / "e.ckp", theirs, "regressor."), root)
    markers, betas = torch.randn(2, 3, 67, 3), torch.randn(2, 10)
    with torch.no_grad():
        hips, rotations = ours(markers, betas)
        every = betas[:, None].expand(-1, 3, -1).flatten(0, 1)
        found = theirs(markers.flatten(0, 1).flatten(1), every).numpy()
    place, sixd = found[:, :3], found[:, 3:135].reshape(-1, 22, 6)
    turns = rotations_of(sixd)
    at = place + [root.rest(b)[0] for b in every.numpy()]  # SMPL: v = R (v - j0) + j0 + transl
    np.testing.assert_allclose(hips.flatten(0, 1), at, atol=1e-4)
    rest = rng.normal(size=(3, 3))
    axes = GLTF_FROM_CORE  # a body in our frame is the file's, turned: places rest @ axesᵀ
    for row in range(6):
        expected = joints_of(rest, at[row], turns[row, :3])
        mine = joints_of(rest @ axes.T, at[row], rotations.flatten(0, 1)[row, :3].numpy())
        np.testing.assert_allclose(mine, expected, atol=1e-4)
        np.testing.assert_allclose(
            rotations.flatten(0, 1)[row, 0].numpy() @ axes, turns[row, 0], atol=1e-5
        )


def test_what_does_not_fit_is_named(tmp_path) -> None:
    path = release.save(tmp_path / "policy.ckp", release.Policy())
    with pytest.raises(ArtifactError, match=r"policy\.ckp: tensor x_enc.weight_ih_l0 has shape"):
        load_predictor(path, 2)
    with pytest.raises(ArtifactError, match=r"tensor pnet\.out_fc\.weight is missing"):
        load_policy(release.save(tmp_path / "predictor.ckp", release.Predictor()))
    angles = release.save(tmp_path / "aa.ckp", release.Regressor(out=93))
    with pytest.raises(ArtifactError, match="axis-angle"):
        load_regressor(angles, SmplJoints(np.zeros((22, 3)), np.zeros((22, 3, 10))))


class Stranger:
    """Unpickling it would run its code."""

    made = 0

    def __reduce__(self):
        return (_made, ())


def _made() -> int:
    Stranger.made += 1
    return 1


def test_no_code_of_the_file_runs(tmp_path) -> None:
    path = release.save(tmp_path / "e.ckp", release.Predictor(), optimizer=Stranger())
    load_predictor(path, 1)
    assert Stranger.made == 0
