from dataclasses import replace
from math import radians

import numpy as np
import pytest

from wayfarer.spec import NEW_FRAMES, STEP_SECONDS
from wayfarer.terms import STAND, STRAFE, TERMS, TURN, WALK, weights
from wayfarer.world.agents.goal import GoalColumns
from wayfarer.world.agents.heading import facing_at
from wayfarer.world.agents.slots import Gait, Mode, Seeds
from wayfarer.world.goals.gait_rules import FARTHER
from wayfarer.world.goals.steering import Steering, observe

# These numbers differ from the defaults, so that tuning breaks no test.
STEERING = Steering(
    braking_seconds=0.35,
    braking_margin=0.15,
    lookahead=1.0,
)


def gait(mode, speed=0.0, **values):
    made = Gait.empty(1)
    made.mode[:], made.speed[:] = mode, speed
    for name, value in values.items():
        getattr(made, name)[:] = value
    return made


def goal(x=None, radius=0.3, speed=1.2, **values):
    made = GoalColumns.empty(1)
    if x is None:
        return made
    made.given[:], made.position[:], made.radius[:], made.speed[:] = True, (x, 0, 0), radius, speed
    for name, value in values.items():
        getattr(made, name)[:] = value
    return made


def facing(degrees):
    """A heading as a column."""
    return facing_at(radians(degrees))


def at(x, before=None, heading=0.0):
    """A seed whose hips came from `before` to x along X, facing `heading` degrees."""
    seed = Seeds.empty(1)
    seed.translation[0, :, 0] = (x if before is None else before), x
    seed.translation[..., 2] = 0.9
    half = radians(heading) / 2
    seed.rotations[..., :] = [0, 0, 0, 1]
    seed.rotations[:, :, 0] = [0, 0, np.sin(half), np.cos(half)]
    return seed


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


def test_come_to_rest_at_the_edge_of_a_goal_it_goes_on_to_it():
    for x, place in ((0.29, 0.5), (0.4, 0.4)):
        now = gait(Mode.STOPPING, 0.0, slow_seconds=0.2, arrived=True)
        now = STEERING.decide(now, at(x), goal(0.5))
        assert now.mode[0] == Mode.STANDING
        np.testing.assert_allclose(now.stop_place[0], [place, 0], atol=1e-6)


def test_strayed_from_its_goal_it_walks_back():
    assert next_mode(gait(Mode.STANDING, arrived=True), at(0), goal(0.5)) is Mode.STANDING
    assert next_mode(gait(Mode.STANDING, arrived=True), at(0), goal(0.7)) is Mode.WALKING
    assert next_mode(gait(Mode.TURNING, arrived=True), at(0), goal(0.7)) is Mode.WALKING


def test_strayed_from_its_goal_it_walks_on_although_it_is_slow_at_first():
    setting_off = gait(Mode.WALKING, 0.05, arrived=True)
    assert next_mode(setting_off, at(0), goal(0.8)) is Mode.WALKING
    assert next_mode(setting_off, at(0), goal(0.5)) is Mode.STOPPING


def test_cleared_goal_stops_ahead_of_where_it_is():
    now = STEERING.decide(gait(Mode.WALKING, 1.0), at(2.0, before=1.975), goal())
    assert now.mode[0] == Mode.STOPPING
    expected = 2.0 + STEERING.coasting_seconds
    np.testing.assert_allclose(now.stop_place[0], [expected, 0], atol=1e-5)


def test_who_comes_to_rest_within_reach_is_there():
    """It need not creep to the exact centre."""
    assert next_mode(gait(Mode.WALKING, 0.05), at(0), goal(0.29)) is Mode.WALKING
    assert next_mode(gait(Mode.WALKING, 0.05, arrived=True), at(0), goal(0.29)) is Mode.STOPPING
    assert next_mode(gait(Mode.WALKING, 0.36, arrived=True), at(0), goal(0.29)) is Mode.WALKING


def test_who_slows_by_himself_at_his_goal_stops_there():
    """The model brakes, and then walks on at a pace at which it can only sway."""
    assert next_mode(gait(Mode.WALKING, 0.2, arrived=True), at(0), goal(0.29)) is Mode.STOPPING
    assert next_mode(gait(Mode.WALKING, 0.2), at(0), goal(0.31)) is Mode.WALKING
    slow = goal(0.29, speed=0.3)
    assert next_mode(gait(Mode.WALKING, 0.2, arrived=True), at(0), slow) is Mode.WALKING


def test_to_a_goal_behind_it_walks_at_once_as_people_do():
    for mode, speed in ((Mode.WALKING, 1.2), (Mode.STANDING, 0.0)):
        now = STEERING.decide(gait(mode, speed), at(0, heading=90), goal(3.0))
        assert now.mode[0] == Mode.WALKING
        target = STEERING.targets(now, at(0, heading=90), goal(3.0))
        np.testing.assert_allclose(target.place[0, :2], [3, 0], atol=1e-6)
        assert target.facing[0].tolist() == [0, 0], "the way"


def test_on_the_way_it_walks_a_curve_to_a_goal_beside():
    assert next_mode(gait(Mode.WALKING, 0.8), at(0, heading=10), goal(3.0)) is Mode.WALKING


def test_a_turn_on_the_spot_is_asked_for_whole_with_a_small_way_ahead():
    """Without a way the model turns like a turntable."""
    now = gait(Mode.TURNING, stop_facing=facing(120), stop_place=(1.0, 0.0))
    target = STEERING.targets(now, at(1.2, heading=0), goal())
    np.testing.assert_allclose(target.facing[0], facing(120), atol=1e-6)
    assert target.speed[0] == pytest.approx(STEERING.turn_speed)
    np.testing.assert_allclose(
        target.place[0], [1, 0] + STEERING.turn_radius * np.array(facing(60)), atol=1e-6
    )
    back = STEERING.targets(
        gait(Mode.TURNING, stop_facing=facing(180), stop_place=(1.0, 0.0)),
        at(1.0, heading=0),
        goal(),
    )
    assert np.isfinite(back.place).all() and np.abs(back.place - [1, 0]).max() < 0.5


def test_a_turn_ends_where_it_has_come_to():
    now = gait(Mode.TURNING, stop_facing=facing(90), stop_place=(9.0, 9.0))
    now = STEERING.decide(now, at(0.4, heading=90), goal(0.2, heading=facing(90), radius=0.5))
    assert now.mode[0] != Mode.TURNING
    np.testing.assert_allclose(now.stop_place[0], [0.4, 0], atol=1e-6)


def test_to_a_goal_behind_it_strafes_backwards():
    back = goal(3.0, heading=facing(90), strafe=True)
    now = STEERING.decide(gait(Mode.WALKING), at(0, heading=90), back)
    assert now.mode[0] == Mode.STRAFING and Mode.STRAFING.state == "walking"
    assert next_mode(gait(Mode.STRAFING, 0.5), at(2.95, heading=90), back) is Mode.STOPPING


def test_come_to_rest_it_turns_to_its_heading_nearer_to_its_goal_and_then_stands():
    asked = goal(0.1, heading=facing(90))
    now = gait(Mode.STOPPING, 0.05, slow_seconds=0.2, arrived=True)
    now = STEERING.decide(now, at(0.05), asked)
    assert now.mode[0] == Mode.TURNING
    np.testing.assert_allclose(now.stop_place[0], [0.1, 0], atol=1e-6)
    assert next_mode(now, at(0.05, heading=80), asked) is Mode.TURNING
    now = STEERING.decide(now, at(0.05, heading=84), asked)
    assert now.mode[0] == Mode.STOPPING
    for _ in range(2):
        now = STEERING.decide(now, at(0.05, heading=84), asked)
    assert now.mode[0] == Mode.STANDING
    np.testing.assert_allclose(now.stop_place[0], [0.05, 0], atol=1e-6)  # it stands where it is


def test_facing_nearly_as_asked_it_does_not_fidget():
    asked = goal(0.0, heading=facing(0))
    standing = gait(Mode.STANDING, arrived=True)
    assert next_mode(standing, at(0, heading=12), asked) is Mode.STANDING
    assert next_mode(standing, at(0, heading=-20), asked) is Mode.TURNING
    assert next_mode(standing, at(0, heading=170), goal(0.0)) is Mode.STANDING, "none is asked for"


def test_a_heading_is_no_reason_to_turn_before_it_is_there():
    asked = goal(3.0, heading=facing(180))
    assert next_mode(gait(Mode.WALKING), at(0), asked) is Mode.WALKING
    assert next_mode(gait(Mode.STOPPING, 1.0), at(2.8), asked) is Mode.STOPPING


def test_sent_where_it_is_it_turns_at_once():
    asked = goal(0.0, heading=facing(-90))
    assert next_mode(gait(Mode.WALKING, 0.0), at(0), asked) is Mode.TURNING


def test_headings_go_the_short_way_round_north():
    asked = goal(0.0, heading=facing(179))
    assert next_mode(gait(Mode.STANDING, arrived=True), at(0, heading=-178), asked) is Mode.STANDING


def test_passes_through_without_braking_and_stops_after_the_last():
    asked = goal(0.4, through=True)
    walking = gait(Mode.WALKING, 1.2)
    assert next_mode(walking, at(0.0), asked) is Mode.WALKING
    assert STEERING.targets(walking, at(0.0), asked).speed[0] == pytest.approx(1.2)
    walking.arrived[:] = True
    now = STEERING.decide(walking, at(0.6, before=0.57), asked)
    assert now.mode[0] == Mode.STOPPING
    expected = 0.6 + STEERING.coasting_seconds * 1.2
    np.testing.assert_allclose(now.stop_place[0], [expected, 0], atol=1e-5)
    # Beyond the goal it does not turn back, however far it went.
    still = gait(Mode.STOPPING, 0.0, slow_seconds=0.2, arrived=True)
    assert next_mode(still, at(2.0), asked) is Mode.STANDING


def test_near_a_goal_to_pass_it_looks_ahead_along_the_path():
    def target(x, bend=0.0, **values):
        onward = (np.cos(bend), np.sin(bend))
        asked = goal(4.0, **{"through": True, "bend": bend, "onward": onward, **values})
        place = STEERING.targets(gait(Mode.WALKING), at(x), asked).place[0, :2]
        stops = not asked.through[0] or (asked.onward[0] @ (4 - x, 0) <= 0)
        return place if stops else (x, 0) + (place - (x, 0)) / FARTHER

    reach = STEERING.lookahead
    np.testing.assert_allclose(target(4.0 - reach - 0.1), [4, 0], atol=1e-6)
    np.testing.assert_allclose(target(4.0 - reach / 2), [4 + reach / 2, 0], atol=1e-6)
    np.testing.assert_allclose(target(3.5, through=False), [4, 0], atol=1e-6)
    np.testing.assert_allclose(target(3.5, bend=radians(90)), [4, 0], atol=1e-6)
    x, y = target(3.9, bend=radians(45))
    assert x - 4 == pytest.approx(y) and 0 < y < reach


@pytest.mark.parametrize(
    ("mode", "seconds", "values", "goes_on"),
    [
        (Mode.WALKING, 0, {"through": True}, True),
        (Mode.WALKING, 0, {}, False),
        (Mode.STOPPING, 0.2, {}, False),
        (Mode.TURNING, 0, {}, False),
        (Mode.STANDING, 0.4, {}, True),
        (Mode.STANDING, 1.2, {"dwell": 1.0}, False),
        (Mode.STANDING, 1.4, {"dwell": 1.0}, True),
        (Mode.STANDING, 9.0, {"more": False}, False),
        (Mode.WALKING, 0, {"through": True, "more": False}, False),
    ],
)
def test_goes_on_to_the_next_goal(mode, seconds, values, goes_on):
    asked = goal(0.0, **{"more": True, **values})
    now = STEERING.advance(gait(mode, slow_seconds=seconds, arrived=True, waypoint=3), asked)
    assert now.waypoint[0] == 3 + goes_on
    assert now.arrived[0] != goes_on
    assert now.mode[0] == (Mode.WALKING if goes_on else mode)
    missed = STEERING.advance(gait(mode, slow_seconds=seconds, waypoint=3), asked)
    assert missed.waypoint[0] == 3, "not before it has reached this one"


def test_standing_time_counts_on_for_the_dwell():
    now = gait(Mode.STOPPING, 0.0, slow_seconds=0.2, arrived=True)
    for _ in range(4):
        now = STEERING.decide(now, at(0), goal(0.0))
    assert now.mode[0] == Mode.STANDING
    assert now.slow_seconds[0] == pytest.approx(1.0)


def test_facing_is_asked_for_at_rest_and_on_the_way_with_strafe():
    def faced(mode, x, **values):
        asked = goal(3.0, heading=facing(90), **values)
        now = STEERING.decide(gait(mode, arrived=x > 2.9), at(x), asked)
        return STEERING.targets(now, at(x), asked).facing[0].tolist()

    left = pytest.approx([-1, 0], abs=1e-6)
    assert faced(Mode.WALKING, 0) == [0, 0]
    assert faced(Mode.WALKING, 0, strafe=True) == left
    for mode in (Mode.STOPPING, Mode.TURNING, Mode.STANDING):
        assert faced(mode, 3.0) == left


def test_without_a_heading_it_goes_on_facing_as_it_did_when_it_stopped():
    now = STEERING.decide(gait(Mode.WALKING, 1.0), at(0, heading=90), goal(0.2))
    assert now.mode[0] == Mode.STOPPING
    faced = STEERING.targets(now, at(0.15, heading=50), goal(0.2)).facing[0]
    np.testing.assert_allclose(faced, facing(90), atol=1e-6)
    now.speed[:], now.slow_seconds[:], now.arrived[:] = 0.0, 0.2, True
    now = STEERING.decide(now, at(0.3, heading=60), goal(0.2))  # it comes to rest
    now = STEERING.decide(now, at(0.3, heading=70), goal(0.2))
    faced = STEERING.targets(now, at(0.3, heading=70), goal(0.2)).facing[0]
    np.testing.assert_allclose(faced, facing(60), atol=1e-6)


@pytest.mark.parametrize("radius", [0.05, 0.3, 2.0])
def test_every_radius_can_be_reached(radius):
    """An agent that moves as requested arrives and comes to a stand."""
    x, now = 0.0, gait(Mode.WALKING)
    for _ in range(60):
        now = STEERING.decide(now, at(x), goal(3.0, radius))
        target, speed, _ = STEERING.targets(now, at(x), goal(3.0, radius))
        ahead = x + np.sign(target[0, 0] - x) * min(speed[0] * 0.2, abs(target[0, 0] - x))
        frames = np.linspace(x, ahead, NEW_FRAMES + 1)[None, 1:, None] * np.array([1, 0, 0])
        start = at(x).translation[:, -1]
        now = observe(now, start, frames.astype(np.float32), goal(3.0, radius))
        x = ahead
    assert now.mode[0] == Mode.STANDING and now.arrived[0]
    assert abs(x - 3.0) <= radius


def test_walkers_alone_are_asked_for_a_speed_and_turners_for_their_own():
    """Near a goal the trajectory, which the graph computes, slows down."""
    assert STEERING.targets(gait(Mode.WALKING, 1.2), at(0), goal(0.5)).speed[0] == pytest.approx(
        1.2
    )
    for mode in (Mode.STANDING, Mode.STOPPING):
        assert STEERING.targets(gait(mode), at(0), goal(5)).speed[0] == 0


def test_on_stairs_a_step_is_as_long_as_a_tread():
    climbs = goal(5, tread=0.3)
    speed = STEERING.targets(gait(Mode.WALKING, 1.2), at(0), climbs).speed[0]
    assert speed == pytest.approx(STEERING.climbing * 0.3)


def test_standing_it_is_drawn_to_the_place_where_it_stopped():
    standing = gait(Mode.STANDING, stop_place=(1.0, 0.0))
    assert STEERING.targets(standing, at(1.2), goal()).place[0, :2].tolist() == [1.0, 0.0]


def test_standing_it_shifts_its_weight_aside_and_neighbours_not_together():
    def asked(place, seconds):
        standing = gait(
            Mode.STANDING, slow_seconds=seconds, stop_place=place, stop_facing=facing(0)
        )
        return STEERING.targets(standing, at(0), goal()).place[0] - place

    ways = np.array([asked((3.0, 1.0), t) for t in np.arange(0, 120, 0.2)])
    others = np.array([asked((3.0, 1.6), t) for t in np.arange(0, 120, 0.2)])
    assert np.abs(ways[0]).max() < 1e-6 and np.abs(ways[:, 1]).max() < 1e-6
    assert ways[:, 0].min() < -0.08 and ways[:, 0].max() > 0.08
    assert np.abs(ways).max() <= STEERING.weight_shift + 1e-6
    shifts = int((np.diff(ways[20:, 0] > 0)).sum())
    assert 8 <= shifts <= 24
    assert np.corrcoef(ways[:, 0], others[:, 0])[0, 1] < 0.8


def test_standing_close_to_others_it_does_not_shift_its_weight():
    standing = gait(Mode.STANDING, slow_seconds=9, stop_place=(3, 1), stop_facing=facing(0))
    assert STEERING.targets(standing, at(0), goal(3)).place[0].tolist() != [3, 1]
    assert STEERING.targets(standing, at(0), goal(3, close=True)).place[0].tolist() == [3, 1]


@pytest.mark.parametrize(("aside", "passed"), [(0.45, True), (0.55, False)])
def test_a_point_that_is_left_behind_is_passed_a_little_beyond_its_radius(aside, passed):
    """An agent neither turns back for a few centimetres nor gets stuck there."""
    frames = np.zeros((1, NEW_FRAMES, 3), np.float32)
    frames[0, :, 0], frames[0, :, 1] = np.linspace(0.32, 0.5, NEW_FRAMES), aside
    start = np.array([[0.3, aside, 0.0]], np.float32)
    beside, walks = goal(0.4, onward=(1, 0)), gait(Mode.WALKING, 0.9)
    assert not observe(walks, start, frames, beside).arrived[0], "it is no place to stop"
    beside.through[:] = True
    assert observe(walks, start, frames, beside).arrived[0] == passed
    assert not observe(walks, start, frames[:, :1], beside).arrived[0], "it still comes nearer"
    assert not observe(gait(Mode.STANDING), start, frames, beside).arrived[0]


@pytest.mark.parametrize("missed", [0.4, 0.6, 0.9])
def test_who_has_missed_a_point_to_pass_through_turns_back_to_it(missed):
    """A place beyond it would be at the agent's own feet, and there it would stand."""
    point = goal(0.0, radius=0.1, through=True, onward=(1, 0))
    place, speed, _ = STEERING.targets(gait(Mode.WALKING, 1.2), at(missed), point)
    assert place[0].tolist() == [0.0, 0.0] and speed[0] == pytest.approx(1.2)


def test_arrival_counts_once_and_by_any_frame():
    frames = np.zeros((1, NEW_FRAMES, 3), np.float32)
    frames[0, :, 0] = np.linspace(0.1, 0.8, NEW_FRAMES)  # through the circle and out again
    start = at(0).translation[:, -1]
    seen = observe(gait(Mode.WALKING), start, frames, goal(0.4, radius=0.1))
    assert seen.arrived[0]
    assert seen.speed[0] == pytest.approx(0.8 / STEP_SECONDS)
    assert not observe(gait(Mode.WALKING), start, frames, goal()).arrived[0]


def side_steps(**values):
    return goal(3.0, heading=facing(0), strafe=True, **values)


def test_side_steps_begin_at_once():
    for mode, speed, heading in ((Mode.WALKING, 1.0, 0), (Mode.STANDING, 0.0, 60)):
        assert next_mode(gait(mode, speed), at(0, heading=heading), side_steps()) is Mode.STRAFING


def test_side_steps_are_asked_for_with_their_speed_up_to_a_limit():
    target = STEERING.targets(gait(Mode.STRAFING), at(0), side_steps(speed=1.0))
    np.testing.assert_allclose(target.place[0, :2], [3, 0], atol=1e-6)
    np.testing.assert_allclose(target.facing[0], facing(0), atol=1e-6)
    assert target.speed[0] == pytest.approx(1.0)
    fast = STEERING.targets(gait(Mode.STRAFING), at(0), side_steps(speed=2.0))
    assert fast.speed[0] == pytest.approx(STEERING.strafe_speed)
    slow = STEERING.targets(gait(Mode.STRAFING), at(0), side_steps(speed=0.2))
    assert slow.speed[0] == pytest.approx(STEERING.strafe_slowest), "who goes slower glides"


def test_weights_and_noise_follow_the_mode():
    modes = np.array([Mode.STANDING, Mode.WALKING, Mode.STOPPING, Mode.TURNING, Mode.STRAFING])
    table = STEERING.term_weights(modes)
    assert table.shape == (5, len(TERMS))
    expected = [weights(t) for t in (STAND, WALK, STAND, TURN, STRAFE)]
    np.testing.assert_allclose(table, expected, rtol=1e-6)
    own = np.full((5, 128), 2.0, np.float32)
    noise = STEERING.noise(modes, np.ones((5, 3, 128), np.float32), own)
    for row, mode in zip(noise, modes, strict=True):
        search = STEERING.searches[Mode(mode)]
        mixed = (1 - search.own) ** 0.5 + 2 * search.own**0.5
        np.testing.assert_allclose(row, search.temperature * mixed, rtol=1e-6)


def test_the_search_can_be_set_in_all_modes():
    modes = np.arange(len(Mode))
    other = STEERING.with_search(candidates=4, policy=0.25)
    assert other.candidates(modes).tolist() == [4] * len(Mode)
    assert other.policy(modes).tolist() == [0.25] * len(Mode)
    for mode, search in other.searches.items():
        kept = STEERING.searches[mode]
        assert search == replace(kept, candidates=4, policy=0.25)
    hot = STEERING.with_search(temperature=2.0)
    assert {s.temperature for s in hot.searches.values()} == {2.0}
    assert STEERING.with_search() == STEERING


@pytest.mark.parametrize("mode", [Mode.STANDING, Mode.WALKING])
def test_who_stands_and_is_not_ready_stands_on_and_keeps_his_place(mode):
    """A goal that is given turns the mode into WALKING before anybody has moved."""
    now = gait(mode, 0.0)
    now.rested[:] = True
    now.stop_place[:] = [0.1, 0.2]
    for asked in (goal(3.0), goal(-3.0)):
        waits = STEERING.decide(now, at(0), asked, np.array([False]))
        assert waits.mode[0] == Mode.STANDING
        np.testing.assert_allclose(waits.stop_place[0], [0.1, 0.2])
        np.testing.assert_allclose(waits.stop_facing, now.stop_facing)
        sets_off = STEERING.decide(waits, at(0), asked, np.array([True]))
        assert sets_off.mode[0] in (Mode.WALKING, Mode.TURNING)


def test_who_is_under_way_need_not_be_ready():
    for mode, speed in ((Mode.WALKING, 1.0), (Mode.WALKING, 0.1), (Mode.STRAFING, 0.1)):
        now = gait(mode, speed)
        asked = goal(3.0)
        if mode == Mode.STRAFING:
            asked.strafe[:], asked.heading[:] = True, [1.0, 0.0]
        after = STEERING.decide(now, at(0), asked, np.array([False]))
        assert after.mode[0] == mode


@pytest.mark.parametrize("error", [0.9, 1.12])
def test_who_walks_too_fast_or_too_slowly_is_asked_for_less_or_more(error):
    """A walker that goes at `error` times the speed it is asked for comes to that speed."""
    now, place = gait(Mode.WALKING, 1.0), 0.0
    ahead = goal(100.0, speed=1.0)
    for _ in range(60):
        asked = STEERING.targets(now, at(place), ahead).speed[0]
        start, place = place, place + error * float(asked) * STEP_SECONDS
        frames = np.linspace([start, 0, 0.9], [place, 0, 0.9], 9, dtype=np.float32)
        now = observe(now, frames[:1], frames[None, 1:], ahead)
    assert now.speed[0] == pytest.approx(1.0, abs=0.01)
    kept = now.trim[0]
    for mode, speed in ((Mode.STANDING, 0.0), (Mode.WALKING, 0.5), (Mode.WALKING, 2.0)):
        still = gait(mode, speed)
        still.trim[:] = kept
        frames = np.linspace([0, 0, 0.9], [speed * STEP_SECONDS, 0, 0.9], 9, dtype=np.float32)
        assert observe(still, frames[:1], frames[None, 1:], ahead).trim[0] == kept
