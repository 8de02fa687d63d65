"""Engine calls of another thread: their order, their times, and a failing one."""

import threading
import time
from types import SimpleNamespace

import pytest

from wayfarer.runtime.pipeline import DEPTH, EnginePipeline


class Bench:
    """A pipeline whose calls last until they are released, and whose time is set by hand."""

    def __init__(self):
        self.now = 0.0
        self.woken = threading.Semaphore(0)
        self.pipeline = EnginePipeline(lambda: self.now, self.woken.release)

    def send(self, fail=None):
        """Begin a call; returns the function that releases it."""
        let_go = threading.Event()

        def call():
            assert let_go.wait(10)
            if fail is not None:
                raise fail

        assert self.pipeline.submit(lambda launch: SimpleNamespace(outputs=launch(call)))
        return let_go

    def land(self, let_go, at):
        """End a call at that time."""
        self.now = at
        let_go.set()
        assert self.woken.acquire(timeout=10)


@pytest.fixture
def bench():
    made = Bench()
    yield made
    made.pipeline.close()


def test_there_is_room_for_two(bench):
    calls = [bench.send() for _ in range(DEPTH)]
    assert not bench.pipeline.has_room
    assert not bench.pipeline.has_completed and not list(bench.pipeline.completed())
    bench.land(calls[0], 0.1)
    assert len(list(bench.pipeline.completed())) == 1
    assert bench.pipeline.has_room
    bench.land(calls[1], 0.2)


def test_nothing_to_begin_takes_no_room(bench):
    assert not bench.pipeline.submit(lambda launch: None)
    assert bench.pipeline.has_room and bench.pipeline.age(5.0) == 0.0


def test_calls_are_taken_in_in_the_order_in_which_they_were_begun(bench):
    first, second = bench.send(), bench.send()
    bench.land(second, 0.1)
    assert not bench.pipeline.has_completed
    bench.land(first, 0.3)
    assert len(list(bench.pipeline.completed())) == 2


def test_of_each_the_time_counts_for_which_the_engine_was_at_it_alone(bench):
    first = bench.send()
    bench.now = 0.1
    second = bench.send()
    bench.land(first, 0.3)
    bench.land(second, 0.5)
    assert [seconds for _, seconds in bench.pipeline.completed()] == pytest.approx([0.3, 0.2])


def test_the_age_is_that_of_the_oldest_call(bench):
    first = bench.send()
    bench.now = 1.0
    second = bench.send()
    assert bench.pipeline.age(3.0) == 3.0
    bench.land(first, 3.0)
    assert bench.pipeline.age(3.0) == 2.0, "also before the first one is taken out"
    list(bench.pipeline.completed())
    assert bench.pipeline.age(3.0) == 2.0
    bench.land(second, 4.0)
    assert bench.pipeline.age(5.0) == 0.0 and not bench.pipeline.is_idle
    list(bench.pipeline.completed())
    assert bench.pipeline.age(5.0) == 0.0 and bench.pipeline.is_idle


def test_a_call_that_fails_lands_and_leaves_the_next_one_alone(bench):
    first, second = bench.send(RuntimeError("the engine broke down")), bench.send()
    bench.land(first, 0.1)
    bench.land(second, 0.2)
    completed = bench.pipeline.completed()
    with pytest.raises(RuntimeError, match="broke down"):
        next(completed)[0].outputs()
    completed.close()
    assert bench.pipeline.has_completed
    [(step, _)] = bench.pipeline.completed()
    assert step.outputs() is None


def test_waking_comes_when_the_result_can_be_had(bench):
    let_go = bench.send()
    bench.land(let_go, 0.1)
    deadline = time.monotonic() + 10
    while not bench.pipeline.has_completed:
        assert time.monotonic() < deadline
