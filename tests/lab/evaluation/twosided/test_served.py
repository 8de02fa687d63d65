"""Commands of the service: bodies glided by the fake engine, as sent and raw."""

from dataclasses import dataclass

import numpy as np
import pytest

from tests.lab.evaluation.maneuvers.bodies import shot, take, time
from tests.lab.evaluation.people import ANNY, gliding_bundle
from wayfarer.spec import FPS
from wayfarer.world.agents.agent import AgentInfo
from wayfarer_lab.evaluation.commands.shared import progress
from wayfarer_lab.evaluation.maneuvers.case_runner import CaseRunner
from wayfarer_lab.evaluation.maneuvers.repair import ALL
from wayfarer_lab.evaluation.twosided import ranges
from wayfarer_lab.evaluation.twosided.compare import compare, show
from wayfarer_lab.evaluation.twosided.served import SERVED, Served
from wayfarer_lab.evaluation.twosided.situations import SITUATIONS

BY_NAME = {served.case.name: served for served in SERVED}


@dataclass
class Standing:
    """An agent at the origin that faces +Y, as far as plans look at it."""

    position: tuple[float, float, float] = (0.0, 0.0, 0.0)
    heading: float = 0.0


def goals(served: Served, number: int = 0) -> np.ndarray:
    task = served.case.tasks(2, np.random.default_rng(0))[number]
    agent: AgentInfo = Standing()  # type: ignore[assignment]
    return np.array([goal.position[:2] for goal in task.orders[0].plan(agent)])


def test_every_situation_is_served() -> None:
    made = take(30.0)
    found = {name for served in SERVED for name in served.parts(made)}
    assert found == set(SITUATIONS)


@pytest.mark.parametrize(("number", "side"), [(0, -1), (1, 1)])
def test_a_curve_is_a_circle_of_2_m(number: int, side: int) -> None:
    places = goals(BY_NAME["curve"], number)
    assert np.linalg.norm(places - [side * 2.0, 0], axis=-1) == pytest.approx(2.0)
    assert places[0, 1] > 0.9, "it begins ahead"


def test_nobody_arrives_who_is_to_walk_steadily() -> None:
    for name, speed in (("walk 1.0", 1.0), ("walk 1.5", 1.5), ("side", 1.0), ("back", 0.9)):
        assert np.linalg.norm(goals(BY_NAME[name])[0]) > speed * 14, name


def test_turns_are_measured_until_a_little_after_they_are_done() -> None:
    t = time(12.0)
    made = take(12.0, heading=90 * np.clip((t - 0.5) / 1.0, 0, 1))
    parts = BY_NAME["turn 90"].parts(made)["turn"]
    assert len(parts[0]) == pytest.approx((1.4 + 0.7) * FPS, abs=2) and len(parts[1]) == 4 * FPS
    [person] = BY_NAME["turn 90"].people([shot(made)])
    assert (
        person.values["peak_deg_s"] == pytest.approx(0, abs=0.1)
        or person.values["lifts_per_90"] == 0
    )


def test_sent_and_raw_are_judged_beside_each_other_and_repair_is_told() -> None:
    runner = CaseRunner(gliding_bundle(ANNY), candidates=1, seed=3)
    sent, raw = sides = compare(runner, ranges.load(), 2, 2, progress, (BY_NAME["start"],))
    assert [side.source for side in sides] == ["sent", "raw"]
    assert len(sent.people) == len(raw.people) == 4, "those of both seeds"
    assert {v.situation for v in sent.verdicts} == {"start"}
    assert sent.repair[ALL]["cm_p95"] > 0 and "foot lock" in sent.repair and not raw.repair
    assert sent.people[0].values != sent.people[2].values, "each seed has its own people"
    row = sent.row()
    assert row["of"] == len([v for v in sent.verdicts if v.counts]) and row["holds"] <= row["of"]
    show(sides)
