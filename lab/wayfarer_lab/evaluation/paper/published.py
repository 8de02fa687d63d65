"""The paper's own figures (Zhang and Tang, CVPR 2022, and its appendix), and our rows beside them.

Typed in from the paper's text; figures that it shows in pictures alone are left out. A row of ours
is named by its result file; `why` says what is missing when no file has it.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from wayfarer_lab.evaluation.paper.results import Source

Values = tuple[float, ...]

UNTRAINED_PPO: Final = (
    "not measured here: `wayfarer train policy --config paper/policy_{0}_approach`, `wayfarer "
    "export`, `wayfarer eval control --policy-{0} --lead` (docs/models.md, *PPO from scratch*)"
)
RUNS: Final = "`python -m benchmarks.paper_runs {0} --data PREPARED` trains and measures it"
"""How to get what is not trained."""
SHORT: Final = RUNS.format("short --seed SEED")
NOT_RUN: Final = "not run on these models: `wayfarer eval {0}`"
MOJO: Final = (
    "its weights come under the licence of AMASS; the row of optimisation below does as it does"
)
HUMOR: Final = "its weights come under the licences of AMASS and SMPL, which do not allow them here"
LICENCE: Final = (
    "the licence of these recordings does not allow them here; who has AMASS prepares them as "
    "docs/data.md says and measures them with --data"
)


@dataclass(frozen=True)
class Line:
    """A row of a table; `paper` has the paper's values of the table's first figures."""

    name: str
    paper: Values = ()
    source: Source | None = None
    why: str = ""  # without a measured row: what is missing


@dataclass(frozen=True)
class Exhibit:
    """A table or figure of the paper. `figures`: ours → what the paper calls it."""

    title: str
    about: str
    figures: Mapping[str, str]
    lines: tuple[Line, ...]


def control_row(name: str, *files: str) -> Source:
    """Of `wayfarer eval control`."""
    return Source(name, files or ("control_paper*", "control"))


def realism_row(name: str) -> Source:
    """Of `wayfarer eval realism` of the shipped model."""
    return Source(name, ("realism",))


def predictor_row(name: str) -> Source:
    """Of `wayfarer eval predictor`, of predictors that are trained alike."""
    return Source(name, ("predictor_paper*",))


def alike_row(name: str) -> Source:
    """Of `wayfarer eval realism`, of predictors that are trained alike."""
    return Source(name, ("realism_paper*",))


def short_row(table: str, name: str) -> Source:
    """Of a table of the short trainings, which differ in their seed alone."""
    return Source(name, (f"{table}_short*",))


def direct_row(name: str) -> Source:
    """Of `wayfarer eval realism`, of primitives of markers or body parameters, trained alike."""
    return Source(name, ("realism_direct*",))


def shipped_row(table: str, name: str) -> Source:
    """Of a table of the shipped model."""
    return Source(name, (table,))


END_TO_END: Final = Source("ro-2f", ("realism_e2e*",))


REGRESSED: Final = "regressed"
OPTIMISED: Final = "optimised, 100 iterations"


def reprojection_row(name: str) -> Source:
    """Of `wayfarer eval reprojection`."""
    return Source(name, ("reprojection",))


def regressor_row(name: str, *files: str) -> Source:
    """Of `wayfarer eval regressor`."""
    return Source(name, files or ("regressor",))


def bodies_row(name: str) -> Source:
    """Of `wayfarer eval bodies --extent 6 --starts prior`, the paper's setting."""
    return Source(name, ("bodies_paper*",))


def bodies_25_row(name: str) -> Source:
    """Of `wayfarer eval bodies`."""
    return Source(name, ("bodies",))


def skating_row(name: str) -> Source:
    """Of `wayfarer eval skating`."""
    return Source(name, ("skating",))


OURS: Final = "control"

TABLE_1: Final = Exhibit(
    "Table 1: motion control",
    "100 random bodies and goals, 32 clones each (the rows of *search* have one), at most 60 "
    "primitives, 0.75 m. *contact* is Eq. 11. The shipped policy is cloned from recordings, which "
    "the paper does not do: its rows have no figure of the paper's.",
    {"steps": "steps", "success": "success rate", "avg_dist": "avg. dist.", "contact": "contact"},
    (
        Line("g-CVAE", (24.1, 0.91, 3.46, 0.8), control_row("g-CVAE")),
        *(
            Line(name, values, control_row(name), UNTRAINED_PPO.format(weight))
            for name, weight, values in (
                ("policy(10)", 10, (33.9, 0.95, 3.32, 0.94)),
                ("policy(1)", 1, (21.2, 1.0, 3.60, 0.93)),
                ("policy(10) & top1", 10, (26.5, 0.99, 0.04, 0.97)),
                ("policy(10) & top4", 10, (23.4, 0.96, 1.98, 0.96)),
            )
        ),
        Line("ours: policy(1) & top1", (), control_row("policy(1) & top1")),
        Line("ours: policy(1) & top4", (), control_row("policy(1) & top4")),
        Line("ours: policy, shipped", (), control_row("policy", OURS)),
        Line("ours: policy & top1, shipped", (), control_row("policy & top1", OURS)),
        Line("ours: policy & top4, shipped", (), control_row("policy & top4", OURS)),
        Line("ours: N(0, I) & top1", (), control_row("N(0, I) & top1", OURS)),
        Line("ours: search K=8, as served", (), control_row("search K=8 π", OURS)),
        Line("recordings", (), control_row("mocap", OURS)),
    ),
)

S1: Final = Exhibit(
    "Table S1: marker predictors",
    "Best of 10 futures. The paper's figures are those of ACCAD (6,298 primitives of 20 people), "
    "below those of HumanEva (2,021 of 3 people); ours are those of three people of CMU. The row "
    "of recordings predicts the futures of the 10 most similar recorded primitives.",
    {
        "apd_m": "diversity",
        "ade_m": "ADE",
        "fde_m": "FDE",
        "mmade_m": "MMADE",
        "mmfde_m": "MMFDE",
    },
    (
        *(
            Line(f"predictor-{name}", values, predictor_row(name), RUNS.format("predictors"))
            for name, values in (
                ("1f", (1.64, 0.42, 0.69, 0.57, 0.81)),
                ("2f", (0.50, 0.19, 0.34, 0.44, 0.60)),
                ("ro-1f", (1.72, 0.44, 0.72, 0.58, 0.83)),
                ("ro-2f", (0.88, 0.21, 0.36, 0.44, 0.59)),
            )
        ),
        *(
            Line(f"ours: {name}, short", (), short_row("predictor", name), SHORT)
            for name in ("1f", "2f", "ro-1f", "ro-2f")
        ),
        Line("ours: shipped, 1-frame", (), shipped_row("predictor", "ro-1f")),
        Line("ours: shipped, 2-frame", (), shipped_row("predictor", "ro-2f")),
        Line("ours: repeat the last frame", (), shipped_row("predictor", "repeat last frame")),
        Line("ours: straight line", (), shipped_row("predictor", "straight line")),
        Line("recordings", (), shipped_row("predictor", "mocap")),
        Line("HumanEva, predictor-1f", (2.02, 0.30, 0.48, 0.42, 0.55), why=LICENCE),
        Line("HumanEva, predictor-2f", (0.53, 0.16, 0.28, 0.39, 0.48), why=LICENCE),
        Line("HumanEva, predictor-ro-1f", (2.08, 0.33, 0.51, 0.44, 0.57), why=LICENCE),
        Line("HumanEva, predictor-ro-2f", (0.95, 0.18, 0.31, 0.37, 0.46), why=LICENCE),
    ),
)

S2: Final = Exhibit(
    "Table S2: body regressors",
    "Mean distance of markers (AMD) and of the whole mesh (AVD) from the true body. Ours: three "
    "people of CMU, in the recorded shapes and in random ones.",
    {"amd_mm": "AMD, mm", "avd_mm": "AVD, mm"},
    (
        *(
            Line(name, values, why=LICENCE)
            for name, values in (
                ("HumanEva, male", (3.26, 4.80)),
                ("HumanEva, female", (3.52, 5.52)),
                ("SSM, female", (6.23, 8.24)),
                ("ACCAD, male", (7.99, 9.61)),
                ("ACCAD, female", (11.39, 12.04)),
                ("KIT, male", (3.53, 4.88)),
                ("KIT, female", (3.95, 5.64)),
            )
        ),
        Line("ours: male, recorded shapes", (), regressor_row("male, recorded shapes")),
        Line("ours: male, random shapes", (), regressor_row("male, random shapes")),
        Line("ours: female, recorded shapes", (), regressor_row("female, recorded shapes")),
        Line("ours: female, random shapes", (), regressor_row("female, random shapes")),
        *(
            Line(
                f"the paper's Eq. 2 alone, {how}: male, recorded shapes",
                (),
                regressor_row("male, recorded shapes", f"{file}*"),
                f"{RUNS.format(group)} (its female rows are the shipped regressor's)",
            )
            for how, file, group in (
                ("gradients through the recursions", "regressor_paper", "regressors"),
                ("each pass alone", "regressor_apart", "regressors_apart"),
            )
        ),
        Line("recordings", (), regressor_row("mocap")),
    ),
)

FIG_3: Final = Exhibit(
    "Fig. 3: realism of random motion",
    "100 recorded poses, 10 s each, no search. The paper shows contact scores and its users' "
    "answers in a picture alone, so it has no columns. *auc* stands in for the users: how often a "
    "linear classifier tells 2 s of ours from 2 s of recorded people at the same speed (0.5: it "
    "cannot; 1: always). *contact* is Eq. 11, *strict* judges soles alone, frame by frame.",
    {
        "contact_paper_median": "contact, median",
        "auc": "auc",
        "contact_strict": "strict",
        "slide_cm_s": "slide, cm/s",
        "jerk_m_s3": "jerk, m/s³",
    },
    (
        Line("HuMoR", why=HUMOR),
        Line("ours-e2e", (), END_TO_END, RUNS.format("end_to_end")),
        *(
            Line(f"ours-{name}", (), alike_row(name), RUNS.format("predictors"))
            for name in ("1f", "2f", "reproj-1f", "reproj-2f", "ro-1f", "ro-2f")
        ),
        *(
            Line(f"ours-{name}, short", (), short_row("realism", name), SHORT)
            for name in ("1f", "2f", "ro-1f", "ro-2f")
        ),
        Line("ours: shipped, ro-1f", (), realism_row("ro-1f")),
        Line("ours: shipped, ro-2f", (), realism_row("ro-2f")),
        Line("ours-ro-policy, shipped", (), realism_row("ro-policy")),
        Line("ours: shipped, only reprojected markers", (), realism_row("ro-reproj-2f")),
        Line("ours: shipped, only predicted markers", (), realism_row("ro-pred-2f")),
        Line("recordings", (), realism_row("mocap")),
    ),
)

BODIES: Final = NOT_RUN.format("bodies --extent 6 --starts prior")

A_2: Final = Exhibit(
    "A.2, Fig. S2: influence of the body",
    "A goal 5 m ahead, at most 60 primitives. The paper: ten shapes from -6 to 6 standard "
    "deviations all arrive, in 12 to 53 primitives; of ten poses of VPoser three do not.",
    {"success_075m": "arrive", "steps": "steps", "lost": "no body any more"},
    (
        Line("ten shapes, ±6 σ", (1.0,), bodies_row("mean of shapes"), BODIES),
        Line("the thinnest, -6 σ", (), bodies_row("shape -6.00"), BODIES),
        Line("the largest, 6 σ", (), bodies_row("shape +6.00"), BODIES),
        Line("ten poses of the pose prior", (0.7,), bodies_row("mean of poses"), BODIES),
        Line("ours: -2.5 σ", (), bodies_25_row("shape -2.50")),
        Line("ours: 2.5 σ", (), bodies_25_row("shape +2.50")),
        Line("ours: spread over shapes, ±2.5 σ", (), bodies_25_row("std of shapes")),
        Line("ours: spread over ten recorded poses", (), bodies_25_row("std of poses")),
    ),
)

A_3: Final = Exhibit(
    "A.3: foot skating",
    "900 static bodies, 20 primitives each. MOJO's measure: the share of frames in which both "
    "heels slide, by its limit of 5 mm a frame at 15 fps.",
    {"heel_skating_75mm_s": "skating", "slide_cm_s": "slide, cm/s"},
    (
        Line("GAMMA", (0.064,), skating_row("ro-2f")),
        Line("MOJO", (0.341,), why=MOJO),
        Line("MOJO, second figure", (0.278,), why=MOJO),
        Line(
            "ours: optimisation as MOJO's, fewer bodies",
            (),
            reprojection_row(OPTIMISED),
            NOT_RUN.format("reprojection"),
        ),
        Line(
            "ours: the same bodies, regressor",
            (),
            reprojection_row(REGRESSED),
            NOT_RUN.format("reprojection"),
        ),
        Line("ours: 1-frame model", (), skating_row("ro-1f")),
        Line("ours: policy", (), skating_row("ro-policy")),
        Line("recordings", (0.067,), skating_row("mocap")),
    ),
)

A_4: Final = Exhibit(
    "A.4, Fig. S3: other representations",
    "Eq. 11, and how much rigid parts of the body deform, mm (MOJO's Table 3). The paper's figures "
    "are in a picture alone. The rows *trained alike* had the same data, steps and batch; *single* "
    "ones were not trained on rollouts. HuMoR's features are learned as primitives, as the paper "
    "does. *no body any more*: a marker more than 3 m from the hips. A torso also deforms as its "
    "joints bend, in recordings more than in ours, so by itself a small value proves nothing.",
    {
        "contact_paper_median": "contact, median",
        "deformation_head_mm": "head",
        "deformation_upper_torso_mm": "upper torso",
        "deformation_lower_torso_mm": "lower torso",
        "slide_cm_s": "slide, cm/s",
        "pose_prior": "usual poses (Eq. 8)",
        "lost": "no body any more",
    },
    (
        *(
            Line(name, (), direct_row(row), RUNS.format("direct"))
            for name, row in (
                ("SMPL params, trained alike", "ro-direct-body"),
                ("HuMoR primitive, trained alike", "ro-direct-humor"),
                ("ours-ro-2f, trained alike", "ro-2f"),
                ("SMPL params, single", "direct-body"),
                ("HuMoR primitive, single", "direct-humor"),
                ("ours-2f, single", "2f"),
            )
        ),
        Line("HuMoR", why=HUMOR),
        Line("ours: shipped, ro-1f", (), realism_row("ro-1f")),
        Line("ours: shipped, ro-2f", (), realism_row("ro-2f")),
        Line("recordings", (), realism_row("mocap")),
    ),
)

REPROJECTION: Final = Exhibit(
    "Sec. 3.2.2: the regressor and optimisation",
    "The paper says that its regressor is faster than MOJO's optimisation and as accurate; it has "
    "no figures. Bodies behind the markers of recorded primitives (three people of CMU), and in "
    "random motion of the shipped 2-frame model. Optimisation as in MOJO: gradient descent (Adam) "
    "from the pose before, not at its end after 100 iterations; its frames are handed on as they "
    "are, the regressor's joined to the seed. *ms*: processor time for a primitive of one body, in "
    "batches.",
    {
        "amd_mm": "AMD, mm",
        "avd_mm": "AVD, mm",
        "joint_angle_deg": "joints, °",
        "ms_per_primitive": "ms",
        "slide_cm_s": "slide, cm/s",
        "jerk_m_s3": "jerk, m/s³",
        "seam_ratio": "seam",
        "lost": "no body any more",
    },
    tuple(
        Line(name, (), reprojection_row(name), NOT_RUN.format("reprojection"))
        for name in (REGRESSED, "optimised, 30 iterations", OPTIMISED)
    ),
)

EXHIBITS: Final = (TABLE_1, S1, S2, FIG_3, A_2, A_3, A_4, REPROJECTION)

COMMANDS: Final = {
    "bodies": "wayfarer eval bodies --data PREPARED",
    "predictor": "wayfarer eval predictor --data PREPARED",
    "realism": "wayfarer eval realism --data PREPARED",
    "regressor": "wayfarer eval regressor --data PREPARED",
    "skating": "wayfarer eval skating --data PREPARED",
}
"""Of results of the time before they told their command themselves (docs/results.md)."""

S3: Final = {64: 0.1, 128: 0.15, 256: 0.25, 512: 0.5, 1024: 0.85}
"""Bodies → seconds per primitive (Table S3, one Quadro 6000)."""

PICTURES: Final = {
    "Fig. 1, 2, S4": "show the idea and the networks: docs/architecture.md, docs/models.md",
    "Fig. 5": "trails over training: every training of a policy draws the same 64 trails every "
    "`snapshot_every` epochs into its folder, `snapshots/`; PPO from scratch "
    "[before](images/ppo_trails_000.png) and [after 40 epochs](images/ppo_trails_040.png)",
}
"""Pictures of the paper, and where ours are or why there is none."""

MOTIONS: Final = {
    "fig_4": (
        "Fig. 4: the same body and goal by method",
        "A body each 0.8 s and, in colour, at the end; of 32 clones the one that arrives first or "
        "comes nearest. No search; bodies begin at rest.",
    ),
    "fig_s1": (
        "Fig. S1: six primitives of one seed",
        "The last frame of the seed (green), and of six primitives (red) with the same latents, by "
        "predictor; a predictor that the model lacks is not drawn.",
    ),
    "fig_s2": (
        "Fig. S2: corner cases of shape and pose",
        "A goal 5 m ahead: four shapes from one pose of the pose prior, then the mean shape from "
        "three other poses.",
    ),
    "fig_s3": (
        "Fig. S3: failures of other representations",
        "Of 100 motions of 10 s by each predictor the pose that our pose prior (Eq. 8) finds least "
        "usual; shown are the least usual of these poses, whatever they look like, with the height "
        "of hips that float. Nothing corrects the height of body parameters and HuMoR's features.",
    ),
}
"""Pictures that `wayfarer eval figures` and `failures` make: title, and what they show."""
