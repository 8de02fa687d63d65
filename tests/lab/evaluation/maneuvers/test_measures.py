"""Each measure finds the property that was put into a take, and no other one."""

from dataclasses import replace

import numpy as np
import pytest

from tests.lab.evaluation.maneuvers.bodies import HEIGHT, shot, take, time, walker
from wayfarer.world.agents.goal import Goal
from wayfarer_lab.evaluation.maneuvers import (
    crowd,
    path,
    robust,
    stairs,
    stand,
    stop,
    strafe,
    turn,
    walk,
)
from wayfarer_lab.evaluation.maneuvers.maneuver import MeasuredTake
from wayfarer_lab.evaluation.metrics import feet, stride

# Strafing


def test_a_squatting_strafer_has_the_hips_that_were_built() -> None:
    seconds = 3.0
    left = -0.5 * time(seconds)
    upright = strafe.measure_strafe(shot(take(seconds, x=left), (-1.5, 0.0), 0.0))
    squat = strafe.measure_strafe(shot(take(seconds, x=left, up=-0.3 * HEIGHT), (-1.5, 0.0), 0.0))
    assert upright["hips_p5"] == pytest.approx(1.0) and squat["hips_p5"] == pytest.approx(0.7)
    assert upright["arrive"] == 1 and upright["speed_mps"] == pytest.approx(0.5, abs=0.01)
    assert upright["lifts"] == 0 and upright["float_share"] == 0 and upright["contact_up"] == 0


def test_a_strafer_who_leans_floats_or_never_comes() -> None:
    plank = strafe.measure_strafe(shot(take(3.0, pelvis=(0.0, 25.0, 0.0)), (0.1, 0.0), 0.0))
    assert plank["lean_p95_deg"] == pytest.approx(25, abs=1.5)
    ghost = strafe.measure_strafe(shot(take(3.0, up=0.05), (9.0, 0.0), 0.0))
    assert ghost["float_share"] == 1 and ghost["contact_up"] == 1 and ghost["floats_seen"] == 1
    assert ghost["arrive"] == 0 and ghost["end_m"] == pytest.approx(9.0)
    assert strafe.measure_strafe(shot(take(3.0, up=0.05, told=False), (9.0, 0.0)))["arrive"] == 0
    turned = strafe.measure_strafe(shot(take(3.0, heading=40.0), (9.0, 0.0), 0.0))
    assert turned["off_heading_p95_deg"] == pytest.approx(40, abs=0.1)


def test_what_comes_after_the_arrival_is_not_strafing() -> None:
    there = np.minimum(time(6.0), 2.0)
    lying = np.where(time(6.0) > 3.5, -0.5, 0.0)
    row = strafe.measure_strafe(shot(take(6.0, x=there, up=lying), (2.0, 0.0), 0.0))
    assert row["hips_p5"] == pytest.approx(1.0)


def test_left_and_right_are_held_against_each_other() -> None:
    row = {"hips_p5": 0.9, "float_share": 0.0, "contact_up": 0.02, "arrive": 1.0}
    rows = {("left", "sent"): row, ("right", "sent"): {**row, "arrive": 0.9}}
    apart = strafe.across(rows, {})["left against right", "sent"]
    assert apart["left_right_points"] == pytest.approx(10)


# Standing


def test_a_stander_who_creeps_and_turns_without_a_step() -> None:
    still = stand.measure_stand(shot(take(20.0)))
    assert (still["slide_cm"], still["heading_range_deg"], still["lifts"]) == (0, 0, 0)
    creep = stand.measure_stand(shot(take(20.0, x=0.01 * time(20.0))))
    assert creep["slide_cm"] == pytest.approx(20, abs=0.1)
    assert creep["drift_cm"] == pytest.approx(20, abs=0.1)
    spin = stand.measure_stand(shot(take(20.0, heading=2.0 * time(20.0))))
    assert spin["heading_range_deg"] == pytest.approx(40, abs=0.2)
    assert spin["foot_turn_deg"] == pytest.approx(40, abs=0.2)
    ghost = stand.measure_stand(shot(take(20.0, x=0.01 * time(20.0), up=0.02)))
    assert ghost["slide_cm"] == pytest.approx(20, abs=0.1), "hovering is no step"


# Paths


def test_waypoints_are_passed_with_the_speed_of_the_way() -> None:
    """One leg of 4 m along +Y, then one to the right, with a stop of 1 s at the corner."""
    going = np.clip(1.2 * (time(10.0) - 1.0 * (time(10.0) > 4.0)), 0, None)
    still = (time(10.0) > 3.0) & (time(10.0) <= 4.0)
    way = np.where(still, 3.6, going)
    made = take(10.0, x=np.clip(way - 4.0, 0, 4), y=np.minimum(way, 4.0))
    goals = ((0.0, 4.0, 0.0), (4.0, 4.0, 0.0))
    walked = shot(replace(made, clip=replace(made.clip, goals=goals)), (4.0, 4.0))
    row = path.measure_path(walked)
    assert row["arrive"] == row["passed"] == 1
    assert row["missed_by_m"] == pytest.approx(0, abs=0.03)
    assert row["speed_kept"] == pytest.approx(0, abs=0.05), "it stood within 1 s of the corner"
    wide = path.measure_path(
        shot(replace(made, clip=replace(made.clip, goals=((2.0, 0.0, 0.0), goals[1]))), (4.0, 4.0))
    )
    assert wide["passed"] == 0 and wide["missed_by_m"] == pytest.approx(2.0, abs=0.02)


def test_a_near_goal_has_no_waypoints() -> None:
    made = take(3.0, y=np.minimum(time(3.0), 1.5))
    row = path.measure_path(
        shot(replace(made, clip=replace(made.clip, goals=((0.0, 1.5, 0.0),))), (0.0, 1.5))
    )
    assert row["arrive_s"] == pytest.approx(1.2, abs=0.05) and np.isnan(row["passed"])


# Turning


def test_a_turntable() -> None:
    turned = 90 * np.clip((time(6.0) - 1) / 0.5, 0, 1)
    row = turn.measure_turn(shot(take(6.0, heading=turned), (0.0, 0.0), 100.0))
    assert row["turned_deg"] == pytest.approx(90, abs=0.1)
    assert row["error_deg"] == pytest.approx(10, abs=0.1) and row["faces"] == 1
    short = turn.measure_turn(shot(take(6.0, heading=turned), (0.0, 0.0), 106.0))
    assert short["faces"] == 0
    assert row["lifts"] == 0 and row["no_lift"] == 1
    assert row["pivot_deg"] == pytest.approx(90, abs=1)
    assert row["peak_deg_s"] == pytest.approx(180, abs=2)
    assert row["turn_s"] == pytest.approx(0.4, abs=0.05)


def test_a_turn_to_the_right_beyond_the_half_circle() -> None:
    turned = -170 * np.clip(time(6.0) / 3, 0, 1)
    row = turn.measure_turn(shot(take(6.0, heading=turned), (0.0, 0.0), 180.0))
    assert row["error_deg"] == pytest.approx(10, abs=0.1), "180° is -180°"


def test_a_hop_is_no_step() -> None:
    hop = (
        0.06 * np.clip(np.sin(np.pi * (time(6.0) - 1) / 0.5), 0, 1) * (abs(time(6.0) - 1.25) < 0.25)
    )
    turned = 90 * np.clip((time(6.0) - 1.1) / 0.3, 0, 1)
    shots = [shot(take(6.0, heading=turned, up=hop), (0.0, 0.0), 90.0)]
    each = [turn.measure_turn(s) for s in shots]
    assert each[0]["lifts"] == 2 and each[0]["pivot_deg"] < 20
    assert turn.turn_row(shots, each)["airborne_share"] > 0.05, "but it is seen"


# Stopping


ARMS_DOWN = {"left_shoulder": (0.0, -75.0, 0.0), "right_shoulder": (0.0, 75.0, 0.0)}


def test_an_arm_that_is_held_ahead_while_somebody_stands_is_seen() -> None:
    still = stand.measure_stand(shot(take(4.0, **ARMS_DOWN)))
    assert still["hands_apart_cm"] == pytest.approx(0, abs=1) and abs(still["hand_ahead_cm"]) < 8
    assert still["hand_up_cm"] < 0.5
    held = stand.measure_stand(shot(take(4.0, **ARMS_DOWN, left_elbow=(0.0, 0.0, -60.0))))
    assert held["hands_apart_cm"] > 12 and held["hand_up_cm"] > 6
    assert held["hand_ahead_cm"] == pytest.approx(
        still["hand_ahead_cm"] + held["hands_apart_cm"], abs=2
    )
    after = stop.measure_stop(
        shot(take(6.0, **ARMS_DOWN, left_elbow=(0.0, 0.0, -60.0)), (0.0, 0.5))
    )
    assert after["hands_apart_cm"] == pytest.approx(held["hands_apart_cm"], abs=0.1)


def stopped(seconds: float = 6.0, stride_deg: float = 0.0, pitch: float = 0.0) -> dict[str, float]:
    """Two seconds at 1 m/s, then a stand with the legs `stride_deg` ahead and behind."""
    way = np.minimum(time(seconds), 2.0)
    legs = {"left_hip": (stride_deg, 0, 0), "right_hip": (-stride_deg, 0, 0)}
    made = take(seconds, y=way, right_ankle=(-pitch, 0, 0), **legs)
    return stop.measure_stop(shot(made, (0.0, 2.0)))


def test_rest_begins_when_hips_and_ankles_are_slow() -> None:
    row = stopped()
    assert row["rests"] == 1 and row["rest_s"] == pytest.approx(0.75, abs=0.1)
    restless = take(6.0, y=0.1 * time(6.0))
    assert stop.rest(restless) is None
    assert stop.measure_stop(shot(restless, (0.0, 0.5)))["rests"] == 0


def test_who_freezes_in_mid_stride_stands_with_feet_apart() -> None:
    assert stopped()["apart_cm"] == pytest.approx(0, abs=0.1)
    leg = HEIGHT - 0.08  # about
    wide = stopped(stride_deg=15.0)["apart_cm"]
    assert wide == pytest.approx(100 * 2 * leg * np.sin(np.radians(15)), rel=0.1)


def test_a_heel_in_the_air_is_seen() -> None:
    assert stopped()["heel_up"] == 0
    tiptoe = stopped(pitch=30.0)
    assert tiptoe["heel_up"] == 1 and tiptoe["heel_cm"] > 5


def test_who_sways_after_a_stop_is_seen() -> None:
    assert stopped()["sway_back_cm"] == 0 and stopped()["more_lifts"] == 0
    back = np.minimum(time(6.0), 2.0) - 0.2 * np.clip(time(6.0) - 2.5, 0, 1)
    assert stop.measure_stop(shot(take(6.0, y=back), (0.0, 2.0)))["sway_back_cm"] == pytest.approx(
        20
    )
    feet_ahead = {"left_hip": (15.0, 0, 0), "right_hip": (15.0, 0, 0)}
    leans = stop.measure_stop(
        shot(take(6.0, y=np.minimum(time(6.0), 2.0), **feet_ahead), (0.0, 2.0))
    )
    assert leans["behind_cm"] - stopped()["behind_cm"] == pytest.approx(22, abs=3)
    tipped = take(6.0, y=np.minimum(time(6.0), 2.0), pelvis=(10.0, 0.0, 0.0))
    assert stop.measure_stop(shot(tipped, (0.0, 2.0)))["lean_back_deg"] == pytest.approx(10, abs=1)


# Robustness


def test_worst_moments_are_kept() -> None:
    tilt = np.where(np.arange(400) < 40, 40.0, 5.0)
    row = robust.measure_robust(shot(take(10.0, pelvis=(-tilt, 0.0, 0.0))))
    assert row["over_30_deg"] == pytest.approx(0.1)
    assert row["tilt_max_deg"] == pytest.approx(40, abs=0.1)
    dip = np.where(np.arange(400) == 200, -0.4 * HEIGHT, 0.0)
    fell = robust.measure_robust(shot(take(10.0, up=dip)))
    assert fell["hips_least"] == pytest.approx(0.6) and fell["folded"] == 1
    assert fell["pop_cm"] == pytest.approx(2 * 40 * HEIGHT, rel=0.01)
    inside_out = robust.measure_robust(
        shot(take(10.0, left_knee=(-200.0, 0, 0), right_knee=(20.0, 0, 0)))
    )
    assert inside_out["knee_least_deg"] == pytest.approx(-160, abs=2)
    assert inside_out["knee_most_deg"] == pytest.approx(-20, abs=2)


# Stairs


def test_stairs_are_counted_by_where_feet_stand() -> None:
    """Each foot stands on every second stair, one stair per step."""

    def climb(risers: int) -> list[np.ndarray]:
        path = []
        for number in range(6):
            place = np.array([0.3 * risers * number, 0.0, 0.2 * risers * number])
            path += [np.repeat(place[None], 16, 0)]
            path += [place + np.linspace(0, 1, 12)[:, None] * [0.3 * risers, 0, 0.2 * risers]]
        return path

    found = stairs.placements(np.concatenate(climb(2)))
    heights = [place[2] for _, place in found]
    assert len(heights) == 6
    assert np.diff(heights) == pytest.approx(0.4, abs=0.03)
    assert len(stairs.placements(np.zeros((200, 3)))) == 1, "a standing person does not climb"
    dragged = np.linspace(0, 3, 200)[:, None] * [1.0, 0, 0]
    assert stairs.placements(dragged) == [], "0.6 m/s all the time"


# Walking


def test_a_walk_has_the_rhythm_and_the_swings_that_were_built() -> None:
    row = walk.measure_walk(shot(walker()))
    assert row["speed_mps"] == pytest.approx(1.2, abs=0.01)
    assert row["cadence"] == pytest.approx(120, rel=0.02)
    assert row["step_m"] == pytest.approx(0.6, rel=0.05)
    assert row["bob_cm"] == pytest.approx(3.0, rel=0.05)
    assert row["knee_peak_deg"] == pytest.approx(60, abs=1)
    assert row["knee_min_deg"] == pytest.approx(0, abs=1)
    assert row["step_asymmetry_pc"] < 2
    glider = walk.measure_walk(shot(walker(bob=0.0)))
    assert glider["bob_cm"] < 0.1 < 3 * row["bob_cm"]


def test_trunk_and_head_have_their_own_angles() -> None:
    row = walk.measure_walk(shot(walker(spine1=(-10.0, 0, 0), neck=(-20.0, 0, 0))))
    straight = walk.measure_walk(shot(walker()))
    assert row["trunk_deg"] - straight["trunk_deg"] == pytest.approx(10, abs=3)
    assert row["head_deg"] == pytest.approx(-30, abs=1) and straight["head_deg"] == 0


def test_who_stands_does_not_walk() -> None:
    assert np.isnan(walk.measure_walk(shot(take(6.0)))["cadence"])


@pytest.mark.parametrize(("speed", "pace"), [(0.0, 0.0), (0.2, 0.5), (0.4, 1.0)])
def test_the_pace_of_a_slow_walk_counts_who_stands(speed: float, pace: float) -> None:
    """The goal is 12 m ahead, at 0.4 m/s."""
    walked = MeasuredTake(take(6.0, y=speed * time(6.0)), Goal((0.0, 12.0, 0.0), speed=0.4))
    assert walk.measure_walk(walked)["pace"] == pytest.approx(pace, abs=0.02)


def test_power_is_compared_at_the_same_speed() -> None:
    names = [f"{what}_{band}" for what in ("hips", "limbs") for band in walk.POWERS]

    def made(speed: float, power: float) -> dict[str, float]:
        return {"speed_mps": speed, **dict.fromkeys(names, power)}

    people = [made(1.1, 2.0), made(1.4, 8.0), made(2.0, 100.0)]
    shares = walk.power_shares([made(1.12, 1.0), made(1.45, 4.0)], people)
    assert shares["pairs"] == 2 and shares["limbs_6_10_hz"] == pytest.approx(0.5)
    assert np.isnan(walk.power_shares([made(0.6, 1.0)], people)["limbs_6_10_hz"])


def test_a_crowd_of_clones_marches() -> None:
    shots = [shot(replace(walker(), person=str(k)), (0.0, 40.0)) for k in range(4)]
    row = crowd.crowd_row(shots, [crowd.measure_crowd(s) for s in shots])
    assert row["phase_order"] == pytest.approx(1, abs=0.01)
    assert row["cycle_sd_deg"] == pytest.approx(0, abs=0.01)
    assert row["start_spread_s"] == 0
    assert feet.first_foot(shots[0].take.height) is not None
    walked = stride.steps(shots[0].take.ankles, shots[0].take.hips)
    assert walked is not None and walked.cadence == pytest.approx(120, rel=0.02)


def test_scripts_say_what_their_names_do() -> None:
    random = np.random.default_rng(0)
    scripts = {case.name: case.tasks(1, random)[0] for case in robust.SCRIPTS}
    behind = scripts["3 m behind every 2 s"]
    assert [order.at for order in behind.orders] == list(np.arange(0, 40, 2.0))
    face = scripts["about-face every 0.5 s"]
    headings = [order.plan(None)[0].heading for order in face.orders[:3]]
    assert abs(headings[0] - headings[1]) == pytest.approx(np.pi)
    assert headings[2] == headings[0] and face.orders[1].at == 0.5
    anywhere = scripts["anywhere every 0.25 s"]
    assert len(anywhere.orders) == 120
