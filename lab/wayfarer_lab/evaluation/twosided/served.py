"""The same situations in the world that serves: orders, and what is measured of them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import cos, radians, sin
from typing import Final

import numpy as np

from wayfarer.spec import FPS
from wayfarer.world.agents.agent import AgentInfo
from wayfarer.world.agents.goal import Goal
from wayfarer_lab.evaluation.figures import first
from wayfarer_lab.evaluation.goals import Errand, Order, Plan, random_specs, relative
from wayfarer_lab.evaluation.maneuvers.maneuver import Case, Shot, facing, part, way_to
from wayfarer_lab.evaluation.maneuvers.stairs import STAIRS, on_the_stairs
from wayfarer_lab.evaluation.takes import Take
from wayfarer_lab.evaluation.twosided.situations import BACK, CURVE, SIDE, SITUATIONS
from wayfarer_lab.evaluation.twosided.verdicts import Person
from wayfarer_lab.evaluation.twosided.wishes import RADIUS, median_values

PEOPLE: Final = 8
"""Of each order."""

SECONDS: Final = 12.0
STAND_SECONDS: Final = 30.0
STEADY: Final = 4.0
"""Seconds from the order on in which somebody may set off."""

TURNS: Final = (0.0, 4.0, 8.0)
BACKS: Final = (0.0, 2.0, 4.0, 6.0, 8.0, 10.0)
"""Seconds of the orders to turn, and to turn back."""

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

    def people(self, shots: Sequence[Shot]) -> list[Person]:
        """Figures of each person in each situation."""
        return [
            Person(
                name, shot.take.name, median_values([SITUATIONS[name].measure(p) for p in parts])
            )
            for shot in shots
            for name, parts in self.parts(shot.take).items()
        ]


def _case(name: str, seconds: float, orders: Callable[[int], tuple[Order, ...]]) -> Case:
    def errands(agents: int, random: np.random.Generator) -> list[Errand]:
        specs = random_specs(agents, random)
        return [Errand(spec, orders(number)) for number, spec in enumerate(specs)]

    return Case(name, seconds, errands)


def _goes(name: str, plan: Callable[[int], Plan], *, starts: bool = False) -> Served:
    """One order, of which the steady part is measured; `plan` by the agent's number."""

    def parts(take: Take) -> dict[str, list[Take]]:
        found = {name: [part(take, STEADY, SECONDS)]}
        return found | ({"start": [part(take, 0.0, 3.5)]} if starts else {})

    return Served(_case(name, SECONDS, lambda number: (Order(0.0, plan(number)),)), parts)


def _walks(name: str, speed: float, *, starts: bool = False) -> Served:
    return _goes(name, lambda number: way_to(0.0, 16.0 * speed, speed), starts=starts)


def _strafes(name: str, angles: tuple[float, ...], speed: float) -> Served:
    """To `angles` in turn, facing ahead."""

    def plan(number: int) -> Plan:
        def goals(agent: AgentInfo) -> list[Goal]:
            angle = angles[number % len(angles)]
            way = way_to(angle, 16.0 * speed, speed, heading=agent.heading, strafe=True)
            return list(way(agent))

        return goals

    return _goes(name, plan)


def _circles(number: int) -> Plan:
    """A circle, to the left and to the right in turn, as goals that are passed through."""
    side = (-1) ** number

    def goals(agent: AgentInfo) -> list[Goal]:
        found = []
        for degrees in range(30, 30 * 18, 30):
            angle = radians(degrees)
            place = relative(agent, RADIUS * sin(angle), side * RADIUS * (1 - cos(angle)))
            found.append(Goal(place, speed=CURVE, stop=False))
        return found

    return goals


def _turn(number: int, order: int, angle: float) -> Plan:
    return lambda agent: [facing(agent, angle * (-1) ** (number + order))]


def _turned(take: Take) -> dict[str, list[Take]]:
    """Each turn, from its order to a little after it is done."""
    found = []
    for start in TURNS:
        whole = part(take, start, start + TURNS[1])
        turned = np.abs(whole.heading - whole.heading[0])
        done = first(turned >= 0.9 * turned[-1]) if turned[-1] > SMALL else None
        found.append(whole if done is None else whole[: done + round(TURN_ENDS * FPS)])
    return {"turn": found}


def _turns(angle: float) -> Served:
    def orders(number: int) -> tuple[Order, ...]:
        return tuple(Order(at, _turn(number, k, angle)) for k, at in enumerate(TURNS))

    return Served(_case(f"turn {angle:g}", SECONDS, orders), _turned)


def _stairs(case: Case) -> Served:
    name = f"stairs {case.name}"

    def parts(take: Take) -> dict[str, list[Take]]:
        climb = on_the_stairs(take)
        return {name: [take if climb is None else take[climb]]}

    return Served(Case(name, case.seconds, case.errands, case.scene, 0.75), parts)


def _stands(take: Take) -> dict[str, list[Take]]:
    return {"stand": [take]}


def _stops(take: Take) -> dict[str, list[Take]]:
    return {"stop": [part(take, 2.0, SECONDS)]}


def _turned_back(take: Take) -> dict[str, list[Take]]:
    return {"turn back": [part(take, start, start + BACKS[1]) for start in BACKS[1:]]}


SERVED: Final[tuple[Served, ...]] = (
    Served(_case("stand", STAND_SECONDS, lambda number: ()), _stands),
    _walks("walk 0.9", 0.9),
    _walks("walk 1.2", 1.2, starts=True),
    _walks("walk 1.5", 1.5),
    _strafes("side", (90.0, -90.0), SIDE),
    _strafes("back", (180.0,), BACK),
    _turns(90.0),
    _turns(180.0),
    Served(
        _case(
            "turn back",
            SECONDS,
            lambda number: tuple(Order(at, way_to(180.0, 3.0)) for at in BACKS),
        ),
        _turned_back,
    ),
    _goes("curve", _circles),
    Served(_case("stop", SECONDS, lambda number: (Order(0.0, way_to(0.0, 5.0)),)), _stops),
    *(_stairs(case) for case in STAIRS.cases),
)
