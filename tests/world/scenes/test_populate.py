"""People who come, walk about and leave."""

import numpy as np
import pytest

from tests.world.fakes import make_world
from tests.world.scenes.grounds import BOX, enter, field, world_in
from wayfarer.config.limits import Limits
from wayfarer.errors import FailedPrecondition, InvalidArgument, NotFound
from wayfarer.world.agents.agent import SessionSpec
from wayfarer.world.scenes.messages import Crowd, CrowdState
from wayfarer.world.stepping.settings import AdmissionRules


def square(**settings):
    world, _, _ = world_in(field(BOX), **settings)
    enter(world)
    return world


def walk(world, start, end, every=0.1):
    """Lets time pass, also while nobody is there; yields the agents after each moment."""
    counts = []
    for moment in np.arange(start, end, every):
        world.tick(float(moment))
        counts.append(len(world.registry.agents))
    return counts


def test_all_come_at_once_and_walk_about():
    world = square()
    world.crowds.set("s", Crowd(20, seed=3), 0.0)
    assert world.crowds.state("s") == CrowdState(0, 20) and not world.crowds.state("s").is_settled
    counts = walk(world, 0.0, 6.0)
    assert counts[20] == counts[-1] == 20
    assert world.crowds.state("s") == CrowdState(20, 0) and world.crowds.state("s").is_settled
    agents = world.list_agents("s")
    starts = np.array([agent.spec.position for agent in agents])
    apart = np.linalg.norm(starts[:, None] - starts, axis=-1) + 9 * np.eye(20)
    assert apart.min() > 0.5  # later people considered where the others were by then
    assert field(BOX).distance(starts).min() >= 0.44
    assert len({agent.spec.gender for agent in agents}) == 2
    assert len({agent.spec.betas for agent in agents}) > 8
    moved = [np.hypot(*np.subtract(a.position[:2], a.spec.position)) for a in agents]
    assert np.mean(np.array(moved) > 1.0) > 0.8
    assert all(0.9 <= agent.goal.speed <= 1.4 for agent in agents)


def test_a_crowd_follows_from_its_seed():
    specs = []
    for seed in (5, 5, 6):
        world = square()
        world.crowds.set("s", Crowd(6, seed=seed), 0.0)
        walk(world, 0.0, 1.0)
        specs.append([agent.spec for agent in world.list_agents("s")])
    assert specs[0] == specs[1] != specs[2]


def test_they_come_at_a_rate():
    world = square()
    world.crowds.set("s", Crowd(10, spawn_rate=2.0), 0.0)
    walk(world, 0.0, 0.2)
    assert world.crowds.state("s") == CrowdState(1, 9, "2 come a second, as was asked for")
    counts = walk(world, 0.2, 8.0)
    assert counts[13] <= 4 and counts[28] <= 7
    assert counts[-1] == 10


def test_who_leaves_stands_and_another_comes():
    world = square()
    world.crowds.set("s", Crowd(6, dwell=(0.5, 0.5), stay=3.0), 0.0)
    names, stood = set(), True
    for moment in np.arange(0.0, 15.0, 0.1):
        before = {a.agent_id: a.state for a in world.list_agents("s")}
        world.tick(float(moment))
        now = {a.agent_id for a in world.list_agents("s")}
        stood &= all(before[gone] == "standing" for gone in before.keys() - now)
        names |= now
        assert len(now) <= 6
    assert stood and len(names) > 8


def test_those_who_have_gone_are_told():
    world = square()
    world.crowds.set("s", Crowd(3), 0.0)
    world.crowds.tend(0.0)
    came = {(a.session_id, a.agent_id, a.alias) for a in world.list_agents("s")}
    world.crowds.set("s", Crowd(0), 1.0)
    gone = world.crowds.tend(1.0)
    assert {(a.session_id, a.agent_id, a.alias) for a in gone} == came and len(came) == 3
    assert not world.crowds.tend(2.0)


def test_none_at_all_and_fewer():
    world = square()
    world.crowds.set("s", Crowd(8), 0.0)
    walk(world, 0.0, 2.0)
    world.crowds.set("s", Crowd(3), 2.0)
    assert world.crowds.state("s") == CrowdState(3, 0)
    walk(world, 2.0, 20.0)
    assert len(world.registry.agents) == 3
    world.crowds.set("s", Crowd(0), 20.0)
    walk(world, 20.0, 40.0)
    assert len(world.registry.agents) == 0


def test_of_other_agents_none_is_taken_away():
    world, _, _ = world_in(field(BOX))
    [agent] = enter(world, (6.0, 2.0))
    world.crowds.set("s", Crowd(2), 0.0)
    walk(world, 0.0, 1.0)
    world.delete_agent(world.list_agents("s")[1].agent_id)  # another caller does this
    walk(world, 1.0, 3.0)
    assert len(world.registry.agents) == 3
    world.crowds.set("s", Crowd(0), 3.0)
    walk(world, 3.0, 20.0)
    assert [a.agent_id for a in world.list_agents("s")] == [agent.agent_id]
    world.delete_session("s")
    world.crowds.tend(50.0)


@pytest.mark.parametrize(
    ("crowd", "field_"),
    [
        (Crowd(-1), "count"),
        (Crowd(1, seed=-1), "seed"),
        (Crowd(1, speed=(0.0, 1.0)), "min_speed"),
        (Crowd(1, speed=(1.4, 0.9)), "min_speed"),
        (Crowd(1, dwell=(0.0, float("nan"))), "max_dwell"),
        (Crowd(1, spawn_rate=1e9), "spawn_rate"),
        (Crowd(1, stay=-1.0), "stay"),
    ],
)
def test_crowds_are_checked(crowd, field_):
    with pytest.raises(InvalidArgument) as refused:
        square().crowds.set("s", crowd, 0.0)
    assert refused.value.field == field_


def test_where_and_how_many_there_can_be():
    world = square(limits=Limits(agents_per_session=10))
    world.crowds.set("s", Crowd(11), 0.0)
    walk(world, 0.0, 3.0)
    state = world.crowds.state("s")
    assert (state.came, state.waiting) == (10, 1) and state.is_settled
    assert "has 10 agents and may have 10" in state.reason
    for agent in world.list_agents("s")[:4]:
        world.delete_agent(agent.agent_id)  # there is room again
    world.crowds.set("s", Crowd(9), 3.0)
    walk(world, 3.0, 6.0)
    assert world.crowds.state("s") == CrowdState(9, 0)
    with pytest.raises(NotFound):
        world.crowds.set("nowhere", Crowd(1), 0.0)
    flat = make_world()
    flat.create_session(SessionSpec("s"), 0.0)
    with pytest.raises(FailedPrecondition, match="in no scene"):
        flat.crowds.set("s", Crowd(1), 0.0)
    assert flat.crowds.state("s") == CrowdState(0, 0)
    with pytest.raises(NotFound):
        flat.crowds.state("nowhere")


def test_for_want_of_time_the_rest_waits_and_says_why():
    world = square(admission=AdmissionRules(most_load=0.3))
    for rows in (1, 4, 16):
        world.load.admission.measured(rows, 1, 0.01 * rows)
    fit = world.load.capacity(0.0)
    assert 0 < fit < 20
    world.crowds.set("s", Crowd(20), 0.0)
    walk(world, 0.0, 2.0)
    state = world.crowds.state("s")
    assert 0 < state.came < 20 and state.came + state.waiting == 20
    assert state.reason.startswith("cannot add 1 agent: ") and "projected load" in state.reason
