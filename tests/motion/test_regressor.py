import torch

from wayfarer.body.library import load_body
from wayfarer.engines.torch.marker_bodies import marker_body
from wayfarer.motion.regressor import BodyRegressor, _squash
from wayfarer_lab.training.rotation import matrix_from_rotvec


def regressor():
    torch.manual_seed(0)
    return BodyRegressor(marker_body(load_body("anny52", "male"))).eval()


def test_moving_the_markers_moves_the_hips_and_nothing_else():
    model, markers, betas = regressor(), torch.randn(3, 4, 67, 3), torch.randn(3, 10)
    shift = torch.tensor([5.0, -2.0, 0.7])
    place, rotations = model(markers, betas)
    moved, same = model(markers + shift, betas)
    assert place.shape == (3, 4, 3) and rotations.shape == (3, 4, 22, 3, 3)
    assert torch.allclose(moved, place + shift, atol=1e-4)
    assert torch.allclose(same, rotations, atol=1e-4)


def test_bodies_do_not_influence_each_other():
    model, markers, betas = regressor(), torch.randn(2, 5, 67, 3), torch.randn(2, 10)
    together, alone = model(markers, betas), model(markers[1:], betas[1:])
    for whole, single in zip(together, alone, strict=True):
        assert torch.allclose(whole[1:], single, atol=1e-5)


def watch(model, monkeypatch):
    """Arguments and results of all later passes."""
    passes, correct = [], model.correct

    def watched(*given):
        passes.append((*given, correct(*given)))
        return passes[-1][-1]

    monkeypatch.setattr(model, "correct", watched)
    return passes


def test_each_pass_has_its_network_and_the_first_finds_some_of_the_frames(monkeypatch):
    model, betas = regressor(), torch.randn(2, 10)
    seen = watch(model, monkeypatch)
    for frames, some in ((1, [0]), (2, [0, 1]), (5, [0, 2, 4]), (9, [0, 4, 8])):
        seen.clear()
        found = model.estimates(torch.randn(2, frames, 67, 3), betas, model.body.shaped(betas))
        assert [estimate.frames for estimate in found] == [some, list(range(frames))]
        assert [passed[0] for passed in seen] == list(model.networks)
        assert [passed[1].shape[1] for passed in seen] == [len(some), frames]


def test_the_second_pass_begins_between_the_frames_of_the_first(monkeypatch):
    model, betas = regressor(), torch.zeros(2, 10)
    torch.nn.init.normal_(model.networks[0][-1].weight, std=0.05)
    seen = watch(model, monkeypatch)
    model(torch.randn(2, 5, 67, 3), betas)
    (*_, start, first), (*_, begun, _) = seen
    first = start + first
    hips = begun[..., :3]
    assert torch.allclose(hips[:, ::2], first[..., :3], atol=1e-6)
    assert torch.allclose(hips[:, 1::2], (first[:, :-1, :3] + first[:, 1:, :3]) / 2, atol=1e-6)


def test_with_one_network_it_is_the_paper_s(monkeypatch):
    """Three recursions, each of all frames."""
    model = BodyRegressor(marker_body(load_body("anny52", "male")), networks=1).eval()
    seen = watch(model, monkeypatch)
    model(torch.randn(2, 5, 67, 3), torch.zeros(2, 10))
    assert [passed[0] for passed in seen] == [model.networks[0]] * 3
    assert all(passed[1].shape[1] == 5 for passed in seen)


def test_a_pass_is_told_how_far_off_the_last_one_was(monkeypatch):
    """The untrained network changes almost nothing; for its own markers the error is zero."""
    model, betas = regressor(), torch.randn(4, 10)
    seen = watch(model, monkeypatch)
    rest = torch.eye(3).expand(4, 1, 22, 3, 3)
    bent = matrix_from_rotvec(torch.full((4, 1, 22, 3), 0.2))
    markers, posed = (
        model.body.skin(model.body.shaped(betas), torch.zeros(4, 1, 3), turns)[0]
        for turns in (rest, bent)
    )
    # hips are looked for relative to the centre of the markers, wherever they are
    for given in (markers, markers + torch.tensor([0.1, 0.0, 0.0]), posed):
        model(given - given.mean(-2, keepdim=True), betas)
    resting, moved, off = (passed[2] for passed in seen[::2])
    assert torch.allclose(resting, moved, atol=1e-5)
    assert off.abs().mean() > resting.abs().mean()
    told = seen[5][2]  # of the second pass
    assert torch.allclose(told, off, atol=0.1), "an untrained first pass hardly leaves the T-pose"


def test_rows_by_coordinate_give_what_the_trained_order_gives():
    """`correct` takes the network apart."""
    model = regressor()
    network = model.networks[1]
    markers, error = torch.randn(2, 3, 1, 67, 3)
    betas, turns, hips = torch.randn(3, 10), torch.randn(3, 22, 6), torch.randn(3, 3)
    squashed = _squash(error)
    trained = [markers.flatten(1), betas, squashed.flatten(1), hips, turns.flatten(1)]
    expected = network(torch.cat(trained, -1))
    by_coordinate = [points.transpose(-1, -2) for points in (markers, error)]
    by_number = torch.cat([hips, turns.transpose(1, 2).flatten(1)], -1)
    found = model.correct(network, *by_coordinate, betas, by_number[:, None])[:, 0]
    turned = found[:, 3:].unflatten(1, (6, 22)).transpose(1, 2).flatten(1)
    assert torch.allclose(torch.cat([found[:, :3], turned], -1), expected, atol=1e-5)


def test_errors_are_squashed_by_half_an_arsinh():
    error = torch.linspace(-3, 3, 10_001, dtype=torch.float64)
    expected = torch.asinh(100 * error) / 2
    found = _squash(error)
    assert (found - expected).abs().max() < 4e-4
    assert ((found - expected) / expected.abs().clamp(min=1e-9)).abs().max() < 2e-4


def test_no_gradient_flows_between_passes(monkeypatch):
    model, betas = regressor(), torch.zeros(2, 10)
    for network in model.networks:
        torch.nn.init.normal_(network[-1].weight, std=0.1)
    seen = watch(model, monkeypatch)
    place, _ = model(torch.randn(2, 1, 67, 3), betas)
    states = [passed[-1] for passed in seen]
    for state in states:
        state.retain_grad()
    place.sum().backward()
    assert [s.grad is not None for s in states] == [False, True]
