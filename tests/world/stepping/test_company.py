"""A batch is filled with agents that are due soon."""

import pytest

from tests.world.fakes import GOAL, FakeEngine, make_world, people
from wayfarer.spec import STEP_SECONDS
from wayfarer.world.agents.agent import ChunkFlag, SessionSpec

HALF = STEP_SECONDS / 2


def eight(company, engine=None):
    """A world of eight agents of one gender, in two phases, and their ids."""
    world = make_world(engine, phases=2, batch_lookahead_s=company, batch_multiple=8)
    world.create_session(SessionSpec("s"), 0.0)
    made = world.create_agents("s", people(8, gender="male"), 0.0)
    return world, [agent.agent_id for agent in made]


def rows_of_calls(company, until=2.0):
    engine = FakeEngine()
    world, _ = eight(company, engine)
    list(world.advance(until))
    return [rows for _, rows, _ in engine.calls]


def test_the_next_phase_fills_a_batch():
    alone, together = rows_of_calls(company=0.0), rows_of_calls(company=HALF)
    assert max(alone) < 8 == max(together)
    assert len(together) < len(alone)
    assert sum(together) == pytest.approx(sum(alone), abs=8), "nobody steps more often"


def test_not_those_who_are_due_later():
    assert rows_of_calls(company=HALF - 0.03) == rows_of_calls(company=0.0)


def test_whoever_is_stepped_early_moves_alike():
    def chunks(company):
        world, agents = eight(company)
        found = list(world.advance(1.0))
        world.give(agents[1], GOAL, 1.03)
        found += world.advance(3.0)
        return {(c.agent_id, c.seq): c for c in found}, agents

    (alone, agents), (together, others) = chunks(0.0), chunks(HALF)
    name = dict(zip(others, agents, strict=True))
    assert len(alone) == len(together)
    for (agent, seq), chunk in together.items():
        expected = alone[name[agent], seq]
        assert (chunk.translation == expected.translation).all()
        assert chunk.goal_revision == expected.goal_revision
        assert (chunk.flags & ChunkFlag.REPLANNED) >= (expected.flags & ChunkFlag.REPLANNED)


def test_the_engine_does_not_run_ahead():
    world, _ = eight(HALF + 0.03)
    list(world.advance(1.0))
    assert world.schedule(world.next_event() - 0.02) is None, "somebody due later needs company"
