"""Definitions of all figures, as `wayfarer eval define` prints them and docs/figures.md shows them.

A name may hold `*`: `drift_2s_*` defines `drift_2s_mean_m` and its like. Where a name is in several
groups, the group of the table counts.
"""

from fnmatch import fnmatchcase
from typing import Final

from wayfarer_lab.evaluation.figure_group import Group
from wayfarer_lab.evaluation.twosided.definitions import TWO_SIDED

PAGE: Final = """# Figures of the evaluation

Printed by `wayfarer eval define`. [evaluation.md](evaluation.md) says how to measure them,
[results.md](results.md) has the values.
"""

GROUPS: Final = (
    Group(
        "All tables",
        "World space, Z up, floor at z = 0, metres, 40 fps. The 67 markers are skinned from the "
        "streamed body parameters, for models and recordings alike; rows *mocap* are recorded "
        "*locomotion*. *Soles* are the four markers under each foot. A figure is a mean over "
        "frames and windows unless it says otherwise. *Windows* are 5 primitives long (1 s) and "
        "do not overlap. Rows `…, 0.9-1.4 m/s` hold only windows at walking speed: contact falls "
        "with speed, so compare like with like.",
        {
            "windows": "number of windows",
            "motions": "number of motions",
            "runs": "number of runs",
            "agents": "number of agents",
            "seconds": "length of each motion",
            "speed_mps": "horizontal speed of the hips, from positions 10 frames apart",
            "contact_paper*": "Eq. 11 for each 10 frames: exp(−(min|z| − .05)₊) · exp(−(min "
            "speed − .075)₊), minima over all markers and frames. One slow low marker is enough, "
            "so it saturates. `_q25 _median _q75` are over motions, as the boxes of Fig. 3",
            "contact_strict": "Eq. 11 for each frame, soles only",
            "slide_cm_s": "median horizontal speed of the lowest sole marker while below 3 cm",
            "both_feet_skating": "share of frames in which the lowest sole marker of *both* feet "
            "is within 5 cm of the floor and faster than 0.15 m/s horizontally (PRIMAL, at 30 "
            "fps)",
            "heel_skating_75mm_s": "MOJO's measure: share of frames in which both heel markers "
            "(LHEE, RHEE) are within 5 cm of the floor and have moved faster than 75 mm/s "
            "horizontally since the last frame; MOJO's limit is 5 mm a frame at 15 fps",
            "heel_skating_200mm_s": "the same with 200 mm/s: 5 mm a frame at our 40 fps",
            "penetration_cm": "mean depth of the lowest marker below the floor",
            "deeper_3cm": "share of frames in which the lowest marker is deeper than 3 cm",
            "floating_5cm": "share of frames whose lowest marker is above 5 cm (flight phases of "
            "runs count)",
            "acceleration_m_s2": "mean norm of second differences, all markers",
            "jerk_m_s3": "mean norm of third differences, all markers",
            "seam_ratio": "mean acceleration at the frames on both sides of a primitive's seam ÷ "
            "elsewhere; 1: no seam shows",
            "deformation_*_mm": "sum over pairs of a rigid part's four markers of the standard "
            "deviation of their distance in a window (MOJO; Tab. S3). Skin is soft: the torso of "
            "recordings deforms too",
            "carried_error_mm": "distance of the markers that a primitive hands to the next one "
            "from the body's own markers",
            "carried_deformation_mm": "deformation of those markers over the whole motion, mean "
            "of the parts",
            "lost": "share of motions that did not stay bodies (not finite, or a marker over 3 m "
            "from the hips); the other figures leave them out",
            "auc": "in place of the paper's users: how often a linear classifier ranks a recorded "
            "window of 2 s (train split, 0.9–1.5 m/s, as many and as fast) above one of these; "
            "0.5: it sees no difference. NaN with fewer than 40 windows",
            "auc_windows": "windows of each kind that were compared",
            "pose_prior": "how usual the poses are to the pose prior: exp(−|μ|² / 32), mean over "
            "frames, 0…1 (Eq. 8 with a scale, docs/models.md)",
            "frechet_v1": "Fréchet distance from the recorded locomotion of the *train* split, "
            "on 37 statistics of 2 s windows: velocities and heights of hips, head, hands and "
            "feet in the body's heading, turning speed, coordination "
            "(`evaluation/metrics/frechet.py`). Other people's walking is far from 0 (26 to 214 "
            "for one subject against the others of our train split), so read it against the row "
            "mocap. Few windows raise it: 196 drawn from the reference itself gave 1.5",
            "frechet_windows": "number of windows for `frechet_v1`",
            "trunk_tilt_deg": "angle of the trunk (waist to chest) from that of the T-pose",
            "marker_speed_cm_s": "speed of all markers while standing",
        },
    ),
    Group(
        "realism",
        "No search, no goals; bodies begin frozen in a pose. Names are the paper's: `1f` and "
        "`2f` are seed lengths; `ro` is trained over rollouts; seeds are the average of "
        "predicted and reprojected markers, with `reproj` only reprojected ones, with `pred` "
        "only predicted ones; `ungrounded` is without our height correction; `ro-policy` draws "
        "latents from the policy on the way to random goals in 20 × 20 m (target speed 1.2 m/s), "
        "the others from N(0, I). Every variant has the same poses and noise. 2-frame models get "
        "their first seed from a primitive of the 1-frame model, as in GAMMA; the first "
        "primitive does not count. Shipped models hold only the `ro` parts. Perceptual scores "
        "need people and are not made.",
        {},
    ),
    Group(
        "skating",
        "The same for the plain variants and the policy. The paper reports 0.064 for GAMMA, "
        "0.067 for its recordings, 0.341 and 0.278 for MOJO, on other bodies and data; it does "
        "not say whether its limit was MOJO's speed or MOJO's 5 mm a frame.",
        {},
    ),
    Group(
        "reprojection",
        "The body regressor beside reprojection by optimisation, as in MOJO: on recorded "
        "primitives, whose seeds are known, and in random motion of the 2-frame model.",
        {
            "ms_per_primitive": "processor time to find the bodies of a primitive, in batches of "
            "recorded primitives, ÷ their number",
        },
    ),
    Group(
        "bodies",
        "Shapes lie at −2.5 … 2.5 standard deviations of the first two components together (the "
        "range of training; the paper interpolates −6 … 6 of SMPL-X), all from the same ten "
        "poses and noise; then each pose is played on the mean shape. Rows of *Spread* are "
        "standard deviations over shapes and over poses.",
        {
            "success_075m": "share that comes within 0.75 m of a goal 5 m ahead in 60 "
            "primitives; with the policy, without search",
            "steps": "primitives until then",
        },
    ),
    Group(
        "predictor",
        "Distances are L2 of whole poses (201 coordinates) in the canonical frame of the seed. "
        "*One sample*: K = 1. Two baselines are the last frame repeated and a straight line. "
        "**mocap** takes the futures of the K primitives of the train split whose 2-frame seeds "
        "are nearest.",
        {
            "primitives": "number of recorded primitives",
            "samples": "K, futures drawn for each",
            "ade_m": "the best of K futures by its mean over frames",
            "fde_m": "the best of K futures by its last frame",
            "mmade_m": "`ade_m`, mean over every true future whose last seed frame is within 0.5 m",
            "mmfde_m": "`fde_m`, mean over the same",
            "apd_m": "mean pairwise L2 of the K futures, flattened over frames too (the paper's "
            "*diversity*)",
        },
    ),
    Group(
        "regressor",
        "Recorded poses on their own shape and on random ones. **mocap** puts the recordings' "
        "own parameters in the regressor's place: 0 except for rounding.",
        {
            "frames": "number of frames",
            "amd_mm": "mean distance of markers",
            "amd_p95_mm": "95th percentile of the distance of markers",
            "avd_mm": "mean distance of mesh vertices (100 frames)",
            "joint_angle_deg": "mean angle between joint rotations",
        },
    ),
    Group(
        "control",
        "A body stands in the centre of 20 × 20 m, its goal is anywhere in it. Rows `policy` and "
        "`N(0, I)` grow a tree of 32 clones per body offline (paper Sec. 3.3.2, 4.2); `top k` "
        "keeps the best k at every level. Rows `search K` are single agents as served. Trees "
        "grow on to 0.3 m for `success_03m`; everything else is of the moment at which the first "
        "clone is within 0.75 m, and gait is of four clones chosen at random. Only the last row "
        "has the foot lock. `policy` is that of `--models`; the shipped one is trained by "
        "analytic gradients (docs/models.md), which the paper does not do. `--policy-10`, "
        "`--policy-1` and `--g-cvae` name model folders for the paper's rows `policy(10)`, "
        "`policy(1)` (PPO with these KL weights) and `g-CVAE`. Those three are told the goal and "
        "the speed alone, all others what the service's steering tells: it has who stands turn on "
        "the spot first.",
        {
            "pairs": "number of bodies and goals",
            "success": "share in which a clone is within 0.75 m in 60 primitives",
            "success_03m": "the same within 0.3 m",
            "steps": "primitives until `success`",
            "avg_dist": "mean distance of all clones at the end; 0 for clones that have arrived",
            "contact": "`contact_paper`",
            "walk_*": "the same in windows at 0.9-1.4 m/s",
        },
    ),
    Group(
        "arrival",
        "Goals 3 to 8 m away, then manoeuvres (`evaluation/goal_rows.py`). In `steps_median` and "
        "its like, whatever never happened counts as later than all else.",
        {
            "success": "share within 0.75 m of the goal in 60 primitives",
            "success_03m": "the same within 0.3 m",
            "steps": "primitives until `success`, mean",
            "steps_*": "primitives until it is done: median of `success`, of the heading being "
            "met within 15°, or (`headed`) of facing the way to the goal within 30°",
            "final_distance_m": "distance after 60 primitives",
            "stopped": "share that came to a stand after reaching the goal",
            "arrival_error_*": "distance from hips to goal at that moment",
            "seconds_to_stand": "time from 0.75 m to the stand, median",
            "drift_2s_*": "farthest distance from there in the 2 s afterwards",
            "drift_5s_*": "the same in 5 s",
            "drift_*": "turns on the spot: farthest distance from the place",
            "facing_error_*": "angle off the asked heading",
            "reached_15": "share within 0.3 m in 15 primitives",
            "faced_15": "share within 15° of the heading in 15 primitives",
            "wished_mps": "target speed",
            "speed_error_*": "difference of each agent's cruising speed from the target speed",
            "passed": "share of waypoints within whose radius the hips came",
            "missed_by_m": "nearest approach to a waypoint",
            "speed_kept_*": "lowest speed at a waypoint ÷ speed between them",
            "detour": "distance walked ÷ straight distance",
        },
    ),
    Group(
        "long",
        "Minutes of goal after goal. `…_agents` are agents that ever had the fault, `…_share` is "
        "the share of frames with it. *Scripts* have the figures of the manoeuvre `reversals`.",
        {
            "fallen_*": "hips below 0.6 of their height, or 60° over",
            "tilted_*": "trunk over 25° for 1 s",
            "floating_*": "lowest marker more than 8 cm above the floor for 0.5 s",
            "sunk_*": "lowest marker more than 8 cm below the floor for 0.5 s",
            "spinning_*": "turned by 540° within 1.5 m of a goal not reached",
            "exploded_*": "a marker more than 3 m from the hips",
            "nan_*": "numbers that are not finite",
            "resets": "how often an agent leaned by 32° or squatted and was put back to a stand",
            "at_s": "when an agent got up, from its first frame on",
            "state": "what it was doing",
            "lean_deg": "mean lean of its spine when it fell",
            "hips": "height of its hips then ÷ that in a stand",
            "minutes_each": "length of the run",
            "goals_given": "number of goals given",
            "goals_reached": "number of goals reached",
        },
    ),
    Group(
        "scenes",
        "`cubes`: the paper's field of 20 × 20 m with 30 boxes, random starts and goals, "
        "everybody alone (as in `slope`, `storeys`, `doors`, `crates`). `corridor`: two streams "
        "of people who change sides; `doorway`: 8 people in either of two rooms change rooms "
        "through a door of 1.2 m. `square`: people by `PopulateSession` for some minutes. "
        "`slope`, `storeys`: up and down again. `doors`: the door to the goal's room shuts 2 m "
        "before the agent and opens after 6 s. `crates`: a crate is dropped 2 m before the "
        "agent. Every frame counts; in `corridor` and `doorway` every second one, in `square` "
        "every eighth. "
        "The JSON's `meta` lists the worst moments of each scenario (number of the agent, time).",
        {
            "success": "share that reaches its last goal within 10 s + path ÷ 0.5 m/s (`slope`, "
            "`storeys`: 15 s + path ÷ 0.4 m/s; `corridor`, `doorway`: 90 s); `doors`: that waits "
            "while the door is shut, and arrives afterwards; `crates`: that arrives within 45 s; "
            "`square`: that is never stuck",
            "agent_frames": "number of frames of all agents that count",
            "goals_per_minute_each": "goals reached by an agent per minute",
            "seconds_median": "time until arrival, median",
            "seconds_last": "time until the last agent has arrived",
            "penetration_frames": "share of frames in which skin (1,296 points) is more than 1 "
            "cm inside a solid or obstacle, in space: a hand above a low box is free. Feet do "
            "not count in what is walked on; in a wall of 15 cm nobody is deeper than 7.5",
            "penetration_5cm": "the same for more than 5 cm",
            "penetration_mean_cm": "mean depth in `penetration_frames`",
            "penetration_max_cm": "greatest depth",
            "overlap_frames": "share of an agent's frames in which it is more than 5 cm inside "
            "another agent: 16 capsules along bones, with the median distance of the skin that a "
            "bone moves as radius",
            "overlap_max_cm": "greatest overlap",
            "path_ratio*": "path found ÷ shortest possible one (visibility graph over the free "
            "ground)",
            "walked_ratio": "distance walked by the hips (positions 0.6 s apart) plus what is "
            "left to the goal, ÷ the same",
            "stuck_agents": "agents with a goal not reached that stay within 0.3 m of one place "
            "for 10 s or more",
            "stuck_seconds": "seconds of being stuck, all agents",
            "foot_gap_uneven_*": "the same where the ground 25 cm around differs by 2 cm",
            "foot_gap_*": "magnitude of the height of a foot's lowest sole point above the "
            "ground under it (from the solids, not from samples), where contact is reported",
            "*_felt_s_*": "seconds from a change of the scene (a door that shuts or opens, a "
            "crate) until the hips differ by 1 mm from those of a run without the change",
            "*_seen_s_*": "the same by 5 cm",
            "cpu_load": "CPU seconds per second of motion, of all agents of the row",
            "cpu_us_per_step": "CPU time of one agent's step, µs",
            "engine_share": "the engine's share of the CPU time",
            "navigation_share": "the share of finding the way",
            "avoidance_share": "the share of collision avoidance",
        },
    ),
    Group(
        "maneuvers",
        "A foot's *height* is that of its lowest sole marker above the ground. It is *lifted* "
        "from the moment it rises above 1.5 cm until it is below 1.0. It *bears* if it is not "
        "lifted and slower than 0.7 m/s, or if the other foot does not bear either. A *stance* "
        "is a period of bearing; its *slip* is the farthest that the patch on the ground (sole "
        "markers within 1 cm of the lowest) was from its start, its *turn* the range of the "
        "foot's heading. `n` are takes, `people` are people, or styles of one person.",
        {
            "hips_p5": "height of the hips ÷ that in the T-pose, 5th percentile of all frames",
            "hips_least": "the same, minimum",
            "lean_*": "angle from the vertical of the line from between the ankles to the head; "
            "`p95`: 95th percentile of frames",
            "left_right_points": "largest difference between left and right of `hips_p5`, "
            "`float_share`, `contact_up` and `arrive`, in points of 100",
            "tilt_*": "angle of the trunk (waist to chest) from that of the T-pose, to any side",
            "over_30_deg": "share of frames with the trunk over 30°",
            "float_share": "share of frames with the lower foot more than 3 cm up",
            "floats_seen": "share of takes in which that lasts 0.2 s",
            "airborne_share": "share of frames in which neither foot bears",
            "contact_up": "share of reported contacts with that foot more than 2 cm up",
            "contact_floating": "share of floating frames with any contact reported",
            "slip_cm_*": "slip of all stances: median, 95th percentile, each foot",
            "stance_turn_deg_*": "turn of all stances, likewise",
            "lift_cm_p50": "median height of lifts",
            "arrive": "share within 0.3 m of the goal at the end",
            "end_m": "distance to the goal at the end",
            "off_heading_*": "angle off the asked heading",
            "lifts": "lifts of both feet together",
            "lifts_per_04_m": "lifts per 0.4 m of path",
            "no_lift": "share of takes without any lift",
            "slide_cm*": "stand: how far a sole moved between two lifts, whether it bears or "
            "hovers; largest of a take",
            "heading_range_deg*": "stand: range of the hips' heading",
            "pivot_deg": "turn: turn of all stances together, mean of both feet, in 6 s",
            "peak_deg_s": "greatest speed of the hips' heading, over 0.05 s",
            "turn_s": "seconds from 10 % to 90 % of the turn",
            "apart_cm*": "stop: ankle to ankle along the facing, 2 s after rest (hips and ankles "
            "slower than 8 cm/s for 1 s)",
            "heel_up": "stop: share with a heel over 2 cm above the lowest sole marker at that "
            "moment",
            "sway_back_cm*": "stop: how far the hips go back, the way that they faced, within 3 s "
            "after they have slowed to 0.3 m/s",
            "behind_cm*": "stop: how far they are behind the rear ankle in that time, at worst",
            "lean_back_deg*": "stop: how far the trunk leans back in that time, at worst",
            "more_lifts*": "stop: lifts of both feet in that time",
            "hand_ahead_cm*": "stand and stop: how far a wrist is ahead of the hips, of the one "
            "that is farther; in a stand its mean over time, in a stop 2 s after rest",
            "hands_apart_cm*": "by how far it is ahead of the other one",
            "hand_up_cm*": "by how far one wrist is above the other one",
            "pop_cm*": "largest second difference of any joint's position, cm/frame²",
            "both_up": "share of frames with both soles more than 3 cm above the ground",
            "folded": "share of agents whose hips sink below 0.75 of their height in the T-pose",
            "root_step_cm": "longest way of the hips from one frame to the next, in space",
            "knee_*": "flexion from the T-pose, −180 … 180; negative is beyond straight, or "
            "inside out",
            "steps_per_riser": "footholds (slower than 0.3 m/s, 10 cm apart) ÷ risers between "
            "the lowest and the highest",
            "speed_mps*": "speed along the path",
            "cadence*": "steps per second, from strikes: an ankle farthest ahead of the hips "
            "(Zeni 2008)",
            "step_m": "length of a step, from strikes",
            "width_cm": "width of a step, from strikes",
            "bob_cm": "hips up and down: 2 √2 σ after the mean over a stride is subtracted",
            "lateral_cm": "the same sideways",
            "surge_mps": "the same of the speed",
            "trunk_deg": "forward tilt of the trunk",
            "head_deg": "pitch of the head; negative: it looks down",
            "hips_*_hz": "mean square velocity of the hips by frequency band, (m/s)²; `÷ "
            "recorded`: each recorded walk against ours of the nearest speed",
            "limbs_*_hz": "the same of ten limb joints relative to the hips",
            "right_first": "share of starts in which the right foot is lifted first",
            "cycle_sd_deg": "standard deviation of the mean gait cycle between people, by joint, "
            "axis and moment",
            "phase_order": "|mean exp(2πi phase)| of all walkers, from 2 s on, while 9 of 10 "
            "phases are known; 1 is a march, chance is 0.9 ÷ √n",
            "start_spread_s": "5th to 95th percentile of the time until 0.3 m/s",
            "start_sd_s": "standard deviation of that time",
            "auc": "linear classifier (shrunk LDA, 4 folds by person) between ours and recorded "
            "people, on the statistics of `frechet_v1` without mean heights, windows of 2 s at "
            "0.9–1.5 m/s, matched in number and speed, mean of 5 draws. In the column "
            "*recorded*: half of the people against the other half",
            "frechet": "Fréchet distance on the same",
        },
    ),
    TWO_SIDED,
)
"""In the order of the tables."""


def definitions(figure: str) -> list[tuple[str, str, str]]:
    """Title of the group, name and definition, of each group that defines `figure`: by its name,
    or else by a pattern.
    """
    found = [
        (group.title, name, text)
        for group in GROUPS
        for name, text in group.figures.items()
        if fnmatchcase(figure, name)
    ]
    exact = [entry for entry in found if entry[1] == figure]
    first = {group: (group, name, text) for group, name, text in reversed(found)}
    return exact or list(first.values())[::-1]


def as_markdown() -> str:
    """The page: groups as sections, each with a table."""
    parts = [PAGE]
    for group in GROUPS:
        parts.append(f"## {group.title}\n{group.about}\n")
        if group.figures:
            parts.append("| figure | definition |\n|---|---|")
            parts += [f"| `{name}` | {_cell(text)} |" for name, text in group.figures.items()]
            parts.append("")
    return "\n".join(parts)


def _cell(text: str) -> str:
    return text.replace("|", r"\|")
