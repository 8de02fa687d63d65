"""A log is copied part by part while it grows; a server resumes from the complete copy."""

import random

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
from tests.world.fakes import people, taken
from wayfarer.config.limits import Limits
from wayfarer.errors import FailedPrecondition, InvalidArgument, WayfarerError
from wayfarer.runtime.persistence.capture import capture_session
from wayfarer.runtime.persistence.log_copy import encode_part, join_parts
from wayfarer.runtime.persistence.log_format import LogOrigin
from wayfarer.runtime.persistence.record import RESTART_COST, UNCOPIED
from wayfarer.runtime.persistence.session_record import encode_record
from wayfarer.runtime.persistence.snapshot import decode_session
from wayfarer.world.agents.goal import Goal
from wayfarer.world.goals.commands import Append, Path, Stop

ENTRIES = 2000


class Copied:
    """The log of a session, copied on request."""

    def __init__(self, worlds):
        self.worlds, self.mark, self.parts = worlds, UNCOPIED, []

    @property
    def origin(self):
        return LogOrigin(STICK, self.worlds.models.stamps, 4)

    def copy(self, _now=None):
        news = self.worlds.recordings.since("s", self.mark)
        self.mark = news.mark
        if part := encode_part(news, self.origin):
            self.parts.append(part)

    def log(self, most=ENTRIES):
        return join_parts(self.parts, self.origin, Limits(), most)


def server(**limits):
    return fake_worlds(limits=Limits(**{"log_entries": ENTRIES} | limits))


def begun(worlds, count=5):
    world = worlds.live()
    world.create_session(RECORDED, 0.0)
    return world, [agent.agent_id for agent in world.create_agents("s", people(count), 0.0)]


def sent_only(track, end):
    """The entries that apply to chunks before `end`."""
    return (
        track.start,
        [entry for entry in track.entries if entry.seq < end],
        [run for run in track.runs if run.first < end],
        track.schedules,
    )


@pytest.mark.parametrize("seed", [1, 2])
def test_the_parts_are_the_log_whenever_they_were_taken(seed):
    worlds = server()
    world, ids = begun(worlds)
    copied, rng = Copied(worlds), random.Random(seed)
    moments = sorted(rng.uniform(0, 10) for _ in range(40))
    plan = [*busy_plan(world, ids), *((at, copied.copy) for at in moments)]
    run(world, 10.0, sorted(plan, key=lambda both: both[0]), busy_levels)
    copied.copy()
    found, log = copied.log(), worlds.recordings.copy("s")
    assert list(found.tracks) == list(log.tracks)
    for name, track in log.tracks.items():
        assert sent_only(found.tracks[name], track.end) == sent_only(track, track.end)
    deleted = found.tracks[ids[2]]
    assert deleted.end == log.tracks[ids[2]].end, "it has come to its end"


def test_where_nothing_happens_nothing_is_copied():
    worlds = server()
    world, ids = begun(worlds, 2)
    copied = Copied(worlds)
    for second in range(6):
        run(world, 1.0, [], start=float(second))
        copied.copy()
    assert len(copied.parts) == 1
    world.give(ids[0], Stop(), 6.0)
    run(world, 1.0, [], start=6.0)
    copied.copy()
    assert len(copied.parts) == 2 and len(copied.parts[1]) < len(copied.parts[0])


def adopted(world, copied, now):
    """The session in another server, and its state there."""
    copied.copy()
    data = encode_record(capture_session(world, "s"), STICK)
    record = decode_session(data, STICK, Limits())
    there = server()
    lives_on = there.live()
    lives_on.members.put_session(record, now)
    return there, lives_on, {agent.agent_id: agent.seq for agent in record.agents}


def test_who_lives_on_elsewhere_is_replayed_bit_for_bit_on_both_sides_of_the_jump():
    worlds = server()
    world, ids = begun(worlds)
    plan = busy_plan(world, ids)
    seen = run(world, 2.53, [step for step in plan if step[0] < 2.5], busy_levels)
    for now in (2.53, 4.13):  # once in mid-part of a routine, and again from there
        world.give(ids[0], Goal((now, -2.0, 0.0)), now)  # nothing of it has been sent
        copied = Copied(worlds)
        copied.copy()
        seen += run(world, 0.4, [], busy_levels, start=now)
        there, lives_on, reached = adopted(world, copied, now + 2.0)
        seen = [c for c in seen if c.seq < reached.get(c.agent_id, c.seq + 1)]
        seen += run(lives_on, 0.3, [], busy_levels, start=now + 2.0)  # before the log is there
        there.recordings.go_on(copied.log(), "s", restarted=True)
        worlds, world, start = there, lives_on, now + 2.3
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


def test_the_copy_begins_again_with_a_new_log_under_the_same_id():
    worlds = server()
    world, _ = begun(worlds, 2)
    run(world, 1.0, [])
    record = taken(world)
    world.create_agents("s", people(1), 1.0)
    copied = Copied(worlds)
    copied.copy()
    world.delete_session("s")
    world.members.put_session(record, 1.0)  # within a second: its absence was not noticed
    run(world, 1.0, [], start=1.0)
    copied.parts.clear()
    copied.copy()
    assert list(copied.log().tracks) == [agent.agent_id for agent in record.agents]


def test_who_had_not_begun_begins_where_it_lives_on():
    worlds = server()
    world, _ = begun(worlds, 1)
    there, lives_on, _ = adopted(world, copied := Copied(worlds), 5.0)
    there.recordings.go_on(copied.log(), "s", restarted=True)
    sent = run(lives_on, 2.0, [], start=5.0)
    [track] = there.recordings.copy("s").tracks.values()
    assert track.restarts == []
    assert_same(replayed(there, lives_on), sent)


def test_a_restart_counts_for_the_limit_and_beyond_it_the_log_is_given_up():
    worlds = server()
    world, _ = begun(worlds, 3)
    run(world, 1.0, [])
    there, _, _ = adopted(world, copied := Copied(worlds), 5.0)
    before = copied.log().size
    there.recordings.go_on(copied.log(), "s", restarted=True)
    assert there.recordings.copy("s").size == before + 3 * RESTART_COST
    small, _, _ = adopted(world, copied, 5.0)
    small.recordings._limit = before + 1
    small.recordings.go_on(copied.log(), "s", restarted=True)
    with pytest.raises(FailedPrecondition, match="outgrown"):
        small.recordings.copy("s")


def test_that_a_log_was_dropped_is_copied_once():
    worlds = server(log_entries=20)
    world, ids = begun(worlds, 2)
    copied = Copied(worlds)
    copied.copy()
    for _ in range(20):
        world.give(ids[0], Goal((0.0, 3.0, 0.0)), 0.0)
    for _ in range(3):
        copied.copy()
    assert len(copied.parts) == 2 and copied.log() is None


def some_parts():
    worlds = server()
    world, ids = begun(worlds, 2)
    copied = Copied(worlds)
    for second in range(3):
        world.give(ids[0], Goal((0.0, 3.0 + second, 0.0)), float(second))
        run(world, 1.0, [], start=float(second))
        copied.copy()
    assert len(copied.parts) == 3
    return copied


def test_parts_that_do_not_fit_together_are_refused():
    copied = some_parts()
    whole = list(copied.parts)
    for parts in ([], whole[1:], [whole[0], whole[0]], [whole[0], whole[2], whole[1]]):
        copied.parts = parts
        with pytest.raises(InvalidArgument):
            copied.log()
    copied.parts = whole
    with pytest.raises(InvalidArgument, match="allowed: 5"):
        copied.log(most=5)


@pytest.mark.parametrize("cut", [3, 20, 60, -1])
def test_damaged_parts_are_refused(cut):
    copied = some_parts()
    copied.parts[1] = copied.parts[1][:cut]
    with pytest.raises(WayfarerError):
        copied.log()
