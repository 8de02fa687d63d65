"""The attribution of faults, and how long an agent sits out."""

import numpy as np
import pytest

from tests.world.fakes import make_world, people
from wayfarer.world.agents.agent import SessionSpec
from wayfarer.world.agents.faults import (
    CALM,
    MAX_FAULTS,
    PAUSE,
    Faults,
    NotFiniteError,
    Stage,
    check_finite,
)
from wayfarer.world.events import EventKind


class BrokenError(Exception):
    """An error of a stage."""


@pytest.fixture
def world():
    made = make_world()
    for name in "st":
        made.create_session(SessionSpec(name), 0.0)
        made.create_agents(name, people(8), 0.0)
    return made


@pytest.fixture
def reports():
    return []


@pytest.fixture
def faults(world, reports):
    made = Faults(world.slots, world.registry, reports.append)
    made.stage = Stage.RULES
    return made


def run(guilty, calls):
    def done(some):
        calls.append(len(some))
        if guilty & set(some.tolist()):
            raise BrokenError
        return some

    return done


@pytest.mark.parametrize("guilty", [{5}, {0}, {15}, {3, 4}, {1, 9, 14}, set(range(16)), {0, 1, 2}])
def test_those_that_a_stage_fails_for_are_found_and_the_others_are_done_once(
    faults, reports, guilty
):
    rows, calls = np.arange(16), []
    parts = faults.split(rows, run(guilty, calls), BrokenError())
    done = np.concatenate([some for some, _ in parts]) if parts else np.empty(0)
    assert sorted(done.tolist()) == sorted(set(range(16)) - guilty), "each of them once"
    assert {fault.agent_id for fault in reports} == {faults._slots.agent_id[row] for row in guilty}
    assert len(calls) <= 2 * len(guilty) * 4
    told = faults.take_events()
    assert {event.alias for _, event in told} == {int(faults._slots.alias[row]) for row in guilty}
    assert all(event.kind is EventKind.FAULT for _, event in told)
    assert {session for session, _ in told} == {"s" if row < 8 else "t" for row in guilty}
    assert set(np.flatnonzero(faults.held(rows)).tolist()) == guilty


def test_what_fails_only_together_is_done_apart_and_nobodys_fault(faults, reports):
    def together(some):
        if len(some) > 8:
            raise BrokenError
        return some

    parts = faults.split(np.arange(16), together, BrokenError())
    assert [len(some) for some, _ in parts] == [8, 8]
    [fault] = reports
    assert not fault.agent_id and not faults.held(np.arange(16)).any()


def test_what_fails_for_nobody_is_nobodys_fault(faults, reports):
    assert faults.split(np.empty(0, np.int64), run({0}, []), BrokenError()) == []
    [fault] = reports
    assert not fault.agent_id


def test_a_search_that_costs_too_much_is_given_up(faults, reports):
    with pytest.raises(BrokenError):
        faults.split(np.arange(16), run(set(range(16)), []), BrokenError(), most=10)
    assert not reports


def test_where_nobody_hears_of_faults_they_are_raised(world):
    faults = world.faults
    assert not faults.contained
    with pytest.raises(BrokenError):
        faults.split(np.arange(16), run(set(), []), BrokenError())
    for call in (
        lambda: faults.agents([0], Stage.GROUND, BrokenError()),
        lambda: faults.session("s", Stage.CROWD, BrokenError()),
        lambda: faults.nobody(Stage.ENGINE, BrokenError()),
        lambda: faults.elsewhere("s", Stage.DELIVERY, BrokenError()),
        lambda: faults.agent("nobody", BrokenError(), Stage.EVENT),
    ):
        with pytest.raises(BrokenError):
            call()


def test_an_agent_sits_out_twice_as_long_each_time_and_then_for_good(faults, reports):
    planned, row = faults._slots.planned_chunks, np.array([3])
    for times in range(1, MAX_FAULTS):
        faults.agents(row, Stage.ENGINE, BrokenError())
        planned[3] += PAUSE * 2 ** (times - 1) - 1
        assert faults.held(row).all(), times
        planned[3] += 1
        assert not faults.held(row).any(), times
    faults.agents(row, Stage.ENGINE, BrokenError())
    planned[3] += 100_000
    assert faults.held(row).all()
    assert [fault.given_up for fault in reports] == [False] * (MAX_FAULTS - 1) + [True]
    faults.pardon(3)
    assert not faults.held(row).any(), "it was given another goal"
    faults.agents(row, Stage.ENGINE, BrokenError())
    planned[3] += 100_000
    assert faults.held(row).all(), "one more try"


def test_faults_long_ago_are_forgotten(faults, reports):
    planned, row = faults._slots.planned_chunks, np.array([3])
    for _ in range(MAX_FAULTS - 1):
        faults.agents(row, Stage.ENGINE, BrokenError())
    planned[3] += PAUSE * 2**MAX_FAULTS + CALM
    assert not faults.held(row).any() and not faults.any
    faults.agents(row, Stage.ENGINE, BrokenError())
    assert reports[-1].times == 1


def test_stages_are_sat_out_one_by_one(faults):
    rows = np.arange(4)
    faults.agents([1], Stage.GROUND, BrokenError())
    faults.agents([2], Stage.BEHAVIOUR, BrokenError())
    assert not faults.held(rows).any(), "it walks on"
    assert faults.out(rows, Stage.GROUND).tolist() == [False, True, False, False]
    assert faults.out(rows, Stage.BEHAVIOUR).tolist() == [False, False, True, False]
    assert not faults.out(rows, Stage.EVENT).any()


def test_who_comes_into_a_slot_has_a_clean_record(world, reports):
    world = make_world()
    world.create_session(SessionSpec("s"), 0.0)
    [agent] = world.create_agents("s", people(1), 0.0)
    world.faults._report = reports.append
    world.faults.agents([0], Stage.ENGINE, BrokenError())
    assert world.faults.any
    world.delete_agent(agent.agent_id)
    world.create_agents("s", people(1), 0.0)
    assert not world.faults.any and not world.take_events()


def test_what_rules_remember_is_forgotten(faults):
    slots = faults._slots
    slots.planned.memory.waited[1] = np.nan
    slots.route.passage[1] = 1
    faults.agents([1], Stage.ENGINE, BrokenError())
    assert slots.planned.memory.waited[1] == 0 and slots.route.passage[1] == 0


def test_numbers_that_are_none_are_refused():
    check_finite("frames", np.ones(4), np.zeros((2, 3)))
    for bad in (np.nan, np.inf, -np.inf):
        with pytest.raises(NotFiniteError, match="frames are not finite"):
            check_finite("frames", np.ones(4), np.array([1.0, bad]))
    with pytest.raises(NotFiniteError):
        check_finite("frames", np.array([np.inf, -np.inf]))
