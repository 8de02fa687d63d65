"""Hindsight and cloning on made-up motion and untrained networks."""

from dataclasses import replace
from math import pi

import pytest
import torch

from tests.lab.training.fakes import gliding_frames, walking_frames
from wayfarer.body.library import load_body
from wayfarer.engines.torch.marker_bodies import marker_body
from wayfarer.errors import ArtifactError
from wayfarer.motion.frame import canonical_frame, to_local
from wayfarer.motion.policy import Gaussian, GoalPolicy
from wayfarer.motion.predictor import MarkerPredictor, Posterior
from wayfarer.motion.quality import Sites
from wayfarer.motion.regressor import BodyRegressor
from wayfarer.motion.trajectory import HORIZONS, Asked, asked_of
from wayfarer.spec import FPS, GENDERS, SEED_FRAMES, STEP_SECONDS
from wayfarer_lab.training.cloning import (
    SWAY,
    TEMPERATURE,
    UNSEEN,
    CloningConfig,
    Hindsight,
    divergence,
    load_trajectory_policy,
    smoothed,
    train_cloning,
)
from wayfarer_lab.training.costs import FACED, Wish, costs_of, waist_height
from wayfarer_lab.training.following import (
    FollowingConfig,
    FollowingTrainer,
    train_following,
)
from wayfarer_lab.training.likeness import LEG, RecordedWindows
from wayfarer_lab.training.orders import Orders


@pytest.fixture
def runs(tmp_path):
    """Run folders of untrained networks, which hardly move a body."""
    torch.manual_seed(0)
    networks = {"predictor": MarkerPredictor(2, at_once=8)}
    for gender in GENDERS:
        networks[gender] = BodyRegressor(marker_body(load_body("anny52", gender)))
    for name, network in networks.items():
        (tmp_path / name).mkdir()
        torch.save({"model": network.state_dict()}, tmp_path / name / "last.pt")
    regressors = {g: str(tmp_path / g) for g in GENDERS}
    return {"predictor": str(tmp_path / "predictor"), "regressors": regressors}


def asked_at(frames, hindsight, at, off=0.0):
    """What hindsight asks of the recorded bodies at frames `at`, `off` metres beside their path."""
    begin = at - 1
    frame = canonical_frame(frames.hips[begin], frames.hips_rotation[begin])
    markers = frames.markers[torch.stack([begin, at], 1)]
    seed = to_local(frame, markers.flatten(1, 2)).reshape(len(at), SEED_FRAMES, -1)
    return hindsight.asked(at, frames.hips[at, :2] + off, frame, seed), frame


def test_hindsight_asks_for_the_speed_of_the_recording():
    frames = gliding_frames()
    at = torch.tensor([20, 110])
    asked, frame = asked_at(frames, Hindsight(frames), at)
    ahead = at[:, None] + torch.tensor(HORIZONS)
    ways = (frames.hips[ahead] - frames.hips[at, None])[..., :2] @ frame.rotation[:, :2, :2]
    assert torch.allclose(asked.ways, ways, atol=0.01)


def test_of_a_body_that_stops_hindsight_asks_for_its_place_of_rest():
    frames = gliding_frames(clips=1, length=300)
    moved = torch.arange(300).clamp(max=150)  # it stands from frame 150 on
    frames = replace(frames, hips=frames.hips[moved], markers=frames.markers[moved])
    at = torch.tensor([140, 200])
    asked, _ = asked_at(frames, Hindsight(frames), at)
    left = (frames.hips[150] - frames.hips[140]).norm()
    assert asked.ways[0, 2].norm() <= left * 0.9
    assert asked.ways[1].norm() < 0.01


@pytest.mark.parametrize(
    ("angle_at", "asked_for"),
    [
        (lambda time: 0.5 * time, 0.5 * 0.4),  # faces a point a metre ahead
        (lambda time: 1.5 * time, 1.5),  # turns back
        (lambda time: 0.15 * torch.sin(2 * torch.pi * time), 0.0),  # twists with its strides
    ],
)
def test_hindsight_asks_for_the_turn_but_not_for_the_twist(angle_at, asked_for):
    frames = gliding_frames(clips=1, length=200)
    at = torch.tensor([100])
    angle = angle_at((torch.arange(200) - at) / FPS)
    rotations = frames.hips_rotation.clone()
    rotations[:, :, 1] = torch.stack([-torch.sin(angle), torch.cos(angle), 0 * angle], -1)
    hindsight = Hindsight(replace(frames, hips_rotation=rotations))
    asked, _ = asked_at(frames, hindsight, at)
    turned = torch.atan2(-asked.facings[0, 2, 0], asked.facings[0, 2, 1])
    assert (turned - asked_for * 15 / 16).abs() < 0.04


def test_a_body_that_has_left_the_path_is_asked_back():
    frames = gliding_frames()
    hindsight, at = Hindsight(frames), torch.tensor([20])
    on, off = (asked_at(frames, hindsight, at, d)[0].ways for d in (0.0, 0.1))
    assert ((on - off)[:, 2] > 0.09).all()


def test_smoothing_keeps_to_a_stretch():
    run = torch.tensor([3, 2, 1, 0, 2, 1])
    values = torch.tensor([1.0, 1, 1, 50, 7, 7])[:, None]
    assert torch.allclose(smoothed(values, run, SWAY), values)
    time = torch.arange(80) / FPS
    sway = torch.sin(2 * torch.pi * 2 * time)[:, None]  # two steps a second
    assert smoothed(sway, torch.arange(80, 0, -1), SWAY)[20:60].abs().max() < 0.4


def test_the_divergence_is_that_of_a_narrowed_posterior_from_a_warmer_policy():
    generator = torch.Generator().manual_seed(0)
    mean, other, log, width = (torch.randn(4, 128, generator=generator) * 0.5 for _ in range(4))
    normal = torch.distributions.Normal
    expected = torch.distributions.kl_divergence(
        normal(mean, UNSEEN**0.5 * torch.exp(0.5 * log)),
        normal(other, torch.exp(width) / TEMPERATURE),
    )
    found = divergence(Posterior(mean, log), Gaussian(other, width))
    assert torch.allclose(found, expected.mean(-1), rtol=1e-4)


def test_cloning_learns_resumes_and_is_followed(runs, tmp_path):
    """Codes of an untrained encoder are a function of the seed: there is something to learn."""
    data, held = gliding_frames(), gliding_frames(seed=1)
    config = CloningConfig(
        **runs, steps=30, batch=16, rollout=3, hidden=32, rate=3e-3, mix={"walk": 1.0}
    )
    out = tmp_path / "cloned"
    assert not train_cloning(config, data, held, out, minutes=0.001)
    assert train_cloning(config, data, held, out)
    assert "val/kl" in (out / "log.txt").read_text()
    policy = load_trajectory_policy(out)
    assert any(p.abs().sum() > 0 for p in policy.net[-1].parameters())

    following = FollowingConfig(
        **runs, start_from=str(out), steps=2, agents=6, horizon=2, mix={"walk": 1.0}
    )
    assert train_following(following, data, held, tmp_path / "following")
    taught = load_trajectory_policy(tmp_path / "following")
    pairs = zip(taught.parameters(), policy.parameters(), strict=True)
    assert any(not torch.equal(a, b) for a, b in pairs)

    out = tmp_path / "alike"
    judged = {"horizon": 4, "steps": 4, "like_weight": 1.0}
    alike = following.model_copy(update=judged)
    assert not train_following(alike, data, held, out, minutes=0.0001)
    assert train_following(alike, data, held, out)
    assert torch.load(out / "last.pt", weights_only=True)["critic_male"]["mean"].any()


def test_the_paper_s_policy_is_no_start(runs, tmp_path):
    (tmp_path / "goal").mkdir()
    torch.save({"model": GoalPolicy(16).state_dict()}, tmp_path / "goal" / "last.pt")
    with pytest.raises(ArtifactError, match="a cloned one is needed"):
        load_trajectory_policy(tmp_path / "goal")


@pytest.fixture
def standing():
    """Costs of a T-pose on the floor that faces +Y and stands, with a left leg that is moved."""
    model = load_body("anny52", "male")
    names, body = list(model.marker_names), marker_body(model)
    hips, unturned = torch.zeros(1, 10, 3), torch.eye(3).expand(1, 10, 22, 3, 3)
    markers, _ = body.skin(body.shaped(torch.zeros(1, 10)), hips, unturned)
    markers[..., 2] -= markers[..., 2].min()
    sites, leg = Sites.from_names(names), [names.index("L" + name) for name in LEG]
    ahead, no = torch.tensor([0.0, 1.0]), torch.tensor([False])

    def costs(moved=None, facing=ahead, **wishes):
        body = markers.clone()
        if moved is not None:
            body[:, :, leg] += moved
        wish = Wish(
            Asked(torch.zeros(1, 3, 2), facing.expand(1, 3, 2)),
            goal=torch.zeros(1, 2), speed=torch.zeros(1),
            waist_up=waist_height(marker_body(model), torch.zeros(1, 10), sites),
            headed=~no, stands=no, walks=no, straight=no,
        )._replace(**wishes)  # fmt: skip
        return costs_of(body[:, :2], body[:, 2:], body[:, -1], wish, sites)

    return costs


def test_costs_of_a_body_that_glides_upright(runs, tmp_path):
    """A T-pose that glides 0.2 m in a step: on its way, with soles that slide at its speed."""
    model = load_body("anny52", "male")
    body = marker_body(model)
    identity = torch.eye(3).expand(1, 10, 22, 3, 3)
    shape = body.shaped(torch.zeros(1, 10))
    place = torch.zeros(1, 10, 3)
    place[..., 1] = torch.arange(10) / FPS
    markers, _ = body.skin(shape, place, identity)
    markers[..., 2] -= markers[..., 2].min()
    ways = torch.tensor([[[0.0, 0.2], [0.0, 0.5], [0.0, 1.0]]])
    facings = torch.tensor([0.0, 1.0]).expand(1, 3, 2)
    sites = Sites.from_names(model.marker_names)
    waist_up = waist_height(body, torch.zeros(1, 10), sites)
    stands = torch.tensor([True])
    wish = Wish(
        Asked(ways, facings),
        goal=torch.tensor([[0.0, 1.2]]), speed=torch.ones(1), waist_up=waist_up,
        headed=stands, stands=stands, walks=~stands, straight=~stands,
    )  # fmt: skip

    def cost(markers, stands=stands, **other):
        asked = wish._replace(stands=stands, walks=~stands, straight=~stands, **other)
        return costs_of(markers[:, :2], markers[:, 2:], markers[:, -1], asked, sites)

    costs = cost(markers)
    assert costs.way[0].tolist() == pytest.approx([0, 0], abs=1e-4)
    assert costs.facing.item() == pytest.approx(0, abs=1e-3)
    assert costs.slide.item() == pytest.approx(1.5, abs=0.1)  # 1 m/s, half again for the rest
    assert costs.seam.item() == pytest.approx(0, abs=1e-3)
    assert costs.floating.item() < 0.01
    still = cost(markers[:, :1].expand(-1, 10, -1, -1))
    assert still.slide.item() < 1e-4 and costs.lingers == 0
    assert still.way[0].tolist() == pytest.approx([0, -1.0], abs=1e-3)
    assert still.squat.item() == 0
    sunk = markers - torch.tensor([0.0, 0.0, 0.05])  # as if the knees gave way by 5 cm
    low = [cost(sunk, who).squat.item() for who in (stands, ~stands)]
    assert low[0] == pytest.approx(0.05 / waist_up.item() - 0.012, abs=2e-3) and low[1] == 0
    strides = markers.clone()
    strides[:, :, sites.left_ankle, 1] += 0.2
    apart = [cost(strides, who).apart.item() for who in (stands, ~stands)]
    assert apart == pytest.approx([0.12, 0], abs=0.01) and costs.apart.item() == 0


@pytest.mark.parametrize("degrees, chord", [(0, 0), (4, 0.0698), (40, FACED)])
def test_every_degree_of_a_facing_costs_as_much_up_to_a_few(standing, degrees, chord):
    angle = torch.tensor(degrees * pi / 180)
    facing = torch.stack([-torch.sin(angle), torch.cos(angle)])
    costs = standing(facing=facing)
    assert costs.faced.item() == pytest.approx(chord, abs=2e-3)
    assert costs.facing.item() == pytest.approx(1 - torch.cos(angle).item(), abs=2e-3)
    assert standing(facing=facing, headed=torch.tensor([False])).faced == 0


@pytest.mark.parametrize(
    "beside, speed, cost", [(0.0, 0.0, 0), (0.2, 0.0, 0.16), (0.2, 0.2, 0.08), (0.5, 0.0, 0)]
)
def test_a_slow_body_beside_its_goal_lingers(standing, beside, speed, cost):
    costs = standing(goal=torch.tensor([[beside, 0.0]]), speed=torch.tensor([speed]))
    assert costs.lingers.item() == pytest.approx(cost, abs=2e-3)


def test_steps_are_too_short_or_too_narrow_while_both_feet_rest(standing):
    """The left foot is ahead by `length` from ankle to ankle, and as far to the left as it was."""

    def stepped(length, aside=0.0, **other):
        walks = torch.tensor([True])
        far = torch.tensor([[0.0, 3.0]])
        moved = torch.tensor([-aside, length, 0.0])
        return standing(moved, **{"walks": walks, "straight": walks, "goal": far} | other)

    asked = stepped(0.8, speed=torch.ones(1))
    assert asked.short.item() == 0 and asked.narrow.item() == 0
    short = [stepped(length, speed=torch.ones(1)).short.item() for length in (0.2, 0.3)]
    assert short[0] - short[1] == pytest.approx(0.1, abs=0.02) and short[1] > 0.2
    near = torch.tensor([[0.0, 0.5]])
    assert stepped(0.2, speed=torch.ones(1), goal=near).short == 0
    narrow = [stepped(0.6, aside).narrow.item() for aside in (-0.2, -0.25)]
    assert narrow[1] - narrow[0] == pytest.approx(0.05, abs=0.01) and narrow[0] > 0
    assert stepped(0.6, -0.2, straight=torch.tensor([False])).narrow == 0
    assert stepped(0.0, -0.2).narrow == 0  # feet abreast make no step


def test_a_critic_s_recorded_people_have_feet_as_far_apart_as_recorded():
    """Bodies of other shapes do, too."""
    frames, body = walking_frames(), marker_body(load_body("anny52", "female"))
    names = list(load_body("anny52", "female").marker_names)
    left, right = (names.index(side + "SOLE_HEEL") for side in "LR")

    def width(markers):
        torch.manual_seed(0)
        windows = RecordedWindows(replace(frames, markers=markers), body, 9)
        view = windows.view(torch.arange(8))
        apart = view.markers[:, :, right] - view.markers[:, :, left]
        return (apart * view.turns[..., 0]).sum(-1).mean(-1)

    wider = frames.markers.clone()
    wider[:, right] += 0.1 * frames.hips_rotation[:, :, 0]
    assert torch.allclose(width(wider) - width(frames.markers), torch.tensor(0.1), atol=0.025)


def test_orders_are_put_row_by_row(runs):
    mine = Orders(torch.zeros(3, 2), torch.zeros(3), torch.zeros(3, 2), torch.zeros(3))
    mine.put(
        torch.tensor([False, True, False]),
        Orders(torch.ones(3, 2), torch.ones(3), torch.ones(3, 2), torch.ones(3)),
    )
    assert mine.speed.tolist() == [0, 1, 0] and mine.goal[:, 0].tolist() == [0, 1, 0]


def test_an_agent_that_follows_its_goal_goes_in_a_curve():
    """At 1 m/s and a quarter of a radian a step the circle has a radius of .8 m."""
    stays, bends = torch.tensor([[3.0, 0.0]]), torch.tensor([0.25])
    orders = Orders(
        goal=stays.expand(2, 2).clone(),
        speed=torch.ones(2),
        facing=torch.zeros(2, 2),
        bend=torch.cat([torch.zeros(1), bends]),
    )
    place, places = torch.zeros(2, 2), []
    for _ in range(25):
        orders.follow(place)
        way = orders.goal - place
        place = place + STEP_SECONDS * way / way.norm(dim=-1, keepdim=True)
        places.append(place)
    assert orders.curves.tolist() == [False, True]
    assert torch.equal(orders.goal[0], stays[0])
    circle = torch.stack(places)[:, 1]
    off = (circle - circle.mean(0)).norm(dim=-1)
    assert off.min() > 0.75 and off.max() < 0.85
    first, second = circle[1] - circle[0], circle[2] - circle[1]
    assert first[0] * second[1] - first[1] * second[0] > 0  # to the left


def test_a_walker_is_not_paid_for_lifting_a_sliding_foot():
    """Its soles should rest. An agent that steps aside has to lift its feet."""
    sites = Sites.from_names(load_body("anny52", "male").marker_names)
    seed, future = torch.rand(2, 2, 67, 3), torch.rand(2, 8, 67, 3)
    soles = sites.left_sole + sites.right_sole
    future[:, :, soles, 2] = 0.01
    future.requires_grad_()
    asked = asked_of(seed.flatten(2), torch.ones(2, 3), torch.ones(2), torch.zeros(2, 2))
    walks = torch.tensor([True, False])
    ones, stands = torch.ones(2), torch.zeros(2) > 0
    wish = Wish(asked, torch.ones(2, 2), ones, ones, stands, stands, walks, walks)
    costs = costs_of(seed, future, future[:, -1], wish, sites)
    (slope,) = torch.autograd.grad(costs.slide.sum(), future)
    lifts = slope[:, :, soles, 2].abs().amax((1, 2))
    assert lifts[0] == 0 and lifts[1] > 0


def test_a_fallen_agent_teaches_nothing_and_is_replaced(runs, tmp_path):
    data = gliding_frames()
    config = CloningConfig(**runs, steps=1, batch=8, rollout=1, hidden=16, mix={"walk": 1.0})
    assert train_cloning(config, data, data, tmp_path / "cloned")
    trainer = FollowingTrainer(
        FollowingConfig(
            **runs, start_from=str(tmp_path / "cloned"), agents=4, horizon=1, mix={"walk": 1.0}
        ),
        data, data,
    )  # fmt: skip
    trainer.run = type("Run", (), {"step": 0})()
    crowd = trainer.crowds["male"]
    crowd.markers[1] = torch.nan
    seen = trainer.update()
    assert seen["fallen"] >= 0.25
    assert all(p.isfinite().all() for p in trainer.policy.parameters())
    assert trainer.crowds["male"].markers.isfinite().all()
