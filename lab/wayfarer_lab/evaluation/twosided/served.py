"""The situations in the world that serves: orders, and what is measured of them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import cos, radians, sin
from typing import Final

import numpy as np

from wayfarer.spec import FPS
from wayfarer.world.agents.agent import AgentInfo
from wayfarer.world.agents.goal import Goal
from wayfarer_lab.evaluation.figures import first
from wayfarer_lab.evaluation.maneuvers.maneuver import (
    Case,
    MeasuredTake,
    Request,
    case,
    part,
    strafe_to,
    way_to,
)
from wayfarer_lab.evaluation.maneuvers.stairs import STAIRS, on_the_stairs
from wayfarer_lab.evaluation.maneuvers.turn import to_either_side
from wayfarer_lab.evaluation.takes import Take
from wayfarer_lab.evaluation.tasks import Plan, relative
from wayfarer_lab.evaluation.twosided.figures import Values
from wayfarer_lab.evaluation.twosided.situations import BACK, CURVE, RADIUS, SIDE, SITUATIONS
from wayfarer_lab.evaluation.twosided.verdicts import Person

PEOPLE: Final = 8
"""Number of people of each order."""

SECONDS: Final = 12.0
STAND_SECONDS: Final = 30.0
STEADY: Final = 4.0
"""Seconds from the order on in which somebody may set off."""

START: Final = 2.5
"""Seconds of standing before the order to walk."""

TURN_EVERY: Final = 4.0
BACK_EVERY: Final = 2.0
"""Seconds from one order to turn, or to turn back, to the next."""

TURN_ENDS: Final = 0.7
"""Seconds after nine tenths of a turn to which it is measured."""

SMALL: Final = 5.0
"""Degrees: less is no turn."""

Parts = Callable[[Take], dict[str, list[Take]]]
"""Stretches of a take, by the situation that they belong to."""


@dataclass(frozen=True)
class Served:
    """An order of the service, and what is measured of it."""

    case: Case
    parts: Parts

    def people(self, shots: Sequence[MeasuredTake]) -> list[Person]:
        """Figures of each person in each situation."""
        return [
            Person(
                name, shot.take.name, median_values([SITUATIONS[name].measure(p) for p in parts])
            )
            for shot in shots
            for name, parts in self.parts(shot.take).items()
        ]


def median_values(rows: Sequence[Values]) -> Values:
    """Each figure's median over rows that have it; NaN left out."""
    found: Values = {}
    for figure in dict.fromkeys(name for row in rows for name in row):
        known = [row[figure] for row in rows if np.isfinite(row.get(figure, np.nan))]
        found[figure] = float(np.median(known)) if known else float("nan")
    return found


def _goes(name: str, plan: Callable[[Request], Plan]) -> Served:
    """One order, of which the steady part is measured."""
    return Served(case(name, SECONDS, plan), lambda take: {name: [part(take, STEADY, SECONDS)]})


def _walks(name: str, speed: float) -> Served:
    return _goes(name, lambda request: way_to(0.0, 16.0 * speed, speed))


def _strafes(name: str, angles: tuple[float, ...], speed: float) -> Served:
    """Strafes to `angles` in turn, facing ahead."""
    return _goes(name, lambda it: strafe_to(angles[it.agent % len(angles)], 16.0 * speed, speed))


def _circles(request: Request) -> Plan:
    """A circle, to the left and to the right in turn, as goals that are passed through."""
    side = (-1) ** request.agent

    def goals(agent: AgentInfo) -> list[Goal]:
        found = []
        for degrees in range(30, 30 * 18, 30):
            angle = radians(degrees)
            place = relative(agent, RADIUS * sin(angle), side * RADIUS * (1 - cos(angle)))
            found.append(Goal(place, speed=CURVE, stop=False))
        return found

    return goals


def _turned(take: Take) -> dict[str, list[Take]]:
    """Each turn, from its order to a little after it is done."""
    found = []
    for start in np.arange(0.0, SECONDS, TURN_EVERY):
        whole = part(take, start, start + TURN_EVERY)
        turned = np.abs(whole.heading - whole.heading[0])
        done = first(turned >= 0.9 * turned[-1]) if turned[-1] > SMALL else None
        found.append(whole if done is None else whole[: done + round(TURN_ENDS * FPS)])
    return {"turn": found}


def _turns(angle: float) -> Served:
    turns = case(f"turn {angle:g}", SECONDS, to_either_side(angle), every=TURN_EVERY)
    return Served(turns, _turned)


def _stairs(climbs: Case) -> Served:
    name = f"stairs {climbs.name}"

    def parts(take: Take) -> dict[str, list[Take]]:
        climb = on_the_stairs(take)
        return {name: [take if climb is None else take[climb]]}

    return Served(replace(climbs, name=name, share=0.75), parts)


def _sets_off(request: Request) -> Plan:
    """Stays, then walks: recorded starts have the moment before, too."""
    return way_to(0.0, 16.0 if request.order else 0.0)


def _started(take: Take) -> dict[str, list[Take]]:
    return {"start": [part(take, START - 1.0, START + 2.5)]}


def _stands(take: Take) -> dict[str, list[Take]]:
    return {"stand": [take]}


def _stops(take: Take) -> dict[str, list[Take]]:
    return {"stop": [part(take, 2.0, SECONDS)]}


def _turned_back(take: Take) -> dict[str, list[Take]]:
    starts = np.arange(BACK_EVERY, SECONDS, BACK_EVERY)
    return {"turn back": [part(take, start, start + BACK_EVERY) for start in starts]}


SERVED: Final[tuple[Served, ...]] = (
    Served(case("stand", STAND_SECONDS), _stands),
    _walks("walk 1.0", 1.0),
    _walks("walk 1.2", 1.2),
    _walks("walk 1.5", 1.5),
    Served(case("start", 2 * START, _sets_off, every=START), _started),
    _strafes("side", (90.0, -90.0), SIDE),
    _strafes("back", (180.0,), BACK),
    _turns(90.0),
    _turns(180.0),
    Served(
        case("turn back", SECONDS, lambda request: way_to(180.0, 3.0), every=BACK_EVERY),
        _turned_back,
    ),
    _goes("curve", _circles),
    Served(case("stop", SECONDS, lambda request: way_to(0.0, 5.0)), _stops),
    *(_stairs(climbs) for climbs in STAIRS.cases),
)
