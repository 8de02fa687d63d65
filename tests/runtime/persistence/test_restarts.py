"""The log of a session that resumed on another server in its last state, as servers before
2026-11-28 wrote it for sessions in lock-step.
"""

import pytest

from tests.runtime.kept_worlds import STICK, fake_worlds
from tests.runtime.persistence.test_replay import (
    RECORDED,
    assert_same,
    busy_levels,
    busy_plan,
    replayed,
    run,
)
from tests.world.fakes import people
from wayfarer.config.limits import Limits
from wayfarer.errors import FailedPrecondition
from wayfarer.runtime.persistence.capture import capture_session
from wayfarer.runtime.persistence.log_format import LogOrigin, decode_log, encode_log
from wayfarer.runtime.persistence.record import RESTART_COST
from wayfarer.runtime.persistence.session_record import encode_record
from wayfarer.runtime.persistence.snapshot import decode_session
from wayfarer.world.agents.goal import Goal
from wayfarer.world.goals.commands import Append, Path

ENTRIES = 2000


def begun(count=5):
    worlds = fake_worlds(limits=Limits(log_entries=ENTRIES))
    world = worlds.live()
    world.create_session(RECORDED, 0.0)
    return worlds, world, [agent.agent_id for agent in world.create_agents("s", people(count), 0.0)]


def moved(worlds, world, now):
    """Another server with the session, its log from here, and where its agents are there."""
    origin = LogOrigin(STICK, worlds.models.stamps, 4)
    sent = encode_log(worlds.recordings.copy("s"), origin)
    record = decode_session(encode_record(capture_session(world, "s"), STICK), STICK, Limits())
    there = fake_worlds(limits=Limits(log_entries=ENTRIES))
    resumed = there.live()
    resumed.members.put_session(record, now)
    log = decode_log(sent, origin, Limits(), ENTRIES)
    return there, resumed, log, {agent.agent_id: agent.seq for agent in record.agents}


def restarted(recordings, log):
    """Continues a log with agents that have begun here as they stood."""
    for name, after in recordings._logs["s"].tracks.items():
        if name in log.tracks:
            restart(log.tracks[name], after)
    recordings.go_on(log, "s")


def restart(track, after):
    """Orders for chunks that were still to come at that time are in the record, or void."""
    seq = after.first
    track.entries = [entry for entry in track.entries if entry.seq < seq] + after.entries
    track.runs = [run for run in track.runs if run.first < seq] + after.runs
    track.schedules = [s for s in track.schedules if s.first < seq] + after.schedules
    track.planned, track.end = after.planned, after.end
    if seq > track.first:
        track.restarts.append(after.start)
    else:
        track.start = after.start


def test_who_lives_on_elsewhere_is_replayed_bit_for_bit_on_both_sides_of_the_jump():
    worlds, world, ids = begun()
    plan = busy_plan(world, ids)
    seen = run(world, 2.53, [step for step in plan if step[0] < 2.5], busy_levels)
    for now in (2.53, 4.13):  # once in mid-part of a routine, and again from there
        world.give(ids[0], Goal((now, -2.0, 0.0)), now)  # nothing of it has been sent
        seen += run(world, 0.4, [], busy_levels, start=now)
        there, resumed, log, reached = moved(worlds, world, now + 2.0)
        seen = [c for c in seen if c.seq < reached.get(c.agent_id, c.seq + 1)]
        seen += run(resumed, 0.3, [], busy_levels, start=now + 2.0)  # before the log is there
        restarted(there.recordings, log)
        worlds, world, start = there, resumed, now + 2.3
        world.give(ids[1], Path((Goal((2.0, 2.0, 0.0)), Goal((0.0, 2.0, 0.0)))), start)
        world.give(ids[1], Append((Goal((3.0, 3.0, 0.0)),)), start)
        if now > 3:
            world.delete_agent(ids[2])
            [new] = world.create_agents("s", people(1), start)
            world.give(new.agent_id, Goal((0.0, 5.0, 0.0)), start)
        seen += run(world, 3.0, [], busy_levels, start=start)
    tracks = worlds.recordings.copy("s").tracks
    assert [len(track.restarts) for track in tracks.values()] == [2, 2, 2, 2, 2, 0]
    assert_same(replayed(worlds, world), seen)


def test_who_had_not_begun_begins_where_it_lives_on():
    worlds, world, _ = begun(1)
    there, resumed, log, _ = moved(worlds, world, 5.0)
    restarted(there.recordings, log)
    sent = run(resumed, 2.0, [], start=5.0)
    [track] = there.recordings.copy("s").tracks.values()
    assert track.restarts == []
    assert_same(replayed(there, resumed), sent)


def test_a_restart_counts_for_the_limit_and_beyond_it_the_log_is_given_up():
    worlds, world, _ = begun(3)
    run(world, 1.0, [])
    there, _, log, _ = moved(worlds, world, 5.0)
    before = log.size
    restarted(there.recordings, log)
    assert there.recordings.copy("s").size == before + 3 * RESTART_COST
    small, _, log, _ = moved(worlds, world, 5.0)
    small.recordings._limit = before + 1
    restarted(small.recordings, log)
    with pytest.raises(FailedPrecondition, match="outgrown"):
        small.recordings.copy("s")
