import torch

from wayfarer.terms import STRAFE, weights
from wayfarer_lab.training.tasks import STANDING, STRAFING, TURNING, WALKING, Tasks, draw_tasks

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
    drawn = draw_tasks(torch.zeros(512, 2), EAST.expand(512, 2))
    assert (drawn.facing[drawn.kind == STANDING] == EAST).all()
    assert not drawn.facing[drawn.kind == WALKING].any()
    for kind in (TURNING, STRAFING):
        wished = drawn.facing[drawn.kind == kind]
        assert torch.allclose(wished.norm(dim=-1), torch.ones(len(wished)))
        assert wished.std() > 0.5


def test_the_speed_wished_for_grows_from_the_present_one_and_falls_near_the_goal():
    place = torch.zeros(1, 2)
    assert torch.isclose(tasks(WALKING).target_speed(place, torch.zeros(1)), torch.tensor(0.4))
    assert torch.isclose(tasks(WALKING).target_speed(place, torch.ones(1)), torch.tensor(1.4))
    near = tasks(WALKING, goal=(0.4, 0.0)).target_speed(place, torch.ones(1))
    assert torch.isclose(near, torch.tensor(0.8))
    assert tasks(TURNING).target_speed(place, torch.ones(1)) == 0


def test_who_has_arrived_stands_there_facing_as_he_does():
    torch.manual_seed(3)  # nobody is asked for something else
    for kind in (WALKING, STRAFING):
        arrived = tasks(kind, goal=(0.1, 0.0))
        arrived.renew(torch.zeros(1, 2), EAST[None])
        assert arrived.kind == STANDING
        assert (arrived.facing == EAST).all()


def test_strafing_is_judged_by_its_own_table():
    assert tasks(STRAFING).term_weights()[0].tolist() == torch.tensor(weights(STRAFE)).tolist()
