"""Definitions of the two-sided figures, for `wayfarer eval define`."""

from typing import Final

from wayfarer_lab.evaluation.figure_group import Group

TWO_SIDED: Final = Group(
    "two-sided",
    "Of `eval maneuvers` (part `two-sided`), `eval bare` and `eval ranges`. Each is taken of a "
    "stretch: of recorded people as found by how the body moves, of ours as ordered; of several "
    "stretches of a person the median counts. *Range*: 10th to 90th percentile of recorded "
    "stretches, each performer counting once (a style of 100STYLE is a performer). A figure *holds*"
    " if the median of people is inside and their p90 − p10 is at least 30 % of the range's width; "
    "no spread is asked for where a range is given by the literature, and of `still_share`, "
    "`arm_up`, `footfalls`, `shifts_min`. What less than half of the people have is not measured, "
    "and does not hold. `slide_cm_s` is shown and does not count. Lifts, stances: see *maneuvers*.",
    {
        "still_share": "share of frames in which no joint is faster than 1 cm/s (way of 5 frames)",
        "sway_cm": "rms of the hips' horizontal distance from their mean in 3 s, median of windows",
        "head_cm_s": "median speed of the head (way of 5 frames)",
        "hands_cm_s": "the same of both wrists",
        "head_yaw_deg": "range of the head's yaw against the chest in 3 s, median of windows",
        "shifts_min": "times a minute that the hips go from beyond .6 of the way between the feet "
        "to below .4, or back (mean of half a second)",
        "ankles_cm": "horizontal distance from ankle to ankle, mean",
        "elbow_deg": "angle between upper arm and forearm, mean of both; 0: straight",
        "arm_out_deg": "arc sine of the outward part of the upper arm in the chest's frame, mean "
        "of both",
        "arm_out_p95_deg": "its 95th percentile of frames",
        "arm_up": "share of frames with a wrist over its shoulder, or an upper arm over 60° out",
        "wrist_cm": "way of a wrist along the facing, against the chest: p95 − p5, mean of both",
        "arm_leg": "correlation of how far ahead a wrist and the opposite ankle are, mean of both",
        "trunk_deg": "forward tilt of the trunk, mean",
        "twist_deg": "yaw of the chest against the pelvis, p95 − p5",
        "power_6_10": "mean square angular velocity of the 21 local joint rotations from 6 to 10 "
        "Hz, sum over joints, rad²/s²",
        "step_cm": "length of a step, from strikes",
        "head_bob_cm": "the head up and down: 2 √2 σ after the mean over a stride is subtracted",
        "head_pitch_deg": "mean pitch of the head; negative: it looks down",
        "knee_support_deg": "median flexion of a knee while its foot alone bears",
        "knee_swing_deg": "mean over strides of a knee's largest flexion",
        "lift_cm": "median height of lifts",
        "double_support": "share of frames in which neither foot is lifted",
        "before_lift_s": "seconds from the last frame in which the hips are slower than 3 cm/s to "
        "the first lift",
        "to_rest_s": "seconds from .3 m/s to rest (hips and ankles slower than 8 cm/s for 1 s)",
        "footfalls": "times that a foot comes down in that time",
        "foot_way_cm": "horizontal way of an ankle from lift to landing, median of lifts",
        "lifts_per_m": "lifts of both feet for a metre of the hips' way",
        "lifts_per_s": "the same for a second",
        "lifts_per_90": "the same for 90° of turn",
        "head_lead_deg": "most yaw of the head ahead of the pelvis, the way of the turn, in the "
        "first half of it",
        "floor_turn": "share of the turn that a foot turns on the floor while it bears, both feet",
        "peak_deg_s": "greatest speed of the hips' heading, over .05 s",
        "lean_share": "inward lean (head over the middle of the ankles, means over a second) ÷ "
        "atan(v ω / g)",
        "head_in_deg": "mean yaw of the head against the pelvis, into the curve",
        "knee_deg": "mean flexion of both knees; `knee_p95_deg`: 95th percentile; "
        "`knee_least_deg`, on stairs: mean over a leg's steps of the least",
        "apart_cm": "ankle to ankle along the facing, at rest",
        "repair": "how far rules move the joints of a step: mean and 95th percentile over joints "
        "and frames, of the distance in cm and of the local rotation in degrees; *all rules*: from "
        "the model's frames to those sent. On stairs without the height of the hips",
    },
)
