"""Memory over a run, of a server whose memory the test sets."""

import asyncio
import time

from wayfarer_lab.load.run import MemoryWatch


class Server:
    """Has a given number of megabytes."""

    megabytes: float | None = 100.0

    def resident_megabytes(self) -> float | None:
        return self.megabytes


def watched(values, start):
    server = Server()
    watch = MemoryWatch(server, start, start + 10)
    for value in values:
        server.megabytes = value
        watch.sample()
    return watch.summary()


def test_growth_counts_from_the_end_of_the_warm_up():
    summary = watched([100.0, 200.0, 210.0], start=time.time() - 1)  # all of it is measured
    assert (summary["start"], summary["warm"], summary["end"]) == (100.0, 100.0, 210.0)
    assert summary["growth"] == 1.1


def test_what_the_warm_up_takes_is_not_growth():
    server = Server()
    watch = MemoryWatch(server, time.time() + 0.05, time.time() + 10)
    watch.sample()
    server.megabytes = 200.0
    time.sleep(0.1)
    watch.sample()
    server.megabytes = 201.0
    watch.sample()
    summary = watch.summary()
    assert (summary["start"], summary["warm"], summary["end"]) == (100.0, 200.0, 201.0)
    assert summary["growth"] == 0.005
    assert [megabytes for _, megabytes in summary["samples"]] == [100.0, 200.0, 201.0]


def test_nothing_is_told_of_a_server_that_is_not_ours():
    server = Server()
    server.megabytes = None
    watch = MemoryWatch(server, time.time(), time.time() + 10)
    asyncio.run(watch.run())  # ends by itself
    assert watch.summary() is None
