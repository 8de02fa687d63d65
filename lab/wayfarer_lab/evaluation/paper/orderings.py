"""The paper's comparisons of its methods, and whether they hold for ours."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, Literal

from wayfarer_lab.evaluation.paper.published import (
    END_TO_END,
    OPTIMISED,
    REGRESSED,
    RUNS,
    SHORT,
    UNTRAINED_PPO,
    alike_row,
    bodies_row,
    control_row,
    direct_row,
    predictor_row,
    realism_row,
    reprojection_row,
    short_row,
    skating_row,
)
from wayfarer_lab.evaluation.paper.results import Measured, ResultsFolder, Source, number

Verdict = Literal[
    "as in the paper", "the other way", "no difference", "within the spread", "not measured"
]


@dataclass(frozen=True)
class Ordering:
    """The paper says that `figure` of `one` is `more` than that of `other`, or less."""

    claim: str
    where: str  # in the paper
    one: Source | None
    other: Source | None
    figure: str
    more: bool = True
    why: str = ""  # when it cannot be measured


@dataclass(frozen=True)
class Statement:
    """What came out of an ordering."""

    verdict: Verdict
    figures: str


def state(ordering: Ordering, results: ResultsFolder) -> Statement:
    """Compares the two rows.

    Rows of several trainings differ when every training of one is beyond every training of the
    other. With one training each there is no spread, and the sign alone decides, which is said.
    """
    sources = (ordering.one, ordering.other)
    rows = [results.measured(source) if source else None for source in sources]
    values = [row.values(ordering.figure) if row else [] for row in rows]
    if not all(values):
        return Statement("not measured", ordering.why or _missing(sources, values))
    one, other = (row for row in rows if isinstance(row, Measured))
    figures = f"`{ordering.figure}` {one.text(ordering.figure)} and {other.text(ordering.figure)}"
    high, low = values if ordering.more else values[::-1]
    if min(high) > max(low):
        verdict: Verdict = "as in the paper"
    elif max(high) < min(low):
        verdict = "the other way"
    elif high == low:
        verdict = "no difference"
    else:
        verdict = "within the spread"
    if max(map(len, values)) == 1:
        figures += "; one training each"
    return Statement(verdict, figures)


def _missing(sources: tuple[Source | None, ...], values: list[list[float]]) -> str:
    names = [s.name for s, v in zip(sources, values, strict=True) if s is not None and not v]
    return f"no result has {' and '.join(repr(name) for name in names)}"


Row = Callable[[str], Source]
ALIKE: Final = "no two that are trained alike: " + RUNS.format("predictors")


def _alike(predictor: Row, motion: Row, why: str, how: str = "") -> tuple[Ordering, ...]:
    """The paper's statements about its four predictors, for ours that are trained alike."""
    return (
        *(
            Ordering(
                f"training on rollouts {does}{how}", "Table S1",
                predictor(f"ro-{frames}f"), predictor(f"{frames}f"), figure, True, why,
            )
            for does, frames, figure in (
                ("makes the 2-frame predictor more diverse", 2, "apd_m"),
                ("costs the 2-frame predictor some accuracy", 2, "ade_m"),
                ("makes the 1-frame predictor more diverse", 1, "apd_m"),
            )
        ),
        *(
            Ordering(
                f"1-frame models are {what} than 2-frame models, {stage} rollouts{how}", where,
                row(f"{ro}1f"), row(f"{ro}2f"), figure, True, why,
            )
            for ro, stage in (("", "without"), ("ro-", "with"))
            for what, figure, where, row in (
                ("more diverse", "apd_m", "Table S1", predictor),
                ("less accurate", "ade_m", "Table S1", predictor),
                ("less continuous", "seam_ratio", "Sec. 4.1", motion),
            )
        ),
    )  # fmt: skip


ORDERINGS: Final = (
    *_alike(predictor_row, alike_row, ALIKE),
    *_alike(
        lambda name: short_row("predictor", name), lambda name: short_row("realism", name),
        SHORT, "; short trainings",
    ),
    Ordering(
        "the regressor is faster than optimisation", "Sec. 3.2.2",
        reprojection_row(REGRESSED), reprojection_row(OPTIMISED), "ms_per_primitive", False,
    ),
    Ordering(
        "the regressor is as accurate as optimisation", "Sec. 3.2.2",
        reprojection_row(REGRESSED), reprojection_row(OPTIMISED), "amd_mm", False,
    ),
    Ordering(
        "of all variants the policy has the best contact", "Fig. 3",
        realism_row("ro-policy"), realism_row("ro-2f"), "contact_paper",
    ),
    Ordering(
        "motion of the policy looks more real than random motion", "Fig. 3 (here: classifier)",
        realism_row("ro-policy"), realism_row("ro-2f"), "auc", False,
    ),
    Ordering(
        "a policy arrives more often than the g-CVAE", "Table 1",
        control_row("policy(10)"), control_row("g-CVAE"), "success", True, UNTRAINED_PPO.format(10),
    ),
    Ordering(
        "a policy has better contact than the g-CVAE", "Table 1",
        control_row("policy(10)"), control_row("g-CVAE"), "contact", True, UNTRAINED_PPO.format(10),
    ),
    Ordering(
        "a policy leaves bodies nearer to the goal than the g-CVAE", "Table 1",
        control_row("policy(10)"), control_row("g-CVAE"), "avg_dist", False,
        UNTRAINED_PPO.format(10),
    ),
    Ordering(
        "with less weight of the KL term, a policy arrives sooner", "Table 1",
        control_row("policy(1)"), control_row("policy(10)"), "steps", False,
        UNTRAINED_PPO.format(1),
    ),
    Ordering(
        "tree search arrives more often than the policy alone: PPO", "Table 1",
        control_row("policy(10) & top1"), control_row("policy(10)"), "success", True,
        UNTRAINED_PPO.format(10),
    ),
    Ordering(
        "tree search arrives sooner than the policy alone: PPO", "Table 1",
        control_row("policy(10) & top1"), control_row("policy(10)"), "steps", False,
        UNTRAINED_PPO.format(10),
    ),
    Ordering(
        "tree search leaves bodies nearer to the goal: PPO", "Table 1",
        control_row("policy(10) & top1"), control_row("policy(10)"), "avg_dist", False,
        UNTRAINED_PPO.format(10),
    ),
    Ordering(
        "tree search has the better contact: PPO", "Table 1",
        control_row("policy(10) & top1"), control_row("policy(10)"), "contact", True,
        UNTRAINED_PPO.format(10),
    ),
    Ordering(
        "to keep four nodes leaves bodies farther from the goal than to keep one: PPO", "Table 1",
        control_row("policy(10) & top4"), control_row("policy(10) & top1"), "avg_dist", True,
        UNTRAINED_PPO.format(10),
    ),
    Ordering(
        "predicted markers alone, without reprojection, jitter more", "Sec. 3.3",
        realism_row("ro-pred-2f"), realism_row("ro-2f"), "jerk_m_s3",
    ),
    Ordering(
        "predicted markers alone add up their errors: rigid parts deform", "Sec. 3.3",
        realism_row("ro-pred-2f"), realism_row("ro-2f"), "carried_deformation_mm",
    ),
    Ordering(
        "reprojected markers alone lose bodies that blended ones keep", "Sec. 3.3",
        realism_row("ro-reproj-2f"), realism_row("ro-2f"), "lost",
    ),
    Ordering(
        "blending reprojected markers with predicted ones slides less than reprojected ones alone",
        "Sec. 3.3, Fig. 3", realism_row("ro-2f"), realism_row("ro-reproj-2f"), "slide_cm_s", False,
    ),
    Ordering(
        "end-to-end training does not better the contact", "Fig. 3, B.1",
        alike_row("ro-2f"), END_TO_END, "contact_paper", True, RUNS.format("end_to_end"),
    ),
    Ordering(
        "body shape matters less than the start pose: spread of steps", "A.2",
        bodies_row("std of shapes"), bodies_row("std of poses"), "steps", False,
    ),
    Ordering(
        "some start poses do not arrive, while all shapes do", "A.2",
        bodies_row("mean of poses"), bodies_row("mean of shapes"), "success_075m", False,
    ),
    Ordering(
        "feet skate no more than in recordings", "A.3",
        skating_row("ro-2f"), skating_row("mocap"), "heel_skating_75mm_s", False,
    ),
    *(
        Ordering(
            f"marker primitives deform less than those of {what}: {part} torso", "A.4, Fig. S3",
            direct_row("ro-2f"), direct_row(f"ro-direct-{name}"), f"deformation_{part}_torso_mm",
            False, RUNS.format("direct"),
        )
        for what, name in (("body parameters", "body"), ("HuMoR's features", "humor"))
        for part in ("upper", "lower")
    ),
)  # fmt: skip
"""In the order of benchmarks/results/paper.md."""

MOJO_SKATING: Final = 0.278
"""The better of MOJO's two figures (its Table 4), as the paper quotes it."""


def against_mojo(results: ResultsFolder) -> str:
    """One sentence: our skating beside MOJO's published figure."""
    row = results.measured(skating_row("ro-2f"))
    values = row.values("heel_skating_75mm_s") if row else []
    if not values:
        return "No result of `wayfarer eval skating` is there to hold against MOJO's."
    less = "less" if max(values) < MOJO_SKATING else "not less"
    return (
        f"Our feet skate {less} than MOJO's published ones: {number(max(values))} against "
        f"{MOJO_SKATING}, on other data."
    )
