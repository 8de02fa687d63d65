"""A made-up checkpoint of VPoser v2's layout: names and shapes as in the public one."""

import collections

import pytest
import torch

from wayfarer.errors import ArtifactError
from wayfarer_lab.training.pose_prior import load_pose_prior
from wayfarer_lab.training.rotation import matrix_from_rotvec
from wayfarer_lab.training.vposer import load_vposer

NEURONS = 16


class Stranger:
    """Some library's object in a checkpoint; to unpickle it would run its code."""

    made = 0

    def __init__(self) -> None:
        self.note = "state"

    def __setstate__(self, state) -> None:
        Stranger.made += 1


def linear(out, into):
    return {"weight": torch.randn(out, into) * 0.3, "bias": torch.randn(out) * 0.1}


def norm(size):
    return {
        "weight": torch.rand(size) + 0.5,
        "bias": torch.randn(size) * 0.1,
        "running_mean": torch.randn(size) * 0.1,
        "running_var": torch.rand(size) + 0.5,
        "num_batches_tracked": torch.tensor(7),
    }


@pytest.fixture
def layers():
    torch.manual_seed(0)
    return {
        "encoder_net.1": norm(63),
        "encoder_net.2": linear(NEURONS, 63),
        "encoder_net.4": norm(NEURONS),
        "encoder_net.6": linear(NEURONS, NEURONS),
        "encoder_net.7": linear(NEURONS, NEURONS),
        "encoder_net.8.mu": linear(32, NEURONS),
        "encoder_net.8.logvar": linear(32, NEURONS),
        "decoder_net.0": linear(NEURONS, 32),
        "decoder_net.3": linear(NEURONS, NEURONS),
        "decoder_net.5": linear(126, NEURONS),
    }


def save(path, layers, prefix="vp_model.", **others):
    state = {f"{prefix}{a}.{b}": t for a, part in layers.items() for b, t in part.items()}
    torch.save({"state_dict": collections.OrderedDict(state), **others}, path)
    return path


def test_the_encoder_computes_what_the_layers_say(tmp_path, layers):
    """Written out by hand from the layers; in VPoser's basis (x, y, z) is our (-x, z, y)."""
    rotvecs = torch.randn(5, 21, 3) * 0.4
    model = load_vposer(save(tmp_path / "v.ckpt", layers))
    with torch.no_grad():
        got = model.encode(matrix_from_rotvec(rotvecs))

    def apply(name, x):
        p = layers[name]
        if "running_mean" in p:
            scaled = (x - p["running_mean"]) / torch.sqrt(p["running_var"] + 1e-5)
            return scaled * p["weight"] + p["bias"]
        return x @ p["weight"].T + p["bias"]

    x = torch.stack([-rotvecs[..., 0], rotvecs[..., 2], rotvecs[..., 1]], -1).flatten(1)
    x = apply("encoder_net.2", apply("encoder_net.1", x))
    x = apply("encoder_net.4", torch.where(x > 0, x, 0.01 * x))
    x = apply("encoder_net.7", apply("encoder_net.6", x))
    spread = torch.log(1 + torch.exp(apply("encoder_net.8.logvar", x)))
    assert torch.allclose(got.mean, apply("encoder_net.8.mu", x), atol=1e-4)
    assert torch.allclose(torch.exp(0.5 * got.log_variance), spread, atol=1e-4)


def test_the_decoder_reads_6d_entry_by_entry(tmp_path, layers):
    """With no weights, the last bias is the pose: columns e_z, e_x give a cyclic turn."""
    layers["decoder_net.5"]["weight"].zero_()
    layers["decoder_net.5"]["bias"][:] = torch.tensor([0.0, 1, 0, 0, 1, 0]).repeat(21)
    model = load_vposer(save(tmp_path / "v.ckpt", layers))
    with torch.no_grad():
        got = model.decode(torch.zeros(1, 32))[0, 4]
    theirs = torch.tensor([[0.0, 1, 0], [0, 0, 1], [1, 0, 0]])  # columns z, x, y
    basis = torch.tensor([[-1.0, 0, 0], [0, 0, 1], [0, 1, 0]])
    assert torch.allclose(got, basis @ theirs @ basis, atol=1e-6)


def test_objects_of_other_libraries_are_not_brought_to_life(tmp_path, layers):
    path = save(tmp_path / "v.ckpt", layers, callbacks={Stranger: Stranger()})
    Stranger.made = 0
    assert load_vposer(path).encoder[1].out_features == NEURONS
    assert Stranger.made == 0


def test_tensors_alone_and_without_prefix_will_do(tmp_path, layers):
    state = {f"{a}.{b}": t for a, part in layers.items() for b, t in part.items()}
    torch.save(state, tmp_path / "plain.pt")
    assert isinstance(
        load_pose_prior(tmp_path / "plain.pt"), type(load_vposer(tmp_path / "plain.pt"))
    )


def test_a_missing_or_misshapen_tensor_is_named(tmp_path, layers):
    layers["decoder_net.3"]["weight"] = torch.zeros(NEURONS, 3)
    with pytest.raises(ArtifactError, match=r"decoder_net.3.weight: found shape \(16, 3\)"):
        load_vposer(save(tmp_path / "a.ckpt", layers))
    del layers["decoder_net.3"]
    with pytest.raises(ArtifactError, match=r"decoder_net.3.*missing"):
        load_vposer(save(tmp_path / "b.ckpt", layers))


def test_other_files_are_refused(tmp_path, layers):
    torch.save({"state_dict": {"body.weight": torch.zeros(2)}}, tmp_path / "other.ckpt")
    with pytest.raises(ArtifactError, match=r"no VPoser v2.*body.weight"):
        load_vposer(tmp_path / "other.ckpt")
    (tmp_path / "text.ckpt").write_text("hello")
    with pytest.raises(ArtifactError, match="cannot be read"):
        load_vposer(tmp_path / "text.ckpt")
