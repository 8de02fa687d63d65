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


def late(now=0.0, most=8):
    """A budget whose calls were late `settle` before `now`, all candidates being tried."""
    budget = Budget(most, RULES)
    assert budget.allow(now - RULES.settle, SHORT) == DegradationLevel(most)
    return budget


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
    assert candidates(budget, 0.7, CALL - RULES.late - 0.001) == 8, "once may be chance"
    assert candidates(budget, 1.0, CALL - RULES.late + 0.001) == 8
    assert candidates(budget, 1.0, CALL - RULES.late - 0.001) == 4
    assert candidates(budget, 1.0 + RULES.settle / 2 - 0.01, SHORT) == 4, "first see what it brings"
    assert candidates(budget, 1.0 + RULES.settle + 0.01, SHORT) == 2
    assert budget.number == 3


def test_nothing_is_left_out_while_late_calls_catch_up():
    budget = Budget(8, RULES)
    lateness = [0.1 * 0.45**k for k in range(6)]
    found = [candidates(budget, RULES.settle * k, -RULES.late - s) for k, s in enumerate(lateness)]
    assert found == [8] * 6
    assert candidates(budget, RULES.settle * 6, -RULES.late - lateness[5]) == 4, "it stays late"


def test_calls_that_are_late_now_and_then_are_no_reason():
    budget = Budget(8, RULES)
    assert [candidates(budget, 1.1 * k, SHORT) for k in range(5)] == [8] * 5


def test_an_engine_that_is_busy_all_the_time_but_in_time_changes_nothing():
    budget = Budget(8, RULES)
    busy(budget, 0.0, 1.0, CALL, 1.0)
    assert candidates(budget, 1.0, PLENTY) == 8


def test_calls_under_way_come_first():
    budget = Budget(8, RULES)
    busy(budget, 0.0, 1.0, CALL, 0.9)
    enough = 1.5 * CALL - RULES.late + 0.001
    assert [budget.allow(now, enough, ahead=1).candidates for now in (0.8, 1.0)] == [8, 8]
    assert [budget.allow(now, enough, ahead=2).candidates for now in (1.0, 1.25)] == [8, 4]


def test_short_calls_between_do_not_hide_the_long_ones():
    budget = Budget(8, RULES)
    for number in range(8):
        budget.spent(number / 10, CALL if number % 2 else CALL / 10)
    found = [candidates(budget, now, CALL - RULES.late - 0.001) for now in (0.7, 0.9)]
    assert found == [8, 4]


def test_when_candidates_are_few_idle_agents_are_held_and_then_new_ones_refused():
    budget = late(most=4)
    found = [budget.allow(float(t), -1.0) for t in range(6)]
    assert found == [level(2), level(1), HOLD, REFUSE, REFUSE, REFUSE]


def test_where_agents_are_distant_they_give_way_first_and_come_back_last():
    budget = late(most=4)
    found = [budget.allow(float(t), SHORT, distant=True) for t in range(4)]
    assert found == [level(4), level(2), level(1), HOLD]
    times = (3.0 + RULES.patience * step for step in range(1, 5))
    back = [budget.allow(time, PLENTY, distant=True) for time in times]
    assert back == [level(1), level(2), level(4), DegradationLevel(4)]


def test_when_nobody_is_distant_any_more_it_does_not_stay_there():
    budget = late(most=4)
    budget.allow(0.0, SHORT, distant=True)
    assert budget.allow(RULES.patience, PLENTY) == DegradationLevel(4)
    for now in (9.8, 10.0):
        budget.allow(now, SHORT, distant=True)
    assert budget.allow(11.0, SHORT).candidates == 2


def test_more_are_tried_again_after_a_calm_while():
    budget = late()
    assert candidates(budget, 0.0, SHORT) == 4
    assert candidates(budget, RULES.patience - 0.1, PLENTY) == 4
    assert candidates(budget, RULES.patience, PLENTY) == 8


def test_it_climbs_level_by_level_with_patience():
    budget = late(most=2)
    for t in range(4):
        budget.allow(float(t), -1.0)
    found = [budget.allow(100.0 + RULES.patience * step, PLENTY) for step in range(4)]
    assert found == [HOLD, level(1), DegradationLevel(2), DegradationLevel(2)]


def test_a_climb_that_was_a_mistake_is_tried_again_later_and_later():
    budget = late()
    budget.allow(0.0, SHORT)
    now, waits = 0.0, []
    for _ in range(7):
        begun = now
        while candidates(budget, now, PLENTY) == 4:
            now += 0.1
        waits.append(round(now - begun))
        for _ in range(2):
            now += RULES.settle + 0.01
            budget.allow(now, SHORT)
        assert budget.level.candidates == 4
    assert waits == [3, 6, 12, 24, 48, 60, 60]


def test_and_soon_again_when_all_was_well_for_long():
    budget = late()
    budget.allow(0.0, SHORT)
    assert candidates(budget, 3.0, PLENTY) == 8
    assert [candidates(budget, now, SHORT) for now in (3.8, 4.0)] == [8, 4]
    assert candidates(budget, 10.0, PLENTY) == 8, "after six seconds"
    again = 10.0 + RULES.most_patience
    assert [candidates(budget, now, SHORT) for now in (again, again + 0.2)] == [8, 4]
    assert candidates(budget, again + 0.2 + RULES.patience, PLENTY) == 8


def test_not_when_the_engine_would_then_be_too_busy():
    budget = late()
    assert candidates(budget, 0.0, SHORT) == 4
    now = RULES.patience
    busy(budget, now - 1.0, 1.0, CALL / 2, 0.85)
    assert candidates(budget, now, PLENTY) == 4, "it would be busy all the time"
    later = now + 10.0
    busy(budget, later - 1.0, 1.0, CALL / 2, 0.4)
    assert candidates(budget, later, PLENTY) == 8


def test_idle_agents_are_held_until_there_is_time_to_step_them_too():
    def after(held):
        budget = late(most=1)
        assert budget.allow(0.0, -1.0) == HOLD
        now = RULES.patience
        busy(budget, now - 1.0, 1.0, CALL, 0.3)
        return budget.allow(now, PLENTY, held)

    assert after(held=0.5) == DegradationLevel(1)
    assert after(held=0.9) == HOLD, "with them the engine would be busy for three times the time"


def test_nor_when_the_longer_call_would_end_too_late():
    budget = late()
    assert candidates(budget, 0.0, SHORT) == 4
    budget.spent(9.5, 0.1)
    assert candidates(budget, 10.0, 0.12) == 4
    budget = late()
    assert candidates(budget, 0.0, SHORT) == 4
    budget.spent(9.5, 0.05)
    assert candidates(budget, 10.0, 0.2) == 8


def test_one_long_call_among_many_is_no_reason():
    budget = Budget(8, RULES)
    busy(budget, 0.0, 1.0, CALL, 0.5)
    budget.spent(1.0, 0.5)
    assert candidates(budget, 1.0, PLENTY) == 8
