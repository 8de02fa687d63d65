"""Engine calls beside the motion thread: their order, their times, and one that fails."""

import threading
import time
from types import SimpleNamespace

import pytest

from wayfarer.runtime.crew import FLIGHTS, Crew


class Bench:
    """A crew whose calls last until they are let go, and whose time is set by hand."""

    def __init__(self):
        self.now = 0.0
        self.woken = threading.Semaphore(0)
        self.crew = Crew(lambda: self.now, self.woken.release)

    def send(self, fail=None):
        """Begin a call; returns what lets it go."""
        let_go = threading.Event()

        def call():
            assert let_go.wait(10)
            if fail is not None:
                raise fail

        assert self.crew.send_off(lambda launch: SimpleNamespace(outputs=launch(call)))
        return let_go

    def land(self, let_go, at):
        """Let a call end at that time."""
        self.now = at
        let_go.set()
        assert self.woken.acquire(timeout=10)


@pytest.fixture
def bench():
    made = Bench()
    yield made
    made.crew.close()


def test_there_is_room_for_two(bench):
    calls = [bench.send() for _ in range(FLIGHTS)]
    assert not bench.crew.has_room
    assert not bench.crew.has_landed and not list(bench.crew.landed())
    bench.land(calls[0], 0.1)
    assert len(list(bench.crew.landed())) == 1
    assert bench.crew.has_room
    bench.land(calls[1], 0.2)


def test_nothing_to_begin_takes_no_room(bench):
    assert not bench.crew.send_off(lambda launch: None)
    assert bench.crew.has_room and bench.crew.age(5.0) == 0.0


def test_calls_are_taken_in_in_the_order_in_which_they_were_begun(bench):
    first, second = bench.send(), bench.send()
    bench.land(second, 0.1)
    assert not bench.crew.has_landed
    bench.land(first, 0.3)
    assert len(list(bench.crew.landed())) == 2


def test_of_each_the_time_counts_for_which_the_engine_was_at_it_alone(bench):
    first = bench.send()
    bench.now = 0.1
    second = bench.send()
    bench.land(first, 0.3)
    bench.land(second, 0.5)
    assert [seconds for _, seconds in bench.crew.landed()] == pytest.approx([0.3, 0.2])


def test_the_age_is_that_of_the_oldest_call(bench):
    first = bench.send()
    bench.now = 1.0
    second = bench.send()
    assert bench.crew.age(3.0) == 3.0
    bench.land(first, 3.0)
    list(bench.crew.landed())
    assert bench.crew.age(3.0) == 2.0
    bench.land(second, 4.0)
    list(bench.crew.landed())
    assert bench.crew.age(5.0) == 0.0


def test_a_call_that_fails_lands_and_leaves_the_next_one_alone(bench):
    first, second = bench.send(RuntimeError("the engine broke down")), bench.send()
    bench.land(first, 0.1)
    bench.land(second, 0.2)
    landed = bench.crew.landed()
    with pytest.raises(RuntimeError, match="broke down"):
        next(landed)[0].outputs()
    landed.close()
    assert bench.crew.has_landed
    [(flight, _)] = bench.crew.landed()
    assert flight.outputs() is None


def test_waking_comes_when_the_result_can_be_had(bench):
    let_go = bench.send()
    bench.land(let_go, 0.1)
    deadline = time.monotonic() + 10
    while not bench.crew.has_landed:
        assert time.monotonic() < deadline
