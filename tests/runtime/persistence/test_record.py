"""The content and size of a log, and the refusal of a log forged by a client."""

import json
from functools import cache
from itertools import islice

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.runtime.kept_worlds import STICK, fake_worlds
from tests.world.fakes import people, taken
from wayfarer.config.limits import Limits
from wayfarer.errors import FailedPrecondition, InvalidArgument, WayfarerError
from wayfarer.runtime.persistence.container import ContainerKind, seal, unseal
from wayfarer.runtime.persistence.log_format import LogOrigin, decode_log, encode_log
from wayfarer.runtime.persistence.record import AgentTrack, ChunkRun
from wayfarer.runtime.persistence.replay import replay
from wayfarer.world.agents.agent import SessionSpec
from wayfarer.world.agents.goal import Goal
from wayfarer.world.behaviours import Wander
from wayfarer.world.goals.commands import Path, Stop
from wayfarer.world.stepping.budget import DegradationLevel

SPEC = SessionSpec("s", record=True)
ENTRIES = 500


def recorded(log_entries=ENTRIES):
    worlds = fake_worlds(limits=Limits(log_entries=log_entries))
    world = worlds.live()
    world.create_session(SPEC, 0.0)
    a, b = (agent.agent_id for agent in world.create_agents("s", people(2), 0.0))
    world.give(a, Wander((0.0, 0.0), 5.0), 0.0)
    world.give(b, Path((Goal((0.0, 3.0, 0.0)), Goal((3.0, 3.0, 0.0)))), 0.0)
    list(world.advance(2.0))
    return worlds, world, b


def origin(worlds, **changes):
    found = {"body": worlds.body, "models": worlds.models.stamps, "candidates": 4}
    return LogOrigin(**(found | changes))


def test_chunks_that_are_alike_are_one_run():
    worlds, _world, _ = recorded()
    for track in worlds.recordings.copy("s").tracks.values():
        assert len(track.runs) == 1 and len(track.schedules) == 1
        assert track.end > 5
    assert (
        worlds.recordings.copy("s").size == 2 * (1 + 1 + 1) + 1 + 2
    )  # tracks; one order, one of two goals


def test_what_is_planned_again_is_counted_once_and_said():
    track = AgentTrack("a", 1, 0.0, people(1)[0])
    for seq, candidates in [(0, 4), (1, 4), (2, 4), (1, 2), (2, 2), (3, 2)]:
        track.plan(ChunkRun(seq, candidates, "m"))
    assert track.runs == [
        ChunkRun(0, 4, "m"),
        ChunkRun(1, 2, "m", replanned=True),
        ChunkRun(2, 2, "m"),
    ]


def test_a_log_that_outgrows_its_limit_is_given_up_and_says_so():
    worlds, world, b = recorded(log_entries=20)
    for number in range(10):
        world.give(b, Path((Goal((0.0, 3.0, 0.0)), Goal((3.0, 3.0, 0.0)))), 2.0)
        if number < 4:
            worlds.recordings.copy("s")
    list(world.advance(4.0))
    with pytest.raises(FailedPrecondition, match=r"outgrown limits\.log_entries, 20"):
        worlds.recordings.copy("s")
    world.delete_session("s")
    world.create_session(SPEC, 5.0)
    assert worlds.recordings.copy("s").tracks == {}, "a new session begins a new log"


def test_an_exported_log_does_not_change():
    worlds, world, b = recorded()
    log = worlds.recordings.copy("s")
    before = log.tracks[b].end
    world.give(b, Stop(), 2.0)
    list(world.advance(5.0))
    assert log.tracks[b].end == before and len(log.tracks[b].entries) == 1


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"body": type(STICK)("other", {})}, "made with body 'stick'"),
        ({"models": ("another@00",)}, "would make other motion"),
        ({"candidates": 8}, "`candidates` 4; this server has 8"),
    ],
)
def test_a_log_of_something_else_is_refused(changes, text):
    worlds, _world, _ = recorded()
    data = encode_log(worlds.recordings.copy("s"), origin(worlds))
    with pytest.raises(FailedPrecondition, match=text):
        decode_log(data, origin(worlds, **changes), worlds.settings.limits, ENTRIES)


def test_more_entries_than_a_server_records_are_refused():
    worlds, _world, _ = recorded()
    data = encode_log(worlds.recordings.copy("s"), origin(worlds))
    with pytest.raises(InvalidArgument, match="entries; allowed: 5"):
        decode_log(data, origin(worlds), worlds.settings.limits, 5)


def edited(path, value):
    worlds, _world, _ = recorded()
    text, arrays = unseal(
        ContainerKind.LOG, encode_log(worlds.recordings.copy("s"), origin(worlds)), 1 << 20
    )
    whole = header = json.loads(text)
    *way, last = path.split(".")
    for step in way:
        header = header[int(step) if step.isdigit() else step]
    header[int(last) if last.isdigit() else last] = value
    return worlds, seal(ContainerKind.LOG, json.dumps(whole).encode(), arrays)


def play(worlds, data, most=None):
    log = decode_log(data, origin(worlds), worlds.settings.limits, ENTRIES)
    return list(islice(replay(log, worlds.solo), most))


@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("fps", 25),
        ("session_id", "a b"),
        ("tracks.0.agent_id", "x" * 65),
        ("tracks.0.alias", 0),
        ("tracks.0.end", -1),
        ("tracks.0.end", 2**80),
        ("tracks.0.end", 1_000_000),
        ("tracks.0.runs", []),
        ("tracks.0.runs", [{"first": 1, "candidates": 4, "model": "fake@"}]),
        ("tracks.0.runs.0.candidates", 100_000),
        ("tracks.0.runs.0.candidates", -1),
        ("tracks.0.runs.0.candidates", 64),
        ("tracks.0.runs.0.model", "unknown"),
        ("tracks.0.schedules", []),
        ("tracks.0.schedules.0.at", float("nan")),
        ("tracks.0.schedules.0.at", 1e300),
        ("tracks.0.entries.0.seq", -3),
        ("tracks.0.entries.0.seq", 2**40),
        ("tracks.0.entries.0", {"seq": 0}),
        ("tracks.0.entries.0", {"seq": 0, "clear_goal": True, "change": {}}),
        ("tracks.0.entries.0.behaviour", {"center": [0, 0], "radius": -1}),
        ("tracks.1.entries.0.set_path.0.position", [1e30, 0, 0]),
        ("tracks.1.entries.0.set_path", []),
        ("tracks.0.spec", None),
        ("tracks.0.spec.gender", "none"),
        ("tracks.0.record", {}),
        ("tracks.0.restarts", [{}]),
    ],
)
def test_logs_are_checked_field_by_field(path, value):
    worlds, data = edited(path, value)
    with pytest.raises((InvalidArgument, FailedPrecondition)) as caught:
        play(worlds, data)
    assert str(caught.value)


def test_held_chunks_that_nobody_would_hold_are_noticed():
    worlds, data = edited("tracks.0.runs.0.candidates", 0)  # a wanderer has something to do
    with pytest.raises(FailedPrecondition, match="altered"):
        play(worlds, data)


@cache
def some_log():
    worlds, _world, _ = recorded()
    return worlds, unseal(
        ContainerKind.LOG, encode_log(worlds.recordings.copy("s"), origin(worlds)), 1 << 20
    )


@settings(max_examples=100)
@given(st.data())
def test_no_change_of_bytes_does_more_than_be_refused(data):
    worlds, (text, _) = some_log()
    inner = bytearray(text)
    for _ in range(data.draw(st.integers(1, 4))):
        place = data.draw(st.integers(0, len(inner) - 1))
        inner[place : place + data.draw(st.integers(0, 5))] = data.draw(st.binary(max_size=5))
    try:
        play(
            worlds,
            seal(ContainerKind.LOG, bytes(inner), data.draw(st.binary(max_size=30))),
            most=20,
        )
    except WayfarerError as error:
        assert str(error)


def test_a_session_that_goes_on_after_a_restart_begins_a_new_log():
    worlds, world, b = recorded()
    record = taken(world)
    again = worlds.live()
    again.members.put_session(record, 100.0)
    assert worlds.recordings.copy("s").tracks[b].end == record.agents[1].seq
    again.step(101.0, DegradationLevel(1))
