"""Rules are compiled before agents walk, by two processes where two cores are free."""

import subprocess
import sys
from types import SimpleNamespace

import pytest

from wayfarer.world.scenes import prepare as rules


class FakeProcess:
    """Notes what was started, and how it ended."""

    started: list["FakeProcess"]

    def __init__(self, command, **streams):
        self.command, self.ended = command, []
        FakeProcess.started.append(self)

    def kill(self):
        self.ended.append("killed")

    def wait(self):
        self.ended.append("reaped")


@pytest.fixture
def compile_with(monkeypatch):
    """Compiles some parts; returns the other processes that were started for it."""

    def run(parts, cores=2, kept=False):
        FakeProcess.started = []
        monkeypatch.setattr(rules, "PARTS", [SimpleNamespace(prepare=part) for part in parts])
        monkeypatch.setattr(rules, "cores", lambda: cores)
        monkeypatch.setattr(rules, "is_kept", lambda _: kept)
        monkeypatch.setattr(subprocess, "Popen", FakeProcess)
        rules.prepare.__wrapped__()
        return FakeProcess.started

    return run


def test_a_second_process_compiles_from_the_end_and_is_ended(compile_with):
    done = []
    [other] = compile_with([lambda: done.append(1), lambda: done.append(2)])
    assert other.command == [sys.executable, "-m", rules.__name__]
    assert done == [1, 2] and other.ended == ["killed", "reaped"]


@pytest.mark.parametrize(("cores", "kept"), [(1, False), (2, True)])
def test_it_is_not_started_without_a_core_or_work(compile_with, cores, kept):
    assert compile_with([lambda: None], cores, kept) == []


def test_it_does_not_survive_an_error(compile_with):
    with pytest.raises(ZeroDivisionError):
        compile_with([lambda: 1 / 0])
    assert FakeProcess.started[0].ended == ["killed", "reaped"]


def test_after_preparing_nothing_is_left_to_compile():
    rules.prepare()
    assert all(rules.is_kept(part) for part in rules.PARTS)
