"""Short ways: a goal 1.5 m away on any side, and paths with bends that are passed through."""

from collections.abc import Callable, Sequence
from math import cos, nan, radians, sin
from typing import Final

import numpy as np

from wayfarer.spec import FPS
from wayfarer.world.agents.agent import AgentInfo
from wayfarer.world.agents.goal import Goal
from wayfarer_lab.evaluation.figures import distances, first, smooth_speed
from wayfarer_lab.evaluation.maneuvers.maneuver import (
    Bar,
    Figures,
    Maneuver,
    MeasuredTake,
    Request,
    case,
    spread,
    way_to,
)
from wayfarer_lab.evaluation.maneuvers.walk import BRAKING, SPEEDING
from wayfarer_lab.evaluation.tasks import Plan

SIDES: Final = (0.0, 90.0, -90.0, 180.0)
"""Degrees to the left of straight ahead at which a near goal lies, in turn."""

LEG: Final = 4.0
"""Metres between waypoints; three of them come before the goal."""

BENDS: Final = {"straight": 0.0, "bends of 45°": 45.0, "bends of 90°": 90.0}
"""Degrees by which the legs turn to one side and back."""

ARRIVED: Final = 0.3
"""Metres from the goal."""

DIP: Final = FPS
"""Frames on either side of a waypoint in which the speed may dip: 1 s."""

FIGURES: Final = ("arrive", "arrive_s", "passed", "missed_by_m", "speed_kept")


def _zigzag(bend: float) -> Callable[[Request], Plan]:
    def goals(agent: AgentInfo, side: int) -> list[Goal]:
        (x, y, _), path = agent.position, []
        for number in range(4):
            way = agent.heading + side * radians(bend) * (number % 2)
            x, y = x - LEG * sin(way), y + LEG * cos(way)
            path.append(Goal((x, y, 0.0), stop=number == 3))
        return path

    return lambda request: lambda agent: goals(agent, (-1) ** request.agent)


def measure_path(shot: MeasuredTake) -> Figures:
    """Arrival at the last goal; a recorded take has none, and a near goal has no waypoint."""
    hips, figures = shot.take.hips, dict.fromkeys(FIGURES, nan)
    if shot.goal is None:
        return figures
    away = np.stack([distances(hips, np.array(goal)) for goal in shot.take.clip.goals])
    arrival = first(away[-1] <= ARRIVED)
    figures["arrive"] = float(arrival is not None)
    figures["arrive_s"] = nan if arrival is None else arrival / FPS
    end = first(away[-1] <= BRAKING) or len(hips)
    away, time, speed = away[:-1, :end], np.arange(end), smooth_speed(hips)[:end]
    if len(away):
        passing = np.abs(time - away.argmin(-1)[:, None]) <= DIP
        between = speed[(time >= SPEEDING) & ~passing.any(0)]
        figures["passed"] = float((away.min(-1) <= shot.goal.radius).mean())
        figures["missed_by_m"] = float(away.min(-1).mean())
        if len(between):
            slowest = np.mean([speed[around].min() for around in passing])
            figures["speed_kept"] = float(slowest / np.median(between))
    return figures


def path_row(shots: Sequence[MeasuredTake], each: Sequence[Figures]) -> Figures:
    """Means over agents, of the time to arrive also the 90th percentile."""
    means = {name: f"mean of {name}" for name in FIGURES}
    return spread(each, **means, arrive_s_p90="p90 of arrive_s")


PATH: Final = Maneuver(
    name="path",
    about="1.5 m ahead, left, right and behind in turn; paths of four legs, with bends in them",
    agents=24,
    cases=(
        case("1.5 m away", 12.0, lambda it: way_to(SIDES[it.agent % len(SIDES)], 1.5)),
        *(case(name, 18.0, _zigzag(bend)) for name, bend in BENDS.items()),
    ),
    measure=measure_path,
    row=path_row,
    bars=(
        Bar("arrive", low=0.95),
        *(Bar("passed", low=0.95, case=name) for name in BENDS),
    ),
    worst="missed_by_m",
)
