import os
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from tests.world.fakes import FakeEngine
from wayfarer.engines.dummy import dummy_inputs
from wayfarer.engines.row_partitioner import LEAST, NICENESS, RowPartitioner, give_way
from wayfarer.process.processor import cores

MOST = 64


def numbered(rows: int):
    inputs = dummy_inputs(rows, 1)
    inputs.goal[:, 0] = np.arange(rows)
    return inputs


class Watched:
    """A fake engine's step that records each thread's number of rows."""

    def __init__(self):
        self.parts = []

    def __call__(self, inputs):
        self.parts.append((threading.current_thread().name, len(inputs.goal)))
        return FakeEngine().step("male", inputs)


@pytest.mark.parametrize(
    ("threads", "rows", "parts"),
    [
        (1, 50, [50]),
        (2, LEAST, [LEAST]),
        (2, 2 * LEAST, [LEAST, LEAST]),
        (4, 3 * LEAST + 1, [8, 8, 9]),
        (2, 65, [32, 33]),
        (1, 72, [36, 36]),
        (2, 128, [64, 64]),
        (2, 130, [32, 32, 33, 33]),
    ],
)
def test_rows_are_parted_where_each_thread_has_enough_to_do(threads, rows, parts):
    run = Watched()
    outputs = RowPartitioner(threads).step(run, numbered(rows), MOST)
    assert sorted(count for _, count in run.parts) == sorted(parts)
    whole = FakeEngine().step("male", numbered(rows))
    assert np.array_equal(outputs.translation, whole.translation)


def test_parts_may_be_told_by_where_they_end():
    run = Watched()
    outputs = RowPartitioner(2).parted(run, numbered(70), [32, 64, 70])
    assert sorted(count for _, count in run.parts) == [6, 32, 32]
    whole = FakeEngine().step("male", numbered(70))
    assert np.array_equal(outputs.translation, whole.translation)


def test_a_single_thread_is_the_callers_own():
    run = Watched()
    RowPartitioner(1).step(run, numbered(4 * LEAST), MOST)
    assert {name for name, _ in run.parts} == {threading.current_thread().name}


def test_parts_of_two_calls_share_the_threads_in_order():
    lanes, first_may_end, order = RowPartitioner(2), threading.Event(), []

    def step(inputs):
        order.append(int(inputs.goal[0, 0]))
        assert first_may_end.wait(10)
        return FakeEngine().step("male", inputs)

    with ThreadPoolExecutor(2) as callers:
        one = callers.submit(lanes.step, step, numbered(4 * LEAST), MOST)
        while len(order) < 2:
            time.sleep(0.001)
        other = callers.submit(lanes.step, step, numbered(2 * LEAST), MOST)
        time.sleep(0.02)
        assert len(order) == 2  # the other waits for a thread
        first_may_end.set()
        assert len(one.result(10).translation) == 4 * LEAST
        assert len(other.result(10).translation) == 2 * LEAST


def test_what_a_part_raises_reaches_the_caller():
    def fail(inputs):
        if inputs.goal[0, 0] > 0:
            raise RuntimeError("the second part")
        return FakeEngine().step("male", inputs)

    with pytest.raises(RuntimeError, match="second part"):
        RowPartitioner(2).step(fail, numbered(4 * LEAST), MOST)


def test_no_number_of_threads_means_one_per_core():
    assert RowPartitioner(0).count == cores() >= 1
    assert RowPartitioner(3).sizes((1, 64)) == (1, 64, 128, 192)


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux has a priority for each thread")
def test_threads_that_give_way_make_threads_that_do():
    def niceness():
        return os.getpriority(os.PRIO_PROCESS, threading.get_native_id())

    def inherited():
        with ThreadPoolExecutor(1) as pool:
            return pool.submit(niceness).result()

    before = niceness()
    with ThreadPoolExecutor(1, initializer=give_way) as pool:
        found = pool.submit(lambda: (niceness(), inherited())).result()
    assert found == (min(before + NICENESS, 19),) * 2
    assert niceness() == before
