import numpy as np
import pytest

from wayfarer.runtime.slots import Gait, Goals, Mode
from wayfarer.runtime.steering import Steering, observe
from wayfarer.spec import NEW_FRAMES
from wayfarer.terms import STAND, TERMS, WALK, weights

STEERING = Steering()


def gait(mode, speed=0.0, **values):
    made = Gait.empty(1)
    made.mode[:], made.speed[:] = mode, speed
    for name, value in values.items():
        getattr(made, name)[:] = value
    return made


def goal(x=None, radius=0.3, speed=1.2):
    made = Goals.empty(1)
    if x is not None:
        made.given[:], made.position[:], made.radius[:], made.speed[:] = (
            True,
            (x, 0, 0),
            radius,
            speed,
        )
    return made


def at(x, before=None):
    path = np.zeros((1, 2, 3), np.float32)
    path[0, :, 0] = (x if before is None else before), x
    path[..., 2] = 0.9
    return path


def next_mode(*arguments):
    return Mode(STEERING.decide(*arguments).mode[0])


def test_stands_without_a_goal():
    assert next_mode(gait(Mode.STANDING), at(0), goal()) is Mode.STANDING


def test_walks_until_the_braking_distance_which_grows_with_speed():
    assert next_mode(gait(Mode.WALKING, 1.2), at(0), goal(5)) is Mode.WALKING
    assert next_mode(gait(Mode.WALKING, 1.2), at(0), goal(0.5)) is Mode.STOPPING
    assert next_mode(gait(Mode.WALKING, 0.5), at(0), goal(0.5)) is Mode.WALKING


def test_stops_at_the_goal_and_stands_after_being_slow_for_two_steps():
    now = STEERING.decide(gait(Mode.WALKING, 1.0), at(0), goal(0.3))
    assert now.mode[0] == Mode.STOPPING
    np.testing.assert_allclose(now.stop_place[0], [0.3, 0], atol=1e-6)
    now.speed[:], now.arrived[:] = 0.05, True
    now = STEERING.decide(now, at(0.28), goal(0.3))
    assert now.mode[0] == Mode.STOPPING
    now = STEERING.decide(now, at(0.29), goal(0.3))
    assert now.mode[0] == Mode.STANDING
    np.testing.assert_allclose(now.stop_place[0], [0.29, 0], atol=1e-6)


def test_a_fast_step_between_starts_the_count_again():
    now = gait(Mode.STOPPING, 0.05, slow_seconds=0.2, arrived=True)
    now.speed[:] = 0.5
    now = STEERING.decide(now, at(0), goal(0.1))
    assert now.mode[0] == Mode.STOPPING and now.slow_seconds[0] == 0


def test_stopped_short_of_the_goal_it_walks_on():
    now = gait(Mode.STOPPING, 0.0, slow_seconds=0.2)
    assert next_mode(now, at(0), goal(0.5)) is Mode.WALKING


def test_strayed_from_its_goal_it_walks_back():
    assert next_mode(gait(Mode.STANDING, arrived=True), at(0), goal(0.5)) is Mode.STANDING
    assert next_mode(gait(Mode.STANDING, arrived=True), at(0), goal(0.7)) is Mode.WALKING


def test_cleared_goal_stops_ahead_of_where_it_is():
    now = STEERING.decide(gait(Mode.WALKING, 1.0), at(2.0, before=1.975), goal())
    assert now.mode[0] == Mode.STOPPING
    np.testing.assert_allclose(now.stop_place[0], [2.35, 0], atol=1e-5)


@pytest.mark.parametrize("radius", [0.05, 0.3, 2.0])
def test_every_radius_can_be_reached(radius):
    """An agent that moves as it is told arrives and comes to a stand."""
    x, now = 0.0, gait(Mode.WALKING)
    for _ in range(60):
        now = STEERING.decide(now, at(x), goal(3.0, radius))
        target, speed = STEERING.targets(now, at(x), goal(3.0, radius))
        ahead = x + np.sign(target[0, 0] - x) * min(speed[0] * 0.2, abs(target[0, 0] - x))
        frames = np.linspace(x, ahead, NEW_FRAMES + 1)[None, 1:, None] * np.array([1, 0, 0])
        now = observe(now, at(x)[:, -1], frames.astype(np.float32), goal(3.0, radius))
        x = ahead
    assert now.mode[0] == Mode.STANDING and now.arrived[0]
    assert abs(x - 3.0) <= radius


def test_target_speed_falls_near_the_goal():
    def speed_at(distance):
        return STEERING.targets(gait(Mode.WALKING), at(0), goal(distance))[1][0]

    assert speed_at(5) == pytest.approx(1.2)
    assert speed_at(0.6) == pytest.approx(0.72)
    assert speed_at(0.1) == pytest.approx(STEERING.slowest)
    assert STEERING.targets(gait(Mode.STANDING), at(0), goal(5))[1][0] == 0


def test_standing_it_is_drawn_to_its_place_only_when_it_has_drifted():
    def target(x):
        return STEERING.targets(gait(Mode.STANDING, stop_place=(1.0, 0.0)), at(x), goal())[0][0, 0]

    assert target(1.2) == pytest.approx(1.2)
    assert target(1.4) == pytest.approx(1.0)


def test_arrival_counts_once_and_by_any_frame():
    frames = np.zeros((1, NEW_FRAMES, 3), np.float32)
    frames[0, :, 0] = np.linspace(0.1, 0.8, NEW_FRAMES)  # through the circle and out again
    seen = observe(gait(Mode.WALKING), at(0)[:, -1], frames, goal(0.4, radius=0.1))
    assert seen.arrived[0]
    assert seen.speed[0] == pytest.approx(4.0)
    assert not observe(gait(Mode.WALKING), at(0)[:, -1], frames, goal()).arrived[0]


def test_weights_and_noise_follow_the_mode():
    modes = np.array([Mode.STANDING, Mode.WALKING], np.int8)
    table = STEERING.term_weights(modes)
    assert table.shape == (2, len(TERMS))
    np.testing.assert_allclose(table, [weights(STAND), weights(WALK)])
    noise = STEERING.scale_noise(modes, np.ones((2, 3, 128), np.float32))
    assert (noise[0, 0] == 0).all(), "the zero latent"
    walking = STEERING.searches[Mode.WALKING]
    assert noise[0, 1, 0] == pytest.approx(STEERING.searches[Mode.STANDING].temperature)
    assert noise[1, 0, 0] == pytest.approx(walking.temperature), "no zero latent when walking"


def test_candidates_can_be_set():
    few = STEERING.with_candidates(4)
    assert few.candidates(np.array([0, 1, 2])).tolist() == [4, 4, 4]
