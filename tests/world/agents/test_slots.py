import numpy as np
import pytest

from wayfarer.errors import ResourceExhausted
from wayfarer.world.agents.slots import Mode, Slots, SlotTable


def test_put_and_take_reach_nested_columns():
    slots = Slots.empty(3)
    slots.planned.gait.speed[:] = [1, 2, 3]
    taken = slots.take(np.array([2, 0]))
    assert taken.planned.gait.speed.tolist() == [3, 1]
    taken.planned.gait.speed[:] = 9
    assert slots.planned.gait.speed.tolist() == [1, 2, 3], "take gives a copy"
    slots.put(np.array([1, 2]), taken)
    assert slots.planned.gait.speed.tolist() == [1, 9, 9]


def test_growth_keeps_rows():
    table = SlotTable(limit=5, capacity=2)
    slots = table.acquire(1) + table.acquire(4)
    assert sorted(slots) == [0, 1, 2, 3, 4]
    assert table.capacity == 5
    assert table.rows.active.all()


def test_limit_is_refused_with_a_message():
    table = SlotTable(limit=3)
    table.acquire(2)
    with pytest.raises(ResourceExhausted, match="1 of 3 agent slots are free, not 2"):
        table.acquire(2)
    assert table.free == 1, "all or none"
    table.acquire(1)


def test_released_slot_comes_back_clean():
    table = SlotTable(limit=1)
    [slot] = table.acquire(1)
    table.rows.goal_revision[slot] = 3
    table.rows.planned.gait.mode[slot] = Mode.WALKING
    table.release(slot)
    assert not table.rows.active[slot]
    assert table.acquire(1) == [slot]
    assert table.rows.goal_revision[slot] == 0
    assert table.rows.planned.gait.mode[slot] == Mode.STANDING
