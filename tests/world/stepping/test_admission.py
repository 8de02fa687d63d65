"""Admission of agents by the given durations of engine calls."""

import re

import pytest

from tests.world.fakes import make_world, people
from wayfarer.config.limits import Limits
from wayfarer.errors import InvalidArgument, ResourceExhausted
from wayfarer.spec import GENDERS, STEP_SECONDS
from wayfarer.world.agents.agent import SessionSpec
from wayfarer.world.agents.phases import Phases
from wayfarer.world.stepping import costs as module
from wayfarer.world.stepping.admission import Admission, in_turn
from wayfarer.world.stepping.budget import BudgetRules
from wayfarer.world.stepping.engine_call import Call
from wayfarer.world.stepping.settings import AdmissionRules, WorldSettings

CALL, ROW = 0.002, 0.001  # seconds: of any call, and for each of its rows

FULL = 8  # rows of a full batch

MOST = AdmissionRules().most_load


def measure(target, sizes=range(1, 9), candidates=(1, 4)):
    for rows in sizes:
        for count in candidates:
            target.measured(rows, count, count * (CALL + ROW * rows))


def cost(agents, candidates=1):
    """Busy share of the engine, computed by hand: full batches of each gender."""
    seconds = 0.0
    for count in filter(None, in_turn(agents)):
        rows = min(count, FULL)
        seconds += count / rows * candidates * (CALL + ROW * rows)
    return seconds / STEP_SECONDS


def admission(**settings):
    made = Admission(WorldSettings(batch_sizes=tuple(range(1, 9)), **settings))
    measure(made)
    return made


def fits(found, agents, more=1, now=0.0):
    try:
        genders = [number % 2 for number in range(agents, agents + more)]
        found.check(in_turn(agents), genders, now, late=False)
    except ResourceExhausted:
        return False
    return True


def test_before_anything_is_measured_everybody_is_let_in():
    found = Admission(WorldSettings())
    found.check([0, 0], [0] * 1000, 0.0, late=False)
    assert found.capacity(0.0) == 0


def test_agents_in_turn_are_of_all_genders():
    assert in_turn(0) == [0, 0] and in_turn(7) == [4, 3]


@pytest.fixture
def free(monkeypatch):
    """Makes only engine calls take time until something is measured."""
    monkeypatch.setattr(module, "FIRST_TURN", 0.0)
    monkeypatch.setattr(module, "FIRST_CHUNK", 0.0)
    monkeypatch.setattr(module, "FIRST_EXCESS", 1.0)


@pytest.mark.usefixtures("free")
def test_agents_fit_as_long_as_calls_with_one_candidate_leave_time():
    found = admission()
    capacity = found.capacity(0.0)
    assert cost(capacity) <= MOST < cost(capacity + 1)
    assert fits(found, capacity - 1) and not fits(found, capacity)
    assert fits(found, 0, 8) and not fits(found, capacity - 4, 8), "all or none"


def test_the_refusal_says_how_many_fit_and_what_limits():
    found = admission(admission=AdmissionRules(most_load=0.5, retry_after=7.0))
    capacity = found.capacity(0.0)
    words = (
        rf"^cannot add 4 agents: {capacity} of about {capacity} are in use, and the projected load "
        r"would be \d+% \(limit 50%\)$"
    )
    with pytest.raises(ResourceExhausted, match=words) as error:
        found.check(in_turn(capacity), [0] * 4, 0.0, late=False)
    assert error.value.retry_after == 7.0 and found.refused == 4


def test_the_refusal_does_not_contradict_itself():
    found = admission(admission=AdmissionRules(most_load=0.5))
    capacity = found.capacity(0.0)
    # this many agents of both genders would fit, but not of one
    with pytest.raises(ResourceExhausted) as error:
        found.check([0, 0], [0] * 100_000, 0.0, late=False)
    used, fit = map(int, re.search(r"(\d+) of about (\d+) are", str(error.value)).groups())
    assert used == 0 and fit <= capacity
    few = admission(admission=AdmissionRules(most_load=1e-9))
    with pytest.raises(ResourceExhausted, match=r"cannot add 1 agent: 1 of about [01] are in use"):
        few.check([1, 0], [0], 0.0, late=False)
    # a refusal for lateness does not state how many fit
    with pytest.raises(ResourceExhausted) as error:
        found.check([1, 0], [0], 0.0, late=True)
    assert str(error.value) == (
        "cannot add 1 agent: 1 are in use, and steps come late with all that can give way"
    )
    with pytest.raises(ResourceExhausted, match=r"1 agent: the agents in use count as 1\.25, and"):
        found.check([1, 0.25], [0], 0.0, late=True)  # the second is far away


def run(found, agents, rows, times=1.0, calls=module.ENOUGH):
    """Measures calls with four candidates and `rows` rows, for `agents` agents in five seconds."""
    for number in range(calls):
        seconds = times * 4 * (CALL + ROW * rows)
        found.spent(5.0 * number / calls, Call(rows, 4), rows, seconds, in_turn(agents))


@pytest.mark.usefixtures("free")
def test_steps_that_are_slower_than_warm_ones_leave_room_for_fewer():
    found = admission()
    before = found.capacity(0.0)
    run(found, 60, 8, times=2.0)
    found.spent(5.0, Call(9, 4), 9, 99.0, in_turn(60))  # not measured when warm
    assert found.capacity(5.0) == pytest.approx(before / 2, abs=1)
    assert found.capacity(60.0) == before, "what was slow a minute ago does not count"


@pytest.mark.usefixtures("free")
def test_batches_that_are_not_full_leave_room_for_fewer():
    found, full = admission(), admission()
    before = found.capacity(0.0)
    run(found, 60, 2)
    run(full, 60, 8)
    each, in_full = (CALL + ROW * 2) / 2, (CALL + ROW * 8) / 8
    assert found.capacity(5.0) == pytest.approx(before * in_full / each, abs=1)
    assert full.capacity(5.0) == pytest.approx(before, abs=1)


@pytest.mark.usefixtures("free")
def test_small_batches_of_a_few_agents_are_as_full_as_can_be():
    found = admission()
    before = found.capacity(0.0)
    run(found, 4, 2)
    assert found.capacity(5.0) == before


def test_agents_who_have_left_meanwhile_tell_nothing():
    found = admission()
    before = found.capacity(0.0)
    run(found, 0, 8, times=3.0)
    assert found.capacity(5.0) == before


def test_a_few_calls_at_a_bad_moment_say_little():
    found = admission()
    before = found.capacity(0.0)
    run(found, 60, 1, times=300.0, calls=20)
    for number in range(20):
        found.worked(5.0 + number / 100, 0.005, number % 2)
    assert found.capacity(6.0) > before / 2


@pytest.mark.usefixtures("free")
def test_what_the_loop_needs_the_engine_lacks():
    """Sending the chunks needs the same time again."""
    found, wide = admission(), admission(cores=1000)
    for target in (found, wide):
        for number in range(module.ENOUGH):
            target.worked(number / 30, 0.0005 * (number % 4), number % 4)
    capacity = found.capacity(5.0)
    alone = next(n for n in range(1000) if cost(n) > MOST) - 1
    assert wide.capacity(5.0) == pytest.approx(alone, abs=1), "cores enough for all"
    thread = capacity * 0.0005 / STEP_SECONDS
    assert cost(capacity) / (1 - 2 * thread) == pytest.approx(MOST, abs=0.02)


@pytest.mark.usefixtures("free")
def test_what_is_measured_beside_the_loop_holds_its_share_already():
    """A call's duration is that without the loop, divided by the share that the loop leaves."""
    found, idle = admission(), admission()
    for target in (found, idle):
        for number in range(module.ENOUGH):
            target.worked(number / 30, 0.0005 * (number % 4), number % 4)
    run(found, 20, 8, times=1 / (1 - 2 * 20 * 0.0005 / STEP_SECONDS))
    assert found.capacity(5.0) == pytest.approx(idle.capacity(5.0), abs=1)
    assert found.load(5.0) == pytest.approx(module.ENOUGH * 4 * (CALL + ROW * 8) / 0.9 / 10)


def test_a_loop_that_has_more_to_do_than_the_engine_limits():
    found = admission(cores=1000)
    for number in range(module.ENOUGH):
        chunks = number % 4
        found.worked(number / 30, 0.001 + 0.003 * chunks, chunks)
    capacity = found.capacity(5.0)
    assert capacity * (0.001 / FULL + 0.003) / STEP_SECONDS == pytest.approx(MOST, abs=0.02)
    assert found.load(5.0) == pytest.approx(module.ENOUGH * (0.001 + 0.003 * 1.5) / 10, rel=0.02)


def test_of_measures_of_one_size_the_shortest_counts():
    found = admission()
    before = found.capacity(0.0)
    for rows in range(1, 9):
        found.measured(rows, 1, 10.0)
    assert found.capacity(100.0) == before


def test_what_the_loop_does_beside_counts_before_it_is_measured():
    rest = module.Rest()
    assert rest.line(0.0) == (module.FIRST_TURN, module.FIRST_CHUNK)
    for turn in range(module.ENOUGH):
        rest.add(turn / 100, 0.001 + 1e-5 * (turn % 5), turn % 5)
    assert rest.line(0.5) == pytest.approx((0.001, 1e-5))


@pytest.mark.usefixtures("free")
@pytest.mark.parametrize(("most_load", "fit"), [(0.29, 7 + 6), (0.8, 21 + 21)])
def test_sizes_between_those_measured_cost_in_proportion(most_load, fit):
    """7 rows take 0.03 s; 21 agents are a batch of 16 and 5/16 of another: 0.079 s."""
    settings = WorldSettings(batch_sizes=(4, 16), admission=AdmissionRules(most_load))
    found = Admission(settings)
    found.measured(4, 1, 0.02)
    found.measured(16, 1, 0.06)
    assert found.capacity(0.0) == fit


def test_a_world_refuses_at_once_all_or_none_and_makes_room_again():
    world = make_world(admission=AdmissionRules(most_load=0.2))
    measure(world.load.admission)
    world.create_session(SessionSpec("s"), 0.0)
    capacity = world.load.capacity(0.0)
    made = world.create_agents("s", people(capacity), 0.0)
    with pytest.raises(
        ResourceExhausted, match=f"{capacity} of about {capacity} are in use"
    ) as error:
        world.create_agents("s", people(2), 0.0)
    assert error.value.retry_after > 0
    with pytest.raises(ResourceExhausted), world.reserve("s", people(2), 0.0):
        pass
    assert len(world.registry.agents) == capacity and world.load.admission.refused == 4
    for agent in made[:4]:
        world.delete_agent(agent.agent_id)
    world.create_agents("s", people(2), 0.0)


def test_room_that_is_held_is_taken_for_all_others_until_it_is_given_up():
    world = make_world(admission=AdmissionRules(most_load=0.2))
    measure(world.load.admission)
    for name in "st":
        world.create_session(SessionSpec(name), 0.0)
    capacity = world.load.capacity(0.0)
    with world.reserve("s", people(capacity), 0.0):
        with pytest.raises(ResourceExhausted), world.reserve("t", people(1), 0.0):
            pass
        with pytest.raises(ResourceExhausted):
            world.create_agents("t", people(1), 0.0)
    assert len(world.registry.agents) == 0 and world.load.admission.refused == 2
    with world.reserve("t", people(capacity), 0.0) as room:
        world.create_agents("t", people(capacity), 0.0, None, room)
        assert len(world.registry.agents) == capacity


def test_held_room_counts_for_the_limits_of_the_session_and_of_the_world():
    world = make_world(limits=Limits(agents=6, agents_per_session=4))
    for name in "st":
        world.create_session(SessionSpec(name), 0.0)
    with world.reserve("s", people(3), 0.0):
        with pytest.raises(ResourceExhausted, match="3 agents and may have 4"):
            world.create_agents("s", people(2), 0.0)
        with pytest.raises(ResourceExhausted, match="3 of 6 agents exist"):
            world.create_agents("t", people(4), 0.0)
        world.create_agents("t", people(3), 0.0)


def test_who_has_given_its_room_up_is_asked_again():
    world = make_world(limits=Limits(agents=2))
    world.create_session(SessionSpec("s"), 0.0)
    with world.reserve("s", people(2), 0.0) as room:
        pass
    world.create_agents("s", people(1), 0.0)
    with pytest.raises(ResourceExhausted, match="1 of 2 agents exist"):
        world.create_agents("s", people(2), 0.0, None, room)
    assert len(world.registry.agents) == 1


def test_the_cap_holds_besides():
    world = make_world(limits=Limits(agents=3))
    measure(world.load.admission)
    world.create_session(SessionSpec("s"), 0.0)
    assert world.load.capacity(0.0) == 3
    with pytest.raises(ResourceExhausted, match="0 of 3 agents exist") as caught:
        world.create_agents("s", people(4), 0.0)
    assert caught.value.retry_after == 0  # so many will never fit
    world.create_agents("s", people(2), 0.0)
    with pytest.raises(ResourceExhausted, match="2 of 3 agents exist") as caught:
        world.create_agents("s", people(2), 0.0)
    assert caught.value.retry_after == 5


def test_at_the_end_of_the_ladder_nobody_is_let_in_until_there_is_time_again():
    world = make_world(budget=BudgetRules(), phases=1)
    world.create_session(SessionSpec("s"), 0.0)
    world.create_agents("s", people(2), 0.0)
    now = 0.0
    while not world.load.level.refuse:
        now = world.next_event() + 0.25
        world.tick(now)
    with pytest.raises(ResourceExhausted, match=r"add 1 agent: 2 are in use, .* late") as error:
        world.create_agents("s", people(1), now)
    assert error.value.retry_after > 0
    list(world.advance(now + 30.0))
    assert world.load.level_number == 0
    world.create_agents("s", people(1), now + 30.0)


def test_a_world_that_everybody_has_left_is_not_late():
    """The ladder is checked at each step, and there are none."""
    world = make_world(budget=BudgetRules(), phases=1)
    world.create_session(SessionSpec("s"), 0.0)
    (agent,) = world.create_agents("s", people(1), 0.0)
    now = 0.0
    while not world.load.level.refuse:
        now = world.next_event() + 0.25
        world.tick(now)
    world.delete_agent(agent.agent_id)
    world.create_agents("s", people(1), now)


def test_who_may_not_be_is_not_counted_for():
    world = make_world()
    measure(world.load.admission)
    world.create_session(SessionSpec("s"), 0.0)
    with pytest.raises(InvalidArgument, match="gender"):
        world.reserve("s", people(1, gender="robot"), 0.0)


def test_the_load_must_be_a_share():
    for wrong in (0.0, 1.1, float("nan")):
        with pytest.raises(InvalidArgument, match="most_load"):
            AdmissionRules(most_load=wrong)


def test_phases_take_agents_and_give_them_back():
    taken = Phases(4)
    starts = [taken.next_frame(taken.enter(GENDERS.index("male")), 17) for _ in range(8)]
    assert min(starts) >= 17 and max(starts) < 17 + 8
    assert taken.load == [[2, 0]] * 4
    for start in starts[:4]:
        taken.leave(start - 8 * 5, GENDERS.index("male"))
    assert taken.agents == 4 and taken.by_gender == [4, 0]


def test_without_refusals_only_limits_count():
    world = make_world(admission=AdmissionRules(0.01, refuse=False), limits=Limits(agents=3))
    world.load.admission.measured(1, 1, 1.0)
    world.create_session(SessionSpec("s"), 0.0)
    world.create_agents("s", people(3), 0.0)
    with pytest.raises(ResourceExhausted, match="3 of 3 agents exist"):
        world.create_agents("s", people(1), 0.0)
