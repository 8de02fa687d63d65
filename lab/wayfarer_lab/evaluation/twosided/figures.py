"""Figures of a take, by name: thin readings of `metrics`, in the units of the tables.

Of `eval maneuvers` (part `two-sided`) and `eval ranges`. Each is measured on a stretch: recorded
ones are found by how the body moves, ours by what was ordered. A person's figure is the
median over its stretches. *Range*: 10th to 90th percentile of recorded stretches, each performer
counting once (a style of 100STYLE is a performer). A figure *holds* if the median of people is
inside and their p90 − p10 is at least 30 % of the range's width. No spread is asked for where a
range is given by the literature, and of `still_share`, `arm_up`, `footfalls`, `shifts_min`. A
figure that less than half of the people have is not measured, and does not hold. `slide_cm_s` is
shown and does not count. Lifts, stances: see *maneuvers*.

Figures:
    still_share: share of frames in which no joint is faster than 1 cm/s (way of 5 frames)
    sway_cm: rms of the hips' horizontal distance from their mean in 3 s, median of windows
    head_cm_s: median speed of the head (way of 5 frames)
    hands_cm_s: the same of both wrists
    head_yaw_deg: range of the head's yaw against the chest in 3 s, median of windows
    shifts_min: times a minute that the hips go from beyond .6 of the way between the feet to below
        .4, or back (mean of half a second)
    ankles_cm: horizontal distance from ankle to ankle, mean
    elbow_deg: angle between upper arm and forearm, mean of both; 0: straight
    arm_out_deg: arc sine of the outward part of the upper arm in the chest's frame, mean of both
    arm_out_p95_deg: its 95th percentile of frames
    arm_up: share of frames with a wrist over its shoulder, or an upper arm over 60° out
    wrist_cm: way of a wrist along the facing, against the chest: p95 − p5, mean of both
    arm_leg: correlation of how far ahead a wrist and the opposite ankle are, mean of both
    trunk_deg: forward tilt of the trunk, mean
    twist_deg: yaw of the chest against the pelvis, p95 − p5
    power_6_10: mean square velocity of knees, ankles, balls, elbows and wrists against the hips
        from 6 to 10 Hz, (cm/s)²: of places, since most of the rotations' own is a thigh that turns
        about its axis, which markers hardly tell and nobody sees; without the trunk, whose share
        is the tremor of captures
    step_cm: length of a step, from strikes
    head_bob_cm: the head up and down: 2 √2 σ after the mean over a stride is subtracted
    head_pitch_deg: mean pitch of the head; negative: it looks down
    knee_support_deg: median flexion of a knee while its foot alone bears
    knee_swing_deg: mean over strides of a knee's largest flexion
    lift_cm: median height of lifts
    double_support: share of frames in which neither foot is lifted
    before_lift_s: seconds from the last frame in which the hips are slower than 3 cm/s to the first
        lift
    to_rest_s: seconds from .3 m/s to rest (hips and ankles slower than 8 cm/s for 1 s)
    footfalls: times that a foot comes down in that time
    foot_way_cm: horizontal way of an ankle from lift to landing, median of lifts
    lifts_per_m: lifts of both feet for a metre of the hips' way
    lifts_per_s: the same for a second
    lifts_per_90: the same for 90° of turn
    head_lead_deg: most yaw of the head ahead of the pelvis, the way of the turn, in the first half
        of it
    floor_turn: share of the turn that a foot turns on the floor while it bears, both feet
    peak_deg_s: greatest speed of the hips' heading, over .05 s
    lean_share: inward lean (head over the middle of the ankles, means over a second) ÷ atan(v ω /
        g)
    head_in_deg: mean yaw of the head against the pelvis, into the curve
    knee_deg: mean flexion of both knees; `knee_p95_deg`: 95th percentile; `knee_least_deg`, on
        stairs: mean over a leg's steps of the least
    apart_cm: ankle to ankle along the facing, at rest
    repair: how far rules move the joints of a step: mean and 95th percentile over joints and
        frames, of the distance in cm and of the local rotation in degrees; *all rules*: from the
        model's frames to those sent. On stairs without the height of the hips
"""

from math import nan

import numpy as np

from wayfarer.spec import FPS
from wayfarer_lab.evaluation.figures import smooth_speed
from wayfarer_lab.evaluation.maneuvers.stairs import placements, steps_per_riser
from wayfarer_lab.evaluation.maneuvers.stop import rest
from wayfarer_lab.evaluation.metrics import (
    arms,
    contact,
    feet,
    footwork,
    joints,
    leaning,
    liveliness,
    stride,
)
from wayfarer_lab.evaluation.metrics.spectrum import BANDS, band_power
from wayfarer_lab.evaluation.takes import (
    ANKLES,
    ELBOWS,
    HEAD,
    JOINT,
    LIMBS,
    SHOULDERS,
    WRISTS,
    Take,
)

CHEST = JOINT["spine3"]
FAST = BANDS.index((6.0, 10.0))
Values = dict[str, float]


def away(take: Take) -> np.ndarray:
    """Upper arms away from the body, degrees [T, 2]; see `arms.outward`."""
    places = take.joints
    return arms.outward(places[:, SHOULDERS], places[:, ELBOWS], take.turns[:, CHEST])


def upper_body(take: Take) -> Values:
    """Elbows, upper arms, swing of wrists against the chest, trunk."""
    places, out = take.joints, away(take)
    ahead = arms.ahead_of(places[:, WRISTS], places[:, CHEST], take.facing)
    bend = arms.elbow_bend(places[:, SHOULDERS], places[:, ELBOWS], places[:, WRISTS])
    return {
        "elbow_deg": float(bend.mean()),
        "arm_out_deg": float(out.mean()),
        "arm_out_p95_deg": float(np.quantile(out, 0.95)),
        "wrist_cm": 100 * arms.swing_range(ahead),
        "trunk_deg": float(take.forward.mean()),
    }


def slide(take: Take) -> Values:
    """Median speed of the lowest sole point while it is low, cm/s; see `contact.slide_speed`."""
    return {"slide_cm_s": 100 * contact.slide_speed(take.soles.reshape(len(take), -1, 3))}


def fine(take: Take) -> Values:
    """Power of limbs from 6 to 10 Hz."""
    return {"power_6_10": 1e4 * float(band_power(take.joints[:, LIMBS] - take.joints[:, :1])[FAST])}


def yaw_of_head(take: Take, base: int) -> np.ndarray:
    """Degrees by which the head is turned to the left against another joint. [T]"""
    return liveliness.yaw_against(take.turns[:, HEAD], take.turns[:, base])


def standing(take: Take) -> Values:
    """Figures of a stand of 3 s or more."""
    places = take.joints
    apart = np.linalg.norm(np.diff(take.ankles[..., :2], axis=1)[:, 0], axis=-1)
    found = upper_body(take)
    return {
        "still_share": liveliness.still_share(places),
        "sway_cm": 100 * liveliness.sway(take.hips),
        "head_cm_s": 100 * liveliness.median_speed(places[:, [HEAD]]),
        "hands_cm_s": 100 * liveliness.median_speed(places[:, WRISTS]),
        "head_yaw_deg": liveliness.range_in_window(yaw_of_head(take, CHEST)),
        "shifts_min": liveliness.weight_shifts(take.hips, take.ankles),
        "ankles_cm": 100 * float(apart.mean()),
        "elbow_deg": found["elbow_deg"],
        "arm_out_deg": found["arm_out_deg"],
        "trunk_deg": found["trunk_deg"],
        "knee_deg": float(take.knees.mean()),
    } | slide(take)


def walking(take: Take) -> Values:
    """Figures of a steady, straight walk; without steps only speed, arms and trunk."""
    metres = float(np.linalg.norm(take.hips[-1, :2] - take.hips[0, :2]))
    return (
        {"speed_mps": metres * FPS / (len(take) - 1)}
        | _gait(take)
        | upper_body(take)
        | fine(take)
        | slide(take)
    )


def _gait(take: Take) -> Values:
    walked = stride.steps(take.ankles, take.hips)
    if walked is None:
        return {}
    around, places = walked.stride_frames, take.joints
    peaks = [stride.extremes(take.knees[:, foot], walked.of(foot))[1] for foot in (0, 1)]
    ahead = [arms.ahead_of(places[:, part], take.hips, take.facing) for part in (WRISTS, ANKLES)]
    twist = liveliness.yaw_against(take.turns[:, CHEST], take.turns[:, 0])
    return {
        "step_cm": 100 * float(walked.length.mean()),
        "cadence": walked.cadence,
        "width_cm": 100 * float(walked.width.mean()),
        "bob_cm": 100 * stride.oscillation(take.hips[:, 2], around),
        "head_bob_cm": 100 * stride.oscillation(places[:, HEAD, 2], around),
        "knee_support_deg": footwork.knees_in_support(take.knees, take.height),
        "knee_swing_deg": float(np.mean(peaks)),
        "lift_cm": 100 * _median(feet.lift_tops(take.height)),
        "double_support": feet.double_support(take.height),
        "arm_leg": arms.against_legs(*ahead),
        "twist_deg": _range(twist),
        "head_yaw_deg": liveliness.range_in_window(yaw_of_head(take, CHEST)),
        "head_pitch_deg": float(joints.head_pitch(take.turns[:, HEAD]).mean()),
    }


def strafing(take: Take) -> Values:
    """Figures of steps to the side or back."""
    found = upper_body(take)
    return {
        "speed_mps": float(np.median(smooth_speed(take.hips))),
        "foot_way_cm": 100 * _median(footwork.lift_ways(take.ankles, take.height)),
        "lifts_per_m": footwork.lifts_per_metre(take.hips, take.height),
        "lifts_per_s": footwork.lifts_per_second(take.height),
        "lift_cm": 100 * _median(feet.lift_tops(take.height)),
        "knee_p95_deg": float(np.quantile(take.knees, 0.95)),
        "wrist_cm": found["wrist_cm"],
        "arm_out_p95_deg": found["arm_out_p95_deg"],
        "trunk_deg": found["trunk_deg"],
    } | slide(take)


def turning(take: Take) -> Values:
    """Figures of a turn on the spot."""
    return {
        "lifts_per_90": footwork.lifts_per_quarter(take.heading, take.height),
        "lift_cm": 100 * _median(feet.lift_tops(take.height)),
        "head_lead_deg": footwork.lead(yaw_of_head(take, 0), take.heading),
        "floor_turn": footwork.floor_turn_share(take.heading, take.stances),
        "peak_deg_s": float(np.abs(joints.turning_rate(take.heading)).max()),
        "foot_way_cm": 100 * _median(footwork.lift_ways(take.ankles, take.height)),
        "knee_p95_deg": float(np.quantile(take.knees, 0.95)),
        "wrist_cm": upper_body(take)["wrist_cm"],
    } | slide(take)


def curving(take: Take) -> Values:
    """Figures of a walked curve."""
    way = np.sign(take.heading[-1] - take.heading[0])
    found = upper_body(take)
    return {
        "speed_mps": float(np.median(smooth_speed(take.hips))),
        "lean_share": leaning.share_of_asked(take.ankles, take.joints[:, HEAD], take.hips),
        "head_in_deg": float(way * yaw_of_head(take, 0).mean()),
        "wrist_cm": found["wrist_cm"],
        "arm_out_p95_deg": found["arm_out_p95_deg"],
        "lifts_per_m": footwork.lifts_per_metre(take.hips, take.height),
    } | slide(take)


def turning_back(take: Take) -> Values:
    """Figures of a walk that turns back."""
    places, out = take.joints, away(take)
    raised = arms.lifted(places[:, SHOULDERS], places[:, WRISTS], out)
    return {
        "peak_deg_s": float(np.abs(joints.turning_rate(take.heading)).max()),
        "arm_up": float(raised.mean()),
        "arm_out_p95_deg": float(np.quantile(out, 0.95)),
        "elbow_deg": upper_body(take)["elbow_deg"],
        "knee_p95_deg": float(np.quantile(take.knees, 0.95)),
        "lifts_per_s": footwork.lifts_per_second(take.height),
        "head_lead_deg": footwork.lead(yaw_of_head(take, 0), take.heading),
        "trunk_deg": float(take.forward.mean()),
    } | slide(take)


def starting(take: Take) -> Values:
    """Figures of a stand and the walk after it."""
    return {"before_lift_s": footwork.seconds_before_lift(take.hips, take.height)}


def stopping(take: Take) -> Values:
    """Figures of a stop, from the second before a walker slows to .3 m/s: seconds from there to
    rest, footfalls in that time, feet apart along the facing at rest.
    """
    speed = smooth_speed(take.hips, 0.2)
    slowed = np.flatnonzero(speed > 0.3)
    begun = rest(take)
    if not len(slowed) or begun is None:
        return {"to_rest_s": nan, "footfalls": nan, "apart_cm": nan}
    start = int(slowed[slowed <= begun][-1]) if (slowed <= begun).any() else 0
    apart = joints.apart_along(take.ankles[begun], take.facing[begun])
    return {
        "to_rest_s": (begun - start) / FPS,
        "footfalls": footwork.footfalls(take.height[start : begun + 1]),
        "apart_cm": 100 * float(apart),
    }


def climbing(take: Take) -> Values:
    """On stairs, up or down: mean flexion of both knees, the mean least of a leg's step, p95."""
    strikes = [
        np.array([frame for frame, _ in placements(ankles)])
        for ankles in np.moveaxis(take.ankles, 1, 0)
    ]
    least = [stride.extremes(take.knees[:, foot], strikes[foot])[0] for foot in (0, 1)]
    return {
        "knee_deg": float(take.knees.mean()),
        "knee_least_deg": float(np.mean(least)),
        "knee_p95_deg": float(np.quantile(take.knees, 0.95)),
        "steps_per_riser": steps_per_riser(take, slice(0, len(take))),
    }


def _median(values: list[float]) -> float:
    return float(np.median(values)) if values else nan


def _range(values: np.ndarray) -> float:
    low, high = np.quantile(values, (0.05, 0.95))
    return float(high - low)
