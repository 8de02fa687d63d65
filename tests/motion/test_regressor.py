import torch

from wayfarer.body.library import load_body
from wayfarer.marker_bodies import marker_body
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


def test_frames_of_a_row_do_not_influence_each_other():
    model, markers, betas = regressor(), torch.randn(2, 5, 67, 3), torch.randn(2, 10)
    together, alone = model(markers, betas), model(markers[:, 2:3], betas)
    for whole, single in zip(together, alone, strict=True):
        assert torch.allclose(whole[:, 2:3], single, atol=1e-5)


def watch(model, monkeypatch):
    """Arguments and results of all passes to come."""
    passes, correct = [], model.correct

    def watched(*given):
        passes.append((*given, correct(*given)))
        return passes[-1][-1]

    monkeypatch.setattr(model, "correct", watched)
    return passes


def test_a_pass_is_told_how_far_off_the_last_one_was(monkeypatch):
    """The untrained network says next to nothing; given its own markers the error input is zero."""
    model, betas = regressor(), torch.randn(4, 10)
    seen = watch(model, monkeypatch)
    rest = torch.eye(3).expand(4, 1, 22, 3, 3)
    markers, _ = model.body.skin(model.body.shaped(betas), torch.zeros(4, 1, 3), rest)
    model(markers - markers.mean(-2, keepdim=True), betas, passes=1)
    model(markers + torch.tensor([0.1, 0.0, 0.0]), betas, passes=1)
    errors = [error for _, error, _, _ in seen]
    # hips are looked for relative to the centre of the markers, wherever they are
    assert torch.allclose(errors[0], errors[1], atol=1e-2)
    bent = matrix_from_rotvec(torch.full((4, 1, 22, 3), 0.2))
    markers, _ = model.body.skin(model.body.shaped(betas), torch.zeros(4, 1, 3), bent)
    model(markers, betas, passes=1)
    assert seen[2][1].abs().mean() > errors[0].abs().mean()


def test_rows_by_coordinate_give_what_the_trained_order_gives():
    """`know` and `correct` take the network apart; together they are the network."""
    model = regressor()
    markers, error = torch.randn(2, 3, 67, 3)
    betas, state = torch.randn(3, 10), torch.randn(3, 22, 6)
    hips = torch.randn(3, 3)
    trained = [markers.flatten(1), betas, error.flatten(1), hips, state.flatten(1)]
    expected = model.network(torch.cat(trained, -1))
    by_coordinate = [points.transpose(1, 2).flatten(1) for points in (markers, error)]
    by_number = torch.cat([hips, state.transpose(1, 2).flatten(1)], -1)
    known = model.know(by_coordinate[0][:, None], betas)
    found = model.correct(known, by_coordinate[1], by_number)
    turns = found[:, 3:].unflatten(1, (6, 22)).transpose(1, 2).flatten(1)
    assert torch.allclose(torch.cat([found[:, :3], turns], -1), expected, atol=1e-5)


def test_errors_are_squashed_by_half_an_arsinh():
    error = torch.linspace(-3, 3, 10_001, dtype=torch.float64)
    expected = torch.asinh(100 * error) / 2
    found = _squash(error)
    assert (found - expected).abs().max() < 4e-4
    assert ((found - expected) / expected.abs().clamp(min=1e-9)).abs().max() < 2e-4


def test_no_gradient_flows_between_passes(monkeypatch):
    model, betas = regressor(), torch.zeros(2, 10)
    torch.nn.init.normal_(model.network[-1].weight, std=0.1)
    seen = watch(model, monkeypatch)
    place, _ = model(torch.randn(2, 1, 67, 3), betas, passes=3)
    states = [passed[-1] for passed in seen]
    for state in states:
        state.retain_grad()
    place.sum().backward()
    assert [s.grad is not None for s in states] == [False, False, True]
