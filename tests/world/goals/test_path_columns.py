from math import radians

import numpy as np
import pytest

from wayfarer.world.agents.goal import Goal, goal_columns
from wayfarer.world.agents.slots import SlotTable
from wayfarer.world.goals.path_columns import PathColumns

HERE = (0.0, 0.0)


def row(number):
    return np.array([number])


def test_each_slot_has_its_own_goals():
    table = SlotTable(limit=4, capacity=2)
    paths = PathColumns(table.rows, limit=3)
    paths.put(0, [Goal((1, 0, 0)), Goal((2, 0, 0)), Goal((3, 0, 0))], HERE)
    paths.put(1, [Goal((9, 0, 0), heading=radians(90), dwell=2.0)], HERE)
    found = paths.at(np.array([0, 1, 0]), np.array([2, 0, 1]))
    assert found.position[:, 0].tolist() == [3, 9, 2]
    assert found.more.tolist() == [False, False, True]
    assert found.given.all() and found.dwell.tolist() == [0, 2, 0]
    np.testing.assert_allclose(found.heading, [[0, 0], [-1, 0], [0, 0]], atol=1e-6)


def test_a_shorter_path_replaces_a_longer_one_and_none_all():
    paths = PathColumns(SlotTable(limit=1).rows, limit=3)
    paths.put(0, [Goal((1, 0, 0)), Goal((2, 0, 0))], HERE)
    paths.put(0, [Goal((5, 0, 0), stop=False)], HERE)
    found = paths.at(row(0), row(0))
    assert found.position[0, 0] == 5 and found.through[0] and not found.more[0]
    paths.put(0, [], HERE)
    assert not paths.at(row(0), row(0)).given[0]


def test_grows_with_the_table():
    table = SlotTable(limit=8, capacity=1)
    paths = PathColumns(table.rows, limit=2)
    paths.put(table.acquire(1)[0], [Goal((1, 0, 0))], HERE)
    slots = [table.acquire(1)[0] for _ in range(7)]
    assert not paths.at(np.array(slots), np.zeros(7, int)).given.any()
    paths.put(slots[-1], [Goal((2, 0, 0))], HERE)
    assert paths.at(row(0), row(0)).position[0, 0] == 1


def test_bends_are_those_of_the_way_walked():
    corners = [(0, 2), (2, 2), (2, 4), (2, 2), (-1, 2.0)]
    made = goal_columns([Goal((*c, 0.0)) for c in corners], HERE)
    assert np.degrees(made.bend).tolist() == pytest.approx([90, 90, 180, 90, 0], abs=1e-3)


def line(*xs):
    return [Goal((x, 0, 0), stop=False) for x in xs]


def test_goals_keep_their_numbers_while_a_path_goes_round_its_ring():
    paths = PathColumns(SlotTable(limit=2, capacity=2).rows, limit=4)
    paths.put(1, line(100), HERE)
    for first in range(20):
        paths.put(0, line(first, first + 1, first + 2), (first - 1.0, 0.0), first)
        found = paths.at(np.zeros(3, int), np.arange(first, first + 3))
        assert found.position[:, 0].tolist() == [first, first + 1, first + 2]
        is_last = paths.is_last(np.zeros(3, int), np.arange(first, first + 3))
        assert is_last.tolist() == [False, False, True]
    assert paths.at(row(1), row(0)).position[0, 0] == 100, "the other slot's path is untouched"


def test_a_long_path_makes_room_and_leaves_the_others_where_they_are():
    paths = PathColumns(SlotTable(limit=2, capacity=2).rows, limit=40)
    paths.put(1, line(5, 6, 7, 8), HERE, 5)
    paths.put(0, line(*range(33)), HERE)
    found = paths.at(np.ones(4, int), np.arange(5, 9))
    assert found.position[:, 0].tolist() == [5, 6, 7, 8]
    assert paths.places(np.zeros(33, int), np.arange(33))[:, 0].tolist() == [*range(33)]


def test_a_slot_without_goals_has_no_next_one():
    paths = PathColumns(SlotTable(limit=1).rows, limit=2)
    paths.put(0, [], HERE, 7)
    assert paths.is_last(row(0), row(7)).all() and not paths.at(row(0), row(7)).given.any()
