"""The cells of the floor: a rule that asks them finds everybody nearby."""

import numpy as np

from tests.world.scenes.test_making_way import around
from wayfarer.process.compiled import compiled
from wayfarer.world.avoidance.people import People
from wayfarer.world.scenes.asks import Asks, find_asks
from wayfarer.world.scenes.cells import CELL, beside, cells_of
from wayfarer.world.scenes.nearest_obstacles import nearest_people
from wayfarer.world.scenes.people import Gathering


@compiled
def looked_at(cells, first, place, found):
    """Counts in `found` [N, N] how often each person looks at each other one."""
    for me in range(len(first)):
        for side in range(-1, 2):
            begin, end = beside(cells, first[me], place[me, 0], place[me, 1], side)
            for k in range(begin, end):
                found[me, cells.rows[k]] += 1


def test_everybody_nearby_in_ones_session_is_looked_at_once():
    random = np.random.default_rng(0)
    first = np.repeat([0, 120, 121], [120, 1, 179])
    place = random.uniform(-9, 9, (300, 2)).astype(np.float32)
    place[:20] += 9000
    found = np.zeros((300, 300), np.int64)
    looked_at(cells_of(first, place), first, place, found)
    mates = first[:, None] == first
    near = mates & (np.linalg.norm(place[:, None] - place, axis=-1) <= CELL)
    assert found.max() == 1 and not (found > mates).any()
    assert (found[near] == 1).all() and found.sum() < mates.sum() / 2


def test_of_equally_near_people_the_first_is_found_wherever_its_cell_is():
    for sign in (1, -1):  # the first row is in the first cell, or in the last one
        people = [{"at": (0.3 * sign, 0)}, {"at": (-0.3 * sign, 0)}]
        asks = Asks.empty(1)
        zero, flag = np.zeros((1, 2), np.float32), np.zeros(1, np.bool_)
        find_asks(around(*people), np.zeros(1, np.int64), zero, zero, ~flag, flag, asks)
        assert asks.touches[0] == 1
        crowd, rows = People.empty(3), np.arange(3)
        crowd.position[1:] = [one["at"] for one in people]
        own = np.zeros(3, np.int64), np.full(3, 3)
        cells, found = cells_of(own[0], crowd.position), np.full((1, 1, 7), -1, np.float32)
        gathering = Gathering(crowd, rows, own, np.zeros(3, np.bool_), rows, cells)
        nearest_people(gathering, rows[:1], rows[:1], 1, found)
        assert found[0, 0, 0] == crowd.position[1, 0]
