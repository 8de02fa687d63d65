"""Settings and problems of a search."""

import math
from collections.abc import Sequence

import numpy as np
import pytest

from tests.world.fakes import FakeEngine, make_world, people
from tests.world.search.walkers import Walker, standing
from wayfarer.errors import InvalidArgument
from wayfarer.world.agents.goal import Goal
from wayfarer.world.search.beam import grow
from wayfarer.world.search.beam_settings import CLONES, BeamSettings
from wayfarer.world.search.problem import PlanningProblem


@pytest.mark.parametrize(
    ("field", "values"),
    [
        ("children", {"children": 0}),
        ("keep", {"keep": 0}),
        ("depth", {"depth": -1}),
        ("roots", {"roots": 0}),
        ("children", {"children": 5000}),
        ("children", {"roots": 5000}),
        ("keep", {"children": 1, "keep": 4, "roots": 3}),
        ("until", {"until": "sunset"}),
        ("reach", {"reach": 0.0}),
        ("reach", {"reach": math.nan}),
        ("memory", {"memory": 1.5}),
        ("policy", {"policy": -0.1}),
        ("temperature", {"temperature": -1.0}),
        ("weights.grace", {"weights": {"grace": 1.0}}),
        ("weights.skating", {"weights": {"skating": -1.0}}),
        ("tolerances.grace", {"tolerances": {"grace": 1.0}}),
        ("limits.grace", {"limits": {"grace": 1.0}}),
        ("limits.skating", {"limits": {"skating": math.nan}}),
    ],
)
def test_silly_settings_are_refused_by_name(field, values):
    with pytest.raises(InvalidArgument, match=field.split(".")[-1]) as refused:
        BeamSettings(**values)
    assert refused.value.field == field


def test_the_papers_rows_try_32_primitives_at_every_level():
    for top, kept in ((0, CLONES), (1, 1), (4, 4)):
        engine = FakeEngine()
        [tree] = grow(engine, standing(1), BeamSettings.paper(top, depth=3))
        assert [rows for _, rows, _ in engine.calls] == [CLONES] * 3
        assert [len(level.parent) for level in tree.levels] == [kept] * 3
    with pytest.raises(InvalidArgument, match="divisor of 32"):
        BeamSettings.paper(5)
    assert BeamSettings.paper(4, policy=0.0).policy == 0.0


def test_without_search_the_papers_motions_go_side_by_side():
    """No motion is discarded, and each is drawn at random at every step."""
    drawn: list[np.ndarray] = []

    class Listener(Walker):
        def step(self, gender, inputs):
            drawn.append(inputs.noise)
            return super().step(gender, inputs)

    [tree] = grow(Listener(), standing(1), BeamSettings.paper(depth=4))
    assert len({tree.plan(leaf).translation[0].tobytes() for leaf in range(CLONES)}) == CLONES
    noise = np.concatenate(drawn)[:, 0]
    assert len(np.unique(noise, axis=0)) == 4 * CLONES and noise.any(-1).all()


@pytest.mark.parametrize(
    ("specs", "motions", "paths"), [(2, 1, 2), (2, 2, 1), (1, 2, 2), (0, 0, 0)]
)
def test_lists_of_unequal_length_are_refused(specs, motions, paths):
    made = people(2)
    prepared = make_world().prepare(made)
    goals: Sequence[Sequence[Goal]] = [[Goal((0.0, 1.0, 0.0))]] * 2
    with pytest.raises(InvalidArgument, match="one of each"):
        PlanningProblem.of(made[:specs], prepared[:motions], goals[:paths])


def test_a_bad_goal_is_refused():
    specs = people(1)
    with pytest.raises(InvalidArgument, match=r"goals\[0\]\.radius"):
        PlanningProblem.of(
            specs, make_world().prepare(specs), [[Goal((0.0, 1.0, 0.0), radius=-1.0)]]
        )
