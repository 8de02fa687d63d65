"""The server on a machine that hiccups: the losses, what gives way first, and the recovery. In
simulated time (`simulated.py`).
"""

from collections import Counter
from itertools import pairwise

import pytest

from tests.runtime.simulated import Run, simulated
from wayfarer.spec import GENDERS, STEP_SECONDS
from wayfarer.world.agents.agent import ChunkFlag, Sight
from wayfarer.world.goals.steering import Steering

AGENTS = 48
ONE = Steering(reactions=1).with_search(candidates=1)
FOUR = Steering(reactions=1).with_search(candidates=4)


def held(run: Run) -> set[str]:
    return {chunk.agent for chunk in run.left if chunk.flags & ChunkFlag.HELD}


@pytest.mark.parametrize("load", [0.6, 0.9])
def test_after_a_stall_only_what_fell_into_it_is_lost(load):
    run = simulated(5.0, [(2.0, 3.0, 0.0)], AGENTS, load, steering=ONE)
    over = int(1.0 / STEP_SECONDS) - 1  # the last ones can still be seen at the end
    assert len(run.missed(0.0, 4.5)) == AGENTS * over
    assert all(2.0 <= due - 1000.0 < 3.0 for _, due in run.missed(0.0, 4.5))
    assert run.lateness(3.6, 4.5) <= 0.0, "on time again, with what the engine makes ahead"


def test_nobody_jumps_over_a_stall():
    run = simulated(4.0, [(2.0, 3.0, 0.0)], AGENTS, steering=ONE)
    for agent in {chunk.agent for chunk in run.left}:
        own = [chunk for chunk in run.left if chunk.agent == agent]
        assert [chunk.seq for chunk in own] == list(range(len(own)))
        gaps = [(b.due - a.due) / STEP_SECONDS for a, b in pairwise(own)]
        assert all(gap == pytest.approx(round(gap), abs=1e-4) for gap in gaps), "in its rhythm"


def test_a_short_stall_is_not_seen():
    run = simulated(4.0, [(2.0, 2.15, 0.0)], AGENTS, steering=ONE)
    assert not run.missed(0.0, 3.5)


def test_in_a_burst_candidates_give_way_and_then_the_standing_before_anything_is_missed():
    run = simulated(7.0, [(2.0, 5.0, 0.4)], AGENTS, 0.8, steering=FOUR)
    assert not run.missed(0.5, 6.5)
    assert run.levels[0][1] == 0 and max(level for _, level in run.levels) >= 2
    assert not held(run) & run.walkers


def test_in_a_burst_that_is_too_much_the_standing_are_held_and_the_rest_is_back_at_once():
    run = simulated(7.5, [(2.0, 5.0, 0.4)], AGENTS, 0.9, steering=ONE)
    missed = run.missed(0.5, 7.0)
    assert missed and {agent for agent, _ in missed} <= run.walkers
    assert held(run) and not held(run) & run.walkers
    assert all(due - 1000.0 < 5.0 + STEP_SECONDS for _, due in missed)
    assert run.lateness(6.0, 7.0) < 0.03
    # the remaining time is used: at least two thirds of the machine's capacity
    walked = sum(2.5 <= c.due - 1000.0 < 5.0 and not c.flags & ChunkFlag.HELD for c in run.left)
    assert walked > 0.67 * 0.4 / 0.9 * AGENTS * 2.5 / STEP_SECONDS


def test_with_a_fifth_too_many_people_it_is_a_little_late_and_leaves_out_a_fifth():
    run = simulated(7.0, [], AGENTS, 1.2, standing=0.0, steering=ONE)
    late = sorted(chunk.late for chunk in run.left if 2.0 <= chunk.due - 1000.0 < 6.5)
    assert late[len(late) // 2] > 0.05 and late[int(0.99 * len(late))] < STEP_SECONDS
    left_out = Counter(agent for agent, _ in run.missed(2.0, 6.5))
    each = 4.5 / STEP_SECONDS
    assert 0.1 < left_out.total() / (AGENTS * each) < 0.3
    assert max(left_out.values()) < 0.5 * each, "nobody waits while others walk"


SIGHTS = (Sight.NEAR, Sight.FAR, Sight.ROOT, Sight.NONE)
"""By turns. Genders take turns as well, and have their own calls."""


def by_sight(run: Run, agents: list[str]) -> list[int]:
    return [sum(run.seen[agent] == sight for agent in agents) for sight in SIGHTS]


def test_when_there_is_time_for_half_of_all_who_is_near_and_who_is_hardly_seen_is_in_time():
    mixed = [sight for sight in SIGHTS for _ in GENDERS]
    run = simulated(4.5, [(2.0, 4.0, 0.5)], AGENTS, 0.9, standing=0.0, sights=mixed, steering=ONE)
    missed = [agent for agent, _ in run.missed(0.5, 4.4)]
    near, far, root, none = by_sight(run, missed)
    assert near == root == none == 0 < far, "walkers that are seen as a root need no engine"
    walked = [c.agent for c in run.left if 2.5 <= c.due - 1000.0 < 4.0]
    assert min(by_sight(run, walked)) > 0, "no agent waits forever"


def test_twice_the_people_when_most_are_seen_as_roots():
    mixed = [Sight.NEAR, Sight.NEAR, *[Sight.ROOT] * 8]
    run = simulated(9.0, [], 2 * AGENTS, 1.8, standing=0.0, sights=mixed, steering=ONE)
    assert not run.missed(2.0, 8.5)
    assert 0 not in {level for at, level in run.levels if at > 1.0}, "it makes no futile attempts"
    assert any(c.flags & ChunkFlag.REDUCED for c in run.left)


def test_without_need_the_order_changes_nothing():
    plain, mixed = (
        simulated(2.0, [], AGENTS, 0.6, sights=sights, steering=ONE)
        for sights in ((Sight.NEAR,), SIGHTS)
    )
    assert [c.late for c in plain.left] == [c.late for c in mixed.left]
