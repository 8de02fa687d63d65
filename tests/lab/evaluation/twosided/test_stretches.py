"""Activities are recognised by the body's motion."""

import numpy as np

from tests.lab.evaluation.maneuvers.bodies import take, time, walker
from wayfarer.spec import FPS
from wayfarer_lab.evaluation.takes import Take
from wayfarer_lab.evaluation.twosided import stretches
from wayfarer_lab.training.mocap.selection import Use

HANGING = {"left_shoulder": (0.0, -75.0, 0.0), "right_shoulder": (0.0, 75.0, 0.0)}


def used(made: Take, use: int = Use.LOCOMOTION) -> np.ndarray:
    return np.full(len(made), use, np.uint8)


def test_stands_are_cut_into_pieces_and_not_acted() -> None:
    made = take(30.0, **HANGING)
    found = list(stretches.stands(made, used(made, Use.STANDING)))
    assert [len(part) for part in found] == [20 * FPS, 10 * FPS]
    assert not list(stretches.stands(made, used(made, Use.OTHER)))
    raised = take(6.0, left_elbow=(0.0, 150.0, 0.0), **HANGING)
    assert not list(stretches.stands(raised, used(raised))), "a hand is up"
    glides = take(6.0, y=0.2 * time(6.0), **HANGING)
    assert not list(stretches.stands(glides, used(glides)))


def test_walks_belong_to_their_speed() -> None:
    made = walker()
    assert len(list(stretches.walks(1.05, 1.35)(made, used(made)))) == 1
    assert not list(stretches.walks(0.75, 1.05)(made, used(made)))


def test_curves_have_a_radius() -> None:
    t = time(6.0)
    for radius, there in ((2.0, True), (6.0, False), (0.5, False)):
        angle = 1.2 / radius * t
        made = take(
            6.0, x=radius * np.cos(angle), y=radius * np.sin(angle), heading=np.degrees(angle)
        )
        assert bool(list(stretches.curves(made, used(made)))) == there


def test_a_start_is_a_stand_and_a_walk() -> None:
    made = take(6.0, y=1.2 * np.clip(time(6.0) - 2, 0, None))
    [part] = stretches.starts(made, used(made))
    assert part.hips[0, 1] == 0 and part.hips[-1, 1] > 1.5
    back = take(6.0, y=-1.2 * np.clip(time(6.0) - 2, 0, None))
    assert not list(stretches.starts(back, used(back)))


def test_turning_back_is_a_turn_between_two_walks() -> None:
    t = time(8.0)
    turned = 180 * np.clip((t - 3.5) / 1.0, 0, 1)
    made = take(8.0, y=1.2 * np.where(t < 4, t, 8 - t), heading=turned)
    [part] = stretches.turns_back(made, used(made))
    assert abs(part.heading[-1] - part.heading[0]) > 170
    spot = take(8.0, heading=turned)
    assert not list(stretches.turns_back(spot, used(spot)))
