"""Scenarios of `wayfarer eval arrival`: goals, and the row that measures them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import cos, pi, radians, sin
from typing import Final

import numpy as np

from wayfarer.spec import STEP_SECONDS
from wayfarer.world.agents.agent import AgentInfo
from wayfarer.world.agents.goal import Goal
from wayfarer_lab.evaluation import goal_rows
from wayfarer_lab.evaluation.gait import Row
from wayfarer_lab.evaluation.goals import Course, Errand, Order, Plan, random_specs, relative
from wayfarer_lab.evaluation.outcome import STAND_SECONDS, STEP_LIMIT, goal_row, judge

DISTANCE: Final = (3.0, 8.0)
"""Metres to a goal whose arrival is measured."""

SLACK: Final = 6.0
"""Seconds after the 60 primitives in which a late stand can still begin."""

NEAR: Final = 1.5
"""Metres to a near goal."""

SPEEDS: Final = (0.6, 0.8, 1.0, 1.2, 1.4, 1.6)
RUNS: Final = (2.0, 2.5, 3.0)
"""Target speeds, m/s; the goal is 12 m away, and for runs 8 s of running."""

LEG: Final = 4.0
"""Metres between waypoints."""

Orders = Callable[[np.random.Generator], tuple[Order, ...]]
"""Makes the orders of one agent, with random sides."""


@dataclass(frozen=True)
class Scenario:
    """One row: agents that stand and then get these orders."""

    name: str
    seconds: float  # from the first order
    orders: Orders
    row: Callable[[str, Sequence[Course]], Row]

    def errands(self, agents: int, random: np.random.Generator) -> list[Errand]:
        """Random people with their orders."""
        return [Errand(spec, self.orders(random)) for spec in random_specs(agents, random)]


def arrival(name: str, walking: bool = False, facing: bool = False) -> Scenario:
    """A goal 3 … 8 m away in a random direction; with `walking`, after 2 s on the way straight
    ahead; with `facing`, a random heading is asked for at the goal.
    """
    start = 2.0 if walking else 0.0

    def orders(random: np.random.Generator) -> tuple[Order, ...]:
        angle, distance = float(random.uniform(0, 360)), float(random.uniform(*DISTANCE))
        heading = float(random.uniform(-pi, pi)) if facing else None
        there = Order(start, lambda agent: [Goal(_place(agent, angle, distance), heading=heading)])
        return (Order(0.0, _at(0.0, 20.0)), there) if walking else (there,)

    def row(name: str, courses: Sequence[Course]) -> Row:
        return goal_row(name, [judge(course) for course in courses])

    seconds = start + STEP_LIMIT * STEP_SECONDS + SLACK + STAND_SECONDS
    return Scenario(name, seconds, orders, row)


def maneuver_tables() -> dict[str, list[Scenario]]:
    """Manoeuvres, as titled tables."""
    return {
        "Near goals (1.5 m, from standing)": [
            _near("ahead", 0.0), _near("left", 90.0), _near("right", -90.0), _near("behind", 180.0)
        ],
        "Speed": [_speed(speed) for speed in (*SPEEDS, *RUNS)],
        "Turn on the spot": [_turn(angle) for angle in (90.0, 180.0)],
        "Waypoints passed through": [_waypoints(bend) for bend in (0.0, 45.0, 90.0)],
        "New goal while walking": [_change("behind", 180.0), _change("beside", 90.0)],
        "Strafing": [_strafe("sideways", 90.0), _strafe("backwards", 180.0)],
    }  # fmt: skip


def _near(name: str, angle: float) -> Scenario:
    orders = (Order(0.0, _at(angle, NEAR)),)
    return Scenario(name, 12.0, lambda random: orders, goal_rows.near_row)


def _speed(speed: float) -> Scenario:
    distance = max(12.0, 8.0 * speed)
    orders = (Order(0.0, _at(0.0, distance, speed=speed)),)
    return Scenario(f"{speed:g} m/s", 12.0, lambda random: orders, goal_rows.speed_row)


def _turn(angle: float) -> Scenario:
    def orders(random: np.random.Generator) -> tuple[Order, ...]:
        turn = radians(angle) * random.choice([-1, 1])
        return (Order(0.0, lambda agent: [_here(agent, float(agent.heading + turn))]),)

    return Scenario(f"{angle:g}°", 8.0, orders, goal_rows.turn_row)


def _waypoints(bend: float) -> Scenario:
    def orders(random: np.random.Generator) -> tuple[Order, ...]:
        side = float(random.choice([-1, 1]))
        return (Order(0.0, lambda agent: _zigzag(agent, radians(bend) * side)),)

    return Scenario(f"bends of {bend:g}°", 18.0, orders, goal_rows.waypoint_row)


def _change(name: str, angle: float) -> Scenario:
    def orders(random: np.random.Generator) -> tuple[Order, ...]:
        side = float(random.choice([-1, 1]))
        return Order(0.0, _at(0.0, 12.0)), Order(3.0, _at(angle * side, 4.0))

    return Scenario(name, 15.0, orders, goal_rows.change_row)


def _strafe(name: str, angle: float) -> Scenario:
    def orders(random: np.random.Generator) -> tuple[Order, ...]:
        side = float(random.choice([-1, 1]))

        def plan(agent: AgentInfo) -> list[Goal]:
            there = _place(agent, angle * side, 3.0)
            return [Goal(there, speed=0.6, heading=agent.heading, strafe=True)]

        return (Order(0.0, plan),)

    return Scenario(name, 12.0, orders, goal_rows.strafe_row)


def _at(angle: float, metres: float, speed: float = 1.2) -> Plan:
    """One goal `metres` away, `angle` degrees to the left of straight ahead."""
    return lambda agent: [Goal(_place(agent, angle, metres), speed=speed)]


def _place(agent: AgentInfo, angle: float, metres: float) -> tuple[float, float, float]:
    return relative(agent, metres * cos(radians(angle)), metres * sin(radians(angle)))


def _here(agent: AgentInfo, heading: float) -> Goal:
    """The agent's own place, facing another way."""
    x, y, _ = agent.position
    return Goal((x, y, 0.0), heading=(heading + pi) % (2 * pi) - pi)


def _zigzag(agent: AgentInfo, bend: float) -> list[Goal]:
    """Three waypoints and a goal, the legs turned by `bend` to one side and back in turn."""
    x, y, _ = agent.position
    path = []
    for number in range(4):
        way = agent.heading + bend * (number % 2)
        x, y = x - LEG * sin(way), y + LEG * cos(way)
        path.append(Goal((x, y, 0.0), stop=number == 3))
    return path
