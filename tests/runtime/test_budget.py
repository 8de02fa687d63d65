import pytest

from wayfarer.runtime.budget import Budget, BudgetRules, rungs

RULES = BudgetRules()
CALL = 0.05  # seconds of one engine call with all candidates
PLENTY = 0.2


@pytest.mark.parametrize(
    ("most", "ladder"),
    [(8, (8, 4, 2, 1)), (10, (10, 8, 4, 2, 1)), (1, (1,)), (32, (32, 16, 8, 4, 2, 1))],
)
def test_the_ladder_begins_with_what_is_wished(most, ladder):
    assert rungs(most) == ladder


def busy(budget, start, seconds, call, share):
    """Engine calls that take up a share of the time."""
    for number in range(int(seconds / (call / share))):
        budget.spent(start + number * call / share, call)


def test_enough_time_changes_nothing():
    budget = Budget(8, RULES)
    busy(budget, 0.0, 1.0, CALL, 0.5)
    assert [budget.candidates(1.0 + t, PLENTY) for t in range(5)] == [8] * 5


def test_a_call_that_would_end_too_late_tries_fewer():
    budget = Budget(8, RULES)
    busy(budget, 0.0, 1.0, CALL, 0.9)
    assert budget.candidates(1.0, CALL + RULES.margin + 0.01) == 8
    assert budget.candidates(1.0, CALL) == 4
    assert budget.candidates(1.0 + RULES.settle / 2, CALL) == 4, "first see what it brings"
    assert budget.candidates(1.0 + RULES.settle + 0.01, CALL) == 2


def test_the_last_rung_is_one():
    budget = Budget(4, RULES)
    assert [budget.candidates(float(t), -1.0) for t in range(5)] == [2, 1, 1, 1, 1]


def test_more_are_tried_again_after_a_calm_while():
    budget = Budget(8, RULES)
    assert budget.candidates(0.0, 0.0) == 4
    assert budget.candidates(RULES.patience - 0.1, PLENTY) == 4
    assert budget.candidates(RULES.patience, PLENTY) == 8


def test_not_when_the_engine_would_then_be_too_busy():
    budget = Budget(8, RULES)
    assert budget.candidates(0.0, 0.0) == 4
    now = RULES.patience
    busy(budget, now - 1.0, 1.0, CALL / 2, 0.5)
    assert budget.candidates(now, PLENTY) == 4, "it would be busy all the time"
    later = now + 10.0
    busy(budget, later - 1.0, 1.0, CALL / 2, 0.2)
    assert budget.candidates(later, PLENTY) == 8


def test_nor_when_the_longer_call_would_end_too_late():
    budget = Budget(8, RULES)
    assert budget.candidates(0.0, 0.0) == 4
    budget.spent(9.5, 0.1)
    assert budget.candidates(10.0, 0.2) == 4
    budget = Budget(8, RULES)
    assert budget.candidates(0.0, 0.0) == 4
    budget.spent(9.5, 0.05)
    assert budget.candidates(10.0, 0.2) == 8


def test_one_long_call_among_many_is_no_reason():
    budget = Budget(8, RULES)
    busy(budget, 0.0, 1.0, CALL, 0.5)
    budget.spent(1.0, 0.5)
    assert budget.candidates(1.0, PLENTY) == 8
