from dataclasses import replace

import pytest

from wayfarer.world.stepping.budget import (
    Budget,
    BudgetRules,
    DegradationLevel,
    candidate_counts,
    ladder,
)

RULES = BudgetRules()
CALL = 0.05  # seconds of one engine call with all candidates
PLENTY = 0.2
SHORT = -1.0
HOLD = DegradationLevel(1, by_sight=True, hold_idle=True)
REFUSE = replace(HOLD, refuse=True)


def level(count):
    """A level on which near agents come first, and the others may coast."""
    return DegradationLevel(count, by_sight=True)


def candidates(budget, now, slack):
    return budget.allow(now, slack).candidates


@pytest.mark.parametrize(
    ("most", "counts"),
    [(8, (8, 4, 2, 1)), (10, (10, 8, 4, 2, 1)), (1, (1,)), (32, (32, 16, 8, 4, 2, 1))],
)
def test_the_ladder_begins_with_what_is_wished_and_ends_with_a_refusal(most, counts):
    assert candidate_counts(most) == counts
    assert ladder(most) == (DegradationLevel(most), *map(level, counts), HOLD, REFUSE)


def busy(budget, start, seconds, call, share):
    """Runs engine calls that take a share of the time."""
    for number in range(int(seconds / (call / share))):
        budget.spent(start + number * call / share, call)


def test_enough_time_changes_nothing():
    budget = Budget(8, RULES)
    busy(budget, 0.0, 1.0, CALL, 0.5)
    assert [candidates(budget, 1.0 + t, PLENTY) for t in range(5)] == [8] * 5
    assert budget.number == 0


def test_a_call_that_would_end_too_late_tries_fewer():
    budget = Budget(8, RULES)
    busy(budget, 0.0, 1.0, CALL, 0.9)
    assert candidates(budget, 1.0, CALL - RULES.hurry + 0.001) == 8
    assert candidates(budget, 1.0, CALL - RULES.hurry - 0.001) == 4
    assert candidates(budget, 1.0 + RULES.settle / 2 - 0.01, SHORT) == 4, "first see what it brings"
    assert candidates(budget, 1.0 + RULES.settle + 0.01, SHORT) == 2
    assert budget.number == 3


A_LITTLE = RULES.hurry - RULES.late
"""Seconds of lateness that may be chance."""


def test_calls_that_stay_a_little_late_try_fewer():
    budget = Budget(8, RULES)
    assert [candidates(budget, 0.05 * k, -RULES.late - 0.9 * A_LITTLE) for k in range(5)] == [
        *[8] * 4,
        4,
    ]


def test_calls_that_catch_up_or_are_late_now_and_then_change_nothing():
    budget = Budget(8, RULES)
    lateness = [0.9 * A_LITTLE * 0.45**k for k in range(6)]
    found = [candidates(budget, RULES.settle * k, -RULES.late - s) for k, s in enumerate(lateness)]
    assert found == [8] * 6
    again = [candidates(budget, 10 + 1.1 * k, -RULES.late - 0.9 * A_LITTLE) for k in range(5)]
    assert again == [8] * 5


def test_an_engine_that_is_busy_all_the_time_but_in_time_changes_nothing():
    budget = Budget(8, RULES)
    busy(budget, 0.0, 1.0, CALL, 1.0)
    assert candidates(budget, 1.0, PLENTY) == 8


def test_calls_under_way_come_first():
    budget = Budget(8, RULES)
    busy(budget, 0.0, 1.0, CALL, 0.9)
    enough = 1.5 * CALL - RULES.hurry + 0.001
    assert budget.allow(1.0, enough, ahead=1).candidates == 8
    assert budget.allow(1.0, enough, ahead=2).candidates == 4


def test_short_calls_between_do_not_hide_the_long_ones():
    budget = Budget(8, RULES)
    for number in range(8):
        budget.spent(number / 10, CALL if number % 2 else CALL / 10)
    assert candidates(budget, 1.0, CALL - RULES.hurry - 0.001) == 4


def test_when_candidates_are_few_idle_agents_are_held_and_then_new_ones_refused():
    budget = Budget(4, RULES)
    found = [budget.allow(float(t), -1.0) for t in range(6)]
    assert found == [level(2), level(1), HOLD, REFUSE, REFUSE, REFUSE]


def test_where_agents_are_distant_they_give_way_first_and_come_back_last():
    budget = Budget(4, RULES)
    found = [budget.allow(float(t), SHORT, distant=True) for t in range(4)]
    assert found == [level(4), level(2), level(1), HOLD]
    times = (3.0 + RULES.patience * step for step in range(1, 5))
    back = [budget.allow(time, PLENTY, distant=True) for time in times]
    assert back == [level(1), level(2), level(4), DegradationLevel(4)]


def test_when_nobody_is_distant_any_more_it_does_not_stay_there():
    budget = Budget(4, RULES)
    budget.allow(0.0, SHORT, distant=True)
    assert budget.allow(RULES.patience, PLENTY) == DegradationLevel(4)
    budget.allow(10.0, SHORT, distant=True)
    assert budget.allow(11.0, SHORT).candidates == 2


def test_more_are_tried_again_after_a_calm_while():
    budget = Budget(8, RULES)
    assert candidates(budget, 0.0, SHORT) == 4
    assert candidates(budget, RULES.patience - 0.1, PLENTY) == 4
    assert candidates(budget, RULES.patience, PLENTY) == 8


def test_it_climbs_level_by_level_with_patience():
    budget = Budget(2, RULES)
    for t in range(4):
        budget.allow(float(t), -1.0)
    found = [budget.allow(100.0 + RULES.patience * step, PLENTY) for step in range(4)]
    assert found == [HOLD, level(1), DegradationLevel(2), DegradationLevel(2)]


def test_a_climb_that_was_a_mistake_is_tried_again_later_and_later():
    budget = Budget(8, RULES)
    budget.allow(0.0, SHORT)
    now, waits = 0.0, []
    for _ in range(7):
        begun = now
        while candidates(budget, now, PLENTY) == 4:
            now += 0.1
        waits.append(round(now - begun))
        now += RULES.settle + 0.01
        assert candidates(budget, now, SHORT) == 4
    assert waits == [3, 6, 12, 24, 48, 60, 60]


def test_and_soon_again_when_all_was_well_for_long():
    budget = Budget(8, RULES)
    budget.allow(0.0, SHORT)
    assert candidates(budget, 3.0, PLENTY) == 8
    assert candidates(budget, 4.0, SHORT) == 4
    assert candidates(budget, 10.0, PLENTY) == 8, "after six seconds"
    assert candidates(budget, 10.0 + RULES.most_patience, SHORT) == 4
    assert candidates(budget, 10.0 + RULES.most_patience + RULES.patience, PLENTY) == 8


def test_not_when_the_engine_would_then_be_too_busy():
    budget = Budget(8, RULES)
    assert candidates(budget, 0.0, SHORT) == 4
    now = RULES.patience
    busy(budget, now - 1.0, 1.0, CALL / 2, 0.85)
    assert candidates(budget, now, PLENTY) == 4, "it would be busy all the time"
    later = now + 10.0
    busy(budget, later - 1.0, 1.0, CALL / 2, 0.4)
    assert candidates(budget, later, PLENTY) == 8


def test_idle_agents_are_held_until_there_is_time_to_step_them_too():
    def after(held):
        budget = Budget(1, RULES)
        assert budget.allow(0.0, -1.0) == HOLD
        now = RULES.patience
        busy(budget, now - 1.0, 1.0, CALL, 0.3)
        return budget.allow(now, PLENTY, held)

    assert after(held=0.5) == DegradationLevel(1)
    assert after(held=0.9) == HOLD, "with them the engine would be busy for three times the time"


def test_nor_when_the_longer_call_would_end_too_late():
    budget = Budget(8, RULES)
    assert candidates(budget, 0.0, SHORT) == 4
    budget.spent(9.5, 0.1)
    assert candidates(budget, 10.0, 0.12) == 4
    budget = Budget(8, RULES)
    assert candidates(budget, 0.0, SHORT) == 4
    budget.spent(9.5, 0.05)
    assert candidates(budget, 10.0, 0.2) == 8


def test_one_long_call_among_many_is_no_reason():
    budget = Budget(8, RULES)
    busy(budget, 0.0, 1.0, CALL, 0.5)
    budget.spent(1.0, 0.5)
    assert candidates(budget, 1.0, PLENTY) == 8
