import pytest
import torch
from torch import Tensor

from tests.lab.training.fakes import straight_walks
from wayfarer.body.library import load_body
from wayfarer.body.skeleton import joint_names
from wayfarer.marker_bodies import load_marker_bodies
from wayfarer.spec import FPS
from wayfarer_lab.training.crowd import TrainingCrowd
from wayfarer_lab.training.likeness import FRAMES, GaitFeatures
from wayfarer_lab.training.rotation import matrix_from_rotvec
from wayfarer_lab.training.steady import SETTLED, LikenessConfig, SteadyGait, SteadyWalks
from wayfarer_lab.training.tasks import WALKING, Tasks
from wayfarer_lab.training.walks import Walks

AGENTS, HORIZON = 6, 4
BODIES = load_marker_bodies("anny52")
NAMES = load_body("anny52", "male").marker_names
TIME = torch.arange(FRAMES) / FPS


def poses(knee_deg: float = 0.0, lean_deg: float = 0.0, nod_deg: float = 0.0) -> Tensor:
    """Markers [FRAMES, 67, 3] of a body that glides along +Y at 1.2 m/s."""
    turns = torch.zeros(1, 22, 3)
    for joint, degrees in (
        ("left_knee", -knee_deg), ("right_knee", -knee_deg),
        ("spine1", -lean_deg), ("neck", -nod_deg),
    ):  # fmt: skip
        turns[0, joint_names().index(joint), 0] = torch.deg2rad(torch.tensor(degrees))
    pose, _ = BODIES["male"](torch.zeros(1, 3), matrix_from_rotvec(turns), torch.zeros(1, 10))
    return pose + torch.stack([0 * TIME, 1.2 * TIME, 0 * TIME], -1)[:, None]


@pytest.fixture(scope="module")
def walks():
    torch.manual_seed(0)
    return Walks(straight_walks(), "train", BODIES, windows=40)


def steady(walks: Walks, **weights: float) -> SteadyWalks:
    torch.manual_seed(0)
    return SteadyWalks(LikenessConfig(**weights), walks, NAMES, AGENTS, HORIZON)


def crowd(y: float = 0.0) -> TrainingCrowd:
    place = torch.tensor([0.0, y, 1.0]).expand(AGENTS, 2, 3)
    upright = torch.tensor([0.0, 0, 0, 1]).expand(AGENTS, 2, 22, 4)
    markers = place[:, :, None].expand(-1, -1, 67, -1)
    return TrainingCrowd(markers, place, upright, torch.zeros(AGENTS, 10))


def asked(goal: tuple[float, float] = (0.0, 50.0), speed: float = 1.2) -> Tasks:
    return Tasks(
        kind=torch.full((AGENTS,), WALKING),
        goal=torch.tensor([[*goal, 0.0]]).repeat(AGENTS, 1),
        speed=torch.full((AGENTS,), speed),
        facing=torch.zeros(AGENTS, 2),
    )


def test_agents_count_as_steady_by_what_they_are_asked_not_by_what_they_do(walks):
    watch, tasks = steady(walks), asked()
    tasks.speed[1] = 2.5  # runs
    for step in range(SETTLED + 1):
        tasks.goal[0, 0] = float(step)  # asked for something else each time
        watch.count("male", crowd(), tasks)  # nobody moves at all
    assert watch.steps["male"].tolist() == [0, 0, *[SETTLED] * (AGENTS - 2)]
    assert not watch.steps["female"].any()
    watch.count("male", crowd(y=49.5), tasks)  # near the goal
    assert not watch.steps["male"][2:].any()


def test_too_few_steady_walkers_are_not_judged_and_their_frames_are_kept(walks):
    watch = steady(walks)
    first, second = (torch.randn(AGENTS, 8 * HORIZON, 67, 3) for _ in range(2))
    resting = BODIES["male"].resting(torch.zeros(AGENTS, 10))
    for frames in (first, second):
        cost, figures = watch.judge("male", frames, asked(), resting)
        assert cost == 0 and figures == {"steady": 0.0}
    assert torch.equal(watch.past["male"], second[:, -(FRAMES - 8 * HORIZON) :])


def test_a_verdict_teaches_the_critic_and_reaches_the_new_frames(walks):
    watch = steady(walks)
    watch.steps["male"][:] = SETTLED
    window = poses().expand(AGENTS, -1, -1, -1) + 0.01 * torch.randn(AGENTS, FRAMES, 1, 1)
    watch.past["male"] = window[:, : -8 * HORIZON].clone()
    new = window[:, -8 * HORIZON :].clone().requires_grad_(True)
    weight = watch.critic.moves[0].weight
    before = weight.clone()
    resting = BODIES["male"].resting(torch.zeros(AGENTS, 10))
    cost, figures = watch.judge("male", new, asked(), resting)
    assert cost > 0 and figures["steady"] == AGENTS
    assert figures["pace"] < 0.05
    assert any(
        not torch.equal(a, b) for a, b in zip(before, watch.critic.parameters(), strict=True)
    )
    cost.backward()
    assert new.grad is not None and new.grad.abs().sum() > 0


def test_the_waists_swings_knees_trunk_and_head_are_measured():
    gait = SteadyGait.from_names(NAMES, GaitFeatures.from_names(NAMES))
    rest = BODIES["male"].resting(torch.zeros(1, 10))
    swinging = poses()[None].clone()
    swinging[..., 2] += (0.015 * torch.sin(12 * TIME) + 0.1 * TIME)[:, None]  # and climbs
    swinging[..., 0] += (0.025 * torch.sin(6 * TIME))[:, None]
    for window, bob, sway in ((swinging, 3, 5), (poses()[None], 0, 0)):
        found = gait.swings(window)
        assert found[0].item() == pytest.approx(bob, abs=0.3)
        assert found[1].item() == pytest.approx(sway, abs=0.7)
    flat = gait.knee_peak(poses()[None])
    assert (gait.knee_peak(poses(knee_deg=60)[None]) - flat).item() == pytest.approx(60, abs=8)
    trunk = gait.tilt(poses(lean_deg=10)[None], rest, "waist", "chest", upright=True)
    assert trunk.item() == pytest.approx(10, abs=3)
    ends = ("back of head", "front of head")
    head = gait.tilt(poses(nod_deg=10)[None], rest, *ends, upright=False)
    assert head.item() == pytest.approx(-10, abs=1)
    assert gait.tilt(poses()[None], rest, *ends, upright=False).item() == pytest.approx(0, abs=1e-3)


def test_steps_are_measured_from_ankle_to_ankle_and_a_limp_is_told():
    gait, window = (
        SteadyGait.from_names(NAMES, GaitFeatures.from_names(NAMES)),
        poses()[None].clone(),
    )
    window[:, :, NAMES.index("LANK"), 1] += 0.6 * torch.sin(6 * TIME)
    step, limp = gait.steps(window)
    assert step.item() == pytest.approx(60, abs=1) and limp.item() < 2
    window[:, :, NAMES.index("RANK"), 1] -= 0.1  # left always farther ahead
    step, limp = gait.steps(window)
    assert step.item() == pytest.approx(60, abs=1)
    assert limp.item() == pytest.approx(20, abs=2)


def test_pace_is_progress_towards_the_goal(walks):
    watch, window = steady(walks), poses().expand(2, -1, -1, -1)  # at 1.2 m/s along +Y
    goals = torch.tensor([[0.0, 50.0, 0.0], [50.0, 0.0, 0.0]])
    ahead, aside = watch.progress(window, goals).tolist()
    assert ahead == pytest.approx(1.2, abs=0.01)
    assert aside < 0.05
