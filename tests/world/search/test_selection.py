"""Selection of a level's nodes: prices, tolerances, limits, ties."""

from dataclasses import replace

import numpy as np

from tests.world.fakes import FakeEngine
from tests.world.search.walkers import TERM, standing
from wayfarer.world.search.beam import grow, select
from wayfarer.world.search.beam_settings import HARD, BeamSettings


def priced(*prices: float) -> FakeEngine:
    """Children cost these amounts of skating in turn, whatever their latents."""

    class Priced(FakeEngine):
        def step(self, gender, inputs):
            outputs = super().step(gender, inputs)
            outputs.terms[:, TERM["skating"]] = np.resize(prices, len(outputs.terms))
            outputs.terms[:, TERM["goal_distance"]] = 1 - outputs.terms[:, TERM["skating"]]
            return outputs

    return Priced()


def test_what_a_term_has_below_its_tolerance_is_free():
    weights = {"skating": 1.0, "goal_distance": 0.01}
    settings = BeamSettings(3, keep=3, roots=3, depth=1, weights=weights)
    [strict] = grow(priced(0.04, 0.06, 0.3), standing(1), settings)
    np.testing.assert_allclose(strict.levels[0].cost, [0.0496, 0.0694, 0.307], atol=1e-5)
    [lenient] = grow(
        priced(0.04, 0.06, 0.3), standing(1), replace(settings, tolerances={"skating": 0.075})
    )
    np.testing.assert_allclose(lenient.levels[0].cost, [0.0094, 0.0096, 0.232], atol=1e-5)


def test_children_over_a_limit_are_rejected_though_they_cost_less():
    weights = {"goal_distance": 1.0}
    settings = BeamSettings(4, keep=2, roots=4, depth=1, weights=weights, limits={"skating": 0.25})
    [tree] = grow(priced(0.1, 0.9, 0.2, 0.8), standing(1), settings)
    np.testing.assert_allclose(tree.levels[0].cost, [0.8, 0.9], atol=1e-6)
    assert not tree.plan().rejected.any()
    [soft] = grow(priced(0.1, 0.9, 0.2, 0.8), standing(1), replace(settings, limits={}))
    np.testing.assert_allclose(soft.levels[0].cost, [0.1, 0.2], atol=1e-6)


def test_when_all_are_rejected_the_best_by_soft_cost_goes_on_alone_and_is_marked():
    weights = {"goal_distance": 1.0}
    settings = BeamSettings(4, keep=3, roots=4, depth=2, weights=weights, limits=HARD)
    [tree] = grow(priced(0.6, 0.9, 0.7, 0.8), standing(1), settings)
    assert [len(level.parent) for level in tree.levels] == [1, 1]
    assert tree.plan().rejected.tolist() == [True, True]
    np.testing.assert_allclose(tree.plan().costs, [0.1, 0.1], atol=1e-6)


def test_a_term_that_is_not_a_number_is_over_every_limit():
    kept, rank = select(np.zeros(3, int), np.array([np.inf, 2.0, 1.0]), np.array([1, 0, 1]) > 0, 3)
    assert (kept.tolist(), rank.tolist()) == ([1], [0])


def test_select_ranks_each_agent_for_itself_and_ties_keep_their_order():
    agent = np.array([0, 0, 0, 1, 1, 3])
    cost = np.array([1.0, 0.5, 1.0, 9.0, 8.0, np.inf])
    kept, rank = select(agent, cost, np.zeros(6, bool), 2)
    assert (kept.tolist(), rank.tolist()) == ([1, 0, 4, 3], [0, 1, 0, 1])
