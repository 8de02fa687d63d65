from dataclasses import dataclass

import pytest

from tests.world.fakes import ManualClock
from wayfarer.errors import Unavailable
from wayfarer.ids import session_id
from wayfarer.workers.messages import DOWN, Report
from wayfarer.workers.placement import REMEMBERED, Placement


@dataclass
class Worker:
    report: Report


def ready(agents: int = 0, sessions: int = 0) -> Worker:
    return Worker(Report(alive=True, ready=True, started=True, agents=agents, sessions=sessions))


def test_new_sessions_are_spread_before_any_report_tells_of_them():
    placement = Placement([ready(), ready(), ready()])
    assert sorted(placement.choose() for _ in range(6)) == [0, 0, 1, 1, 2, 2]


def test_sessions_go_where_the_fewest_people_are():
    placement = Placement([ready(40, 2), ready(10, 2), ready(30, 2)], ManualClock(0.0))
    assert placement.choose() == 1
    # a new session counts as much as the mean one holds: 13
    assert [placement.choose() for _ in range(3)] == [1, 2, 1]


def test_what_was_placed_is_forgotten_once_reports_tell_of_it():
    clock = ManualClock(0.0)
    workers = [ready(), ready()]
    placement = Placement(workers, clock)
    assert [placement.choose() for _ in range(2)] == [0, 1]
    clock.now = 10.0
    workers[1].report = ready(5, 1).report
    assert placement.choose() == 0


def test_a_request_that_is_sent_twice_goes_where_it_went():
    placement = Placement([ready(), ready()])
    first = placement.choose("a")
    assert {placement.choose("a") for _ in range(5)} == {first}
    assert placement.choose("b") != first


def test_request_ids_are_remembered_within_bounds():
    placement = Placement([ready(), ready()])
    for number in range(REMEMBERED + 10):
        placement.choose(str(number))
    assert len(placement._chosen) == REMEMBERED


def test_workers_that_are_not_ready_get_nothing_new():
    workers = [Worker(DOWN), ready(50, 5)]
    placement = Placement(workers)
    assert {placement.choose() for _ in range(4)} | {placement.any()} == {1}
    workers[1].report = DOWN
    with pytest.raises(Unavailable, match="no worker is ready"):
        placement.choose()


def test_a_session_is_found_by_its_id_even_while_its_worker_is_down():
    placement = Placement([ready(), Worker(DOWN), ready()])
    assert placement.find(session_id(4)) == 1
