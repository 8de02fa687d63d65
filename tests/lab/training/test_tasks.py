import pytest
import torch
from pydantic import ValidationError
from torch import Tensor

from wayfarer.terms import STRAFE, weights
from wayfarer_lab.training.tasks import (
    STANDING,
    STRAFING,
    TURNING,
    WALKING,
    TaskMix,
    Tasks,
    draw_tasks,
)

EAST = torch.tensor([1.0, 0.0])


def tasks(kind: int, goal: tuple[float, float] = (5.0, 0.0)) -> Tasks:
    return Tasks(
        kind=torch.tensor([kind]),
        goal=torch.tensor([[*goal, 0.0]]),
        speed=torch.tensor([1.4]),
        facing=torch.zeros(1, 2),
    )


def test_who_stands_is_asked_to_face_as_now_and_walkers_face_their_way():
    torch.manual_seed(0)
    drawn = draw_tasks(torch.zeros(512, 2), EAST.expand(512, 2), TaskMix())
    assert (drawn.facing[drawn.kind == STANDING] == EAST).all()
    assert not drawn.facing[drawn.kind == WALKING].any()
    for kind in (TURNING, STRAFING):
        asked = drawn.facing[drawn.kind == kind]
        assert torch.allclose(asked.norm(dim=-1), torch.ones(len(asked)))
        assert asked.std() > 0.5


def test_the_speed_wished_for_grows_from_the_present_one_and_falls_near_the_goal():
    place = torch.zeros(1, 2)
    assert torch.isclose(tasks(WALKING).target_speed(place, torch.zeros(1)), torch.tensor(0.4))
    assert torch.isclose(tasks(WALKING).target_speed(place, torch.ones(1)), torch.tensor(1.4))
    near = tasks(WALKING, goal=(0.4, 0.0)).target_speed(place, torch.ones(1))
    assert torch.isclose(near, torch.tensor(0.8))
    assert tasks(TURNING).target_speed(place, torch.ones(1)) == 0


def test_who_has_arrived_stands_there_facing_as_he_does():
    mix = TaskMix(change=0, change_moving=0)
    for kind in (WALKING, STRAFING):
        arrived = tasks(kind, goal=(0.1, 0.0))
        arrived.renew(torch.zeros(1, 2), EAST[None], mix)
        assert arrived.kind == STANDING
        assert (arrived.facing == EAST).all()


def test_strafing_is_judged_by_its_own_table():
    assert tasks(STRAFING).term_weights()[0].tolist() == torch.tensor(weights(STRAFE)).tolist()


def test_nobody_is_asked_to_turn_by_more_than_a_step_of_it():
    asked = tasks(TURNING)
    for degrees, told in ((10, 10), (90, 40), (-170, -40), (179, 40)):
        angle = torch.deg2rad(torch.tensor(float(degrees)))
        asked.facing = torch.stack([torch.cos(angle), torch.sin(angle)])[None]
        found = asked.wished_facing(EAST[None])[0]
        assert torch.isclose(
            torch.rad2deg(torch.atan2(found[1], found[0])), torch.tensor(float(told)), atol=0.1
        )
    assert not tasks(WALKING).wished_facing(EAST[None]).any()


def test_strafers_go_to_both_sides_and_back_and_some_goals_lie_behind():
    torch.manual_seed(0)
    drawn = draw_tasks(torch.zeros(4096, 2), EAST.expand(4096, 2), TaskMix())
    strafing = drawn.kind == STRAFING
    way = drawn.goal[strafing, :2]
    aside = relative(way, drawn.facing[strafing])
    for low, high in ((45, 135), (-135, -45)):
        assert 0.2 < ((aside > low) & (aside < high)).float().mean() < 0.45
    assert 0.2 < (aside.abs() > 135).float().mean() < 0.45
    ahead = relative(drawn.goal[drawn.kind == WALKING, :2], EAST)
    assert (ahead.abs() > 135).float().mean() > 0.35  # a quarter, and what chance adds


def test_a_mix_of_straight_walks_asks_for_little_else():
    torch.manual_seed(0)
    mix = TaskMix(walk=1, stand=0, turn=0, strafe=0, behind=0, ahead=0.8, aside=90)
    drawn = draw_tasks(torch.zeros(4096, 2), EAST.expand(4096, 2), mix)
    assert (drawn.kind == WALKING).all()
    angle = relative(drawn.goal[:, :2], EAST).abs()
    assert (angle < 40).float().mean() > 0.75
    assert (angle > 110).float().mean() < 0.01
    assert drawn.goal[:, :2].norm(dim=-1).max() > 12  # twice as far


def test_who_walks_may_be_left_alone_longer_than_who_stands():
    mix = TaskMix(change=1, change_moving=0)
    walking, standing = tasks(WALKING), tasks(STANDING)
    for asked in (walking, standing):
        asked.renew(torch.zeros(1, 2), EAST[None], mix)
    assert walking.goal.tolist() == [[5.0, 0.0, 0.0]]
    assert standing.goal.tolist() != [[5.0, 0.0, 0.0]]


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        ({"walk": 0, "stand": 0, "turn": 0, "strafe": 0}, "nothing is asked"),
        ({"behind": 0.6, "ahead": 0.6}, "at most 1 together"),
        ({"change": 1.5}, "less than or equal to 1"),
        ({"amble": 1}, "amble"),
    ],
)
def test_an_impossible_mix_is_refused(wrong, told):
    with pytest.raises(ValidationError, match=told):
        TaskMix(**wrong)


def relative(way: Tensor, facing: Tensor) -> Tensor:
    """Degrees from `facing` to `way`, left positive."""
    angle = torch.atan2(way[:, 1], way[:, 0]) - torch.atan2(facing[..., 1], facing[..., 0])
    return torch.rad2deg(torch.atan2(torch.sin(angle), torch.cos(angle)))
