"""What people are asked to do, which figures are taken, and how recorded stretches are found."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Final

from wayfarer_lab.evaluation.takes import Take
from wayfarer_lab.evaluation.twosided import figures, stretches
from wayfarer_lab.evaluation.twosided.figures import Values

UPPER: Final = frozenset(
    {
        "elbow_deg", "arm_out_deg", "arm_out_p95_deg", "wrist_cm", "trunk_deg", "arm_leg",
        "twist_deg", "head_yaw_deg", "head_pitch_deg", "power_6_10", "head_bob_cm",
        "head_lead_deg", "head_in_deg", "arm_up", "hands_cm_s", "head_cm_s", "still_share",
        "lean_share",
    }
)  # fmt: skip
"""Figures of arms, head and trunk: acted styles say nothing of them."""

ALIKE: Final = frozenset({"still_share", "arm_up", "footfalls", "shifts_min"})
"""Shares and counts that are nought for many people: no spread is asked for."""

REPORTED: Final = frozenset({"slide_cm_s"})
"""Figures that are shown and do not count: a statue slides nowhere."""

REACHED: Final = (0.9, 1.1)
"""Shares of a speed that is asked for, between which the speed of people has to lie."""

STAIRS: Final = {
    "knee_deg": (30.0, 55.0),
    "knee_least_deg": (0.0, 25.0),
    "knee_p95_deg": (75.0, 102.0),
    "steps_per_riser": (0.95, 1.05),
}
"""On stairs, of which there are no recordings: ranges of the literature (motion review 3), and a
step for each riser."""

SIDE, BACK, CURVE = 1.0, 0.9, 1.2
"""Metres per second that are asked for."""

RADIUS: Final = 2.0
"""Metres, of the curve."""

Find = Callable[[Take, stretches.Uses], Iterator[Take]]


@dataclass(frozen=True)
class Situation:
    """One thing that people do. `find` cuts recorded stretches; `measure` gives their figures."""

    name: str
    measure: Callable[[Take], Values]
    find: Find
    given: dict[str, tuple[float, float]] = field(default_factory=dict)
    # ranges that recordings do not give, from the literature or a person's word
    acted: bool = False  # legs of acted styles count: too few walk so without


def _asked(speed: float) -> dict[str, tuple[float, float]]:
    return {"speed_mps": (REACHED[0] * speed, REACHED[1] * speed)}


SITUATIONS: Final[dict[str, Situation]] = {
    situation.name: situation
    for situation in (
        Situation("stand", figures.standing, stretches.stands, {"shifts_min": (0.5, 20.0)}),
        Situation("walk 1.0", figures.walking, stretches.walks(0.85, 1.15), _asked(1.0)),
        Situation("walk 1.2", figures.walking, stretches.walks(1.05, 1.35), _asked(1.2)),
        Situation("walk 1.5", figures.walking, stretches.walks(1.35, 1.65), _asked(1.5)),
        Situation("start", figures.starting, stretches.starts),
        Situation("stop", figures.stopping, stretches.stops),
        Situation("side", figures.strafing, stretches.sideways, _asked(SIDE), acted=True),
        Situation("back", figures.strafing, stretches.backward, _asked(BACK), acted=True),
        Situation("turn", figures.turning, stretches.turns),
        Situation("curve", figures.curving, stretches.curves, _asked(CURVE)),
        Situation("turn back", figures.turning_back, stretches.turns_back, {"arm_up": (0.0, 0.01)}),
        Situation("stairs up", figures.climbing, stretches.nowhere, STAIRS),
        Situation("stairs down", figures.climbing, stretches.nowhere, STAIRS),
    )
}
