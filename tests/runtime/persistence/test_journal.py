"""Nothing is lost: the journal of a world, and failures of all kinds."""

import asyncio
import os
import shutil
import signal
import sqlite3
import subprocess
import sys
import time
from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest

from tests.runtime.kept_worlds import STICK, fake_worlds, open_journal
from tests.world.fakes import people, taken
from wayfarer.config.limits import Limits
from wayfarer.errors import ArtifactError
from wayfarer.runtime.persistence.capture import capture_session
from wayfarer.runtime.persistence.journal_entries import agents_in
from wayfarer.runtime.persistence.journal_file import NAME, VERSION, EntryKind, JournalFile
from wayfarer.runtime.persistence.snapshot import BodyStamp
from wayfarer.world.agents.agent import AgentChange, SessionSpec
from wayfarer.world.agents.goal import Goal
from wayfarer.world.behaviours import Wander
from wayfarer.world.goals.commands import Path

LIMITS = Limits()
SPEC = SessionSpec("s", seed=7, attributes={"basis": "unity"})


class Kept:
    """A world with a journal, and the content read back from it."""

    def __init__(self, folder):
        self.folder = folder
        self.journal = open_journal(folder)
        self.world = fake_worlds(self.journal).live()
        self.journal.start()

    def close(self):
        self.world.checkpoint()
        self.journal.stop()

    def restored(self):
        """Sessions by id, read by a later server."""
        return {record.session_id: record for record in read(self.folder)}


def read(folder):
    journal = open_journal(folder)
    try:
        return journal.restore(LIMITS)
    finally:
        journal.stop()


@pytest.fixture
def kept(tmp_path):
    return Kept(tmp_path / "state")


def populate(world, count=3, session="s"):
    world.create_session(replace(SPEC, session_id=session), 0.0)
    return [agent.agent_id for agent in world.create_agents(session, people(count), 0.0)]


def assert_same_record(found, expected):
    assert found.session_id == expected.session_id
    assert (found.created_at, found.last_alias) == (expected.created_at, expected.last_alias)
    for a, b in zip(found.agents, expected.agents, strict=True):
        names = ("agent_id", "alias", "spec", "created_at", "seq", "goal_revision", "behaviour")
        for name in names:
            assert getattr(a, name) == getattr(b, name), name
        assert a.path[-1:] == b.path[-1:]
        for part in ("seed", "gait"):
            for column in getattr(a.motion, part).__slots__:
                mine, theirs = (getattr(getattr(r.motion, part), column) for r in (a, b))
                np.testing.assert_array_equal(mine, theirs, column)


def test_a_world_is_read_back_as_it_was_saved(kept):
    world = kept.world
    a, b, c = populate(world)
    world.give(a, Wander((0.0, 0.0), 5.0), 0.0)
    world.give(b, Path(tuple(Goal((0.0, 2.0 * n, 0.0), stop=False) for n in range(1, 9))), 0.0)
    list(world.advance(4.0))
    world.update_agent(c, AgentChange(name="Ada", foot_lock=False))
    kept.close()
    assert_same_record(kept.restored()["s"], taken(world))


def test_a_goal_given_after_the_last_frames_counts(kept):
    [a] = populate(kept.world, 1)
    kept.world.give(a, Path((Goal((0.0, 1.0, 0.0), stop=False), Goal((0.0, 9.0, 0.0)))), 0.0)
    list(kept.world.advance(2.0))
    assert kept.world.get_agent(a).waypoint == 1
    kept.world.give(a, Goal((5.0, 0.0, 0.0)), 2.0)
    kept.close()
    [record] = kept.restored()["s"].agents
    assert record.motion.gait.waypoint[0] == 0 and not record.motion.gait.arrived[0]
    assert [goal.position for goal in record.path] == [(5.0, 0.0, 0.0)]
    world = fake_worlds().live()
    world.members.put_session(kept.restored()["s"], 0.0)
    list(world.advance(15.0))
    assert np.hypot(*np.subtract(world.get_agent(a).position[:2], (5.0, 0.0))) < 0.3


def test_what_is_gone_stays_gone(kept):
    _, b, _ = populate(kept.world)
    populate(kept.world, 2, "t")
    kept.world.delete_agent(b)
    kept.world.delete_session("t")
    kept.world.checkpoint()
    kept.close()
    restored = kept.restored()
    assert restored.keys() == {"s"}
    assert [agent.alias for agent in restored["s"].agents] == [1, 3]
    assert restored["s"].last_alias == 3


def test_a_deleted_agent_is_not_brought_back_by_where_it_stood(kept):
    a, *_ = populate(kept.world)
    crowd = capture_session(kept.world, "s").agents
    kept.journal.put(agents_in(crowd))
    kept.world.delete_agent(a)
    kept.close()
    assert len(kept.restored()["s"].agents) == 2


async def test_it_is_on_disk_when_the_caller_hears_of_it(kept, tmp_path):
    populate(kept.world)
    await kept.journal.durable()
    copy = tmp_path / "as it is now"
    shutil.copytree(kept.folder, copy)
    [record] = read(copy)
    assert len(record.agents) == 3
    await asyncio.gather(*(kept.journal.durable() for _ in range(50)))
    kept.close()
    await kept.journal.durable()  # nobody waits for a journal that has ended


CHILD = """
import asyncio, sys, time
from pathlib import Path
from tests.world.fakes import people
from tests.runtime.kept_worlds import fake_worlds, open_journal
from wayfarer.world.agents.agent import SessionSpec
from wayfarer.world.agents.goal import Goal
from wayfarer.runtime.motion_service import MotionService

async def main():
    runtime = MotionService(fake_worlds(open_journal(Path(sys.argv[1]))))
    runtime.start()
    while not runtime.ready:
        await asyncio.sleep(0.01)
    if not await runtime.list_sessions():
        await runtime.create_session(SessionSpec("s", attributes={"basis": "ros"}))
        agents = await runtime.create_agents("s", people(64))
        await asyncio.gather(*(
            runtime.give(a.agent_id, Goal((a.spec.position[0], 500.0, 0.0))) for a in agents
        ))
    print("acknowledged", flush=True)
    while True:
        await asyncio.sleep(0.1)
        infos = await runtime.list_agents("s")
        print(time.time(), *(f"{i.position[1]:.4f}" for i in infos), flush=True)

asyncio.run(main())
"""


def life(folder, seconds):
    """Run a server in its own process and kill it; returns the last places that it printed."""
    child = subprocess.Popen(
        [sys.executable, "-c", CHILD, str(folder)], stdout=subprocess.PIPE, text=True
    )
    try:
        while "acknowledged" not in (line := child.stdout.readline()):
            assert line, "it ended"
        ends, line = time.monotonic() + seconds, ""
        while time.monotonic() < ends:
            line = child.stdout.readline()
    finally:
        os.kill(child.pid, signal.SIGKILL)
        rest = child.communicate()[0].splitlines()
    lines = [line, *(text for text in rest if text.count(" ") == 64)]
    return np.array(lines[-1].split()[1:], float)


def test_a_killed_server_loses_less_than_a_second_and_goes_on(tmp_path):
    folder = tmp_path / "state"
    before = life(folder, 3.0)
    assert (before > 0.5).all()
    [record] = read(folder)
    assert record.spec.attributes == {"basis": "ros"}
    assert [agent.alias for agent in record.agents] == list(range(1, 65))
    kept = np.array([agent.motion.seed.translation[0, -1, 1] for agent in record.agents])
    assert (kept >= before - 1.2 * 1.0).all(), "1.2 m/s for one second"
    assert (kept <= before + 1.2 * 1.0).all()
    after = life(folder, 2.0)
    assert (after > kept + 0.5).all(), "they walk on to their goals"


def test_a_kill_right_after_the_reply_loses_nothing(tmp_path):
    life(tmp_path, 0.0)
    [record] = read(tmp_path)
    assert len(record.agents) == 64
    assert all(agent.goal_revision == 1 and agent.path for agent in record.agents)


# Bad days


def test_two_servers_never_share_a_folder(kept):
    with pytest.raises(ArtifactError, match="another server keeps its state here"):
        open_journal(kept.folder)
    kept.close()
    open_journal(kept.folder).stop()


def test_a_journal_of_another_body_is_refused(kept):
    populate(kept.world)
    kept.close()
    with pytest.raises(ArtifactError, match=r"body 'stick'.*this server has body 'other'"):
        open_journal(kept.folder, BodyStamp("other", {"male": "1" * 64}))
    assert len(kept.restored()["s"].agents) == 3, "and left as it is"


def test_a_journal_of_a_later_version_is_refused(kept):
    populate(kept.world)
    kept.close()
    with closing(sqlite3.connect(kept.folder / NAME)) as file:
        file.execute(f"PRAGMA user_version = {VERSION + 1}")
    with pytest.raises(ArtifactError, match="later version"):
        open_journal(kept.folder)


def test_another_programs_database_is_refused(tmp_path):
    with closing(sqlite3.connect(tmp_path / NAME)) as file:
        file.execute("CREATE TABLE theirs (a)")
    with pytest.raises(ArtifactError, match="no journal of Wayfarer's"):
        open_journal(tmp_path)


def test_a_folder_that_cannot_be_used_is_named(tmp_path):
    (tmp_path / "file").write_text("not a folder")
    with pytest.raises(ArtifactError, match="state cannot be kept here"):
        open_journal(tmp_path / "file")


def damaged(folder):
    return list(folder.glob(NAME + ".damaged-*"))


@pytest.mark.parametrize("junk", [b"", b"not a database " * 1000])
def test_a_file_that_is_no_database_is_set_aside(tmp_path, junk, caplog):
    (tmp_path / NAME).write_bytes(junk)
    journal = open_journal(tmp_path)
    assert journal.restore(LIMITS) == []
    journal.stop()
    assert len(damaged(tmp_path)) == bool(junk)
    assert ("the journal is damaged" in caplog.text) == bool(junk)


@pytest.fixture
def many(kept):
    """A journal of 40 sessions with 4 agents each, over many pages."""
    for number in range(40):
        populate(kept.world, 4, f"s{number:02}")
    kept.close()
    return kept


def test_the_good_part_of_a_damaged_file_is_kept(many, caplog):
    path = many.folder / NAME
    size = path.stat().st_size
    with path.open("r+b") as file:
        file.seek(size // 2)
        file.write(os.urandom(3 * 4096))
    found = many.restored()
    assert "the journal is damaged" in caplog.text
    agents = sum(len(record.agents) for record in found.values())
    assert 30 <= len(found) <= 40 and 120 <= agents < 160
    [aside] = damaged(many.folder)
    assert aside.stat().st_size == size
    assert many.restored().keys() == found.keys(), "the new file is sound"
    assert len(damaged(many.folder)) == 1


def test_a_flipped_bit_costs_one_agent(many, caplog):
    path = many.folder / NAME
    data = bytearray(path.read_bytes())
    with closing(sqlite3.connect(path)) as file:
        [body] = file.execute("SELECT body FROM entries WHERE kind = 3 LIMIT 1").fetchone()
    place = data.find(body[100:400])
    assert place > 0
    data[place] ^= 1
    path.write_bytes(data)
    found = many.restored()
    assert sum(len(record.agents) for record in found.values()) == 159
    assert "is lost" in caplog.text


def test_a_file_cut_short_is_read_as_far_as_it_goes(many):
    path = many.folder / NAME
    with path.open("r+b") as file:
        file.truncate(path.stat().st_size // 2)
    assert len(many.restored()) >= 1
    assert len(damaged(many.folder)) == 1


def test_agents_without_a_session_are_told_and_let_go(many, caplog):
    with closing(sqlite3.connect(many.folder / NAME)) as file:
        file.execute("DELETE FROM entries WHERE kind = 1 AND id = 's07'")
        file.commit()
    assert len(many.restored()) == 39
    assert "its session 's07' is not there" in caplog.text


def test_a_session_begins_without_agents_that_another_of_its_id_has_left(many):
    with closing(sqlite3.connect(many.folder / NAME)) as file:
        file.execute("DELETE FROM entries WHERE kind = 1 AND id = 's07'")
        file.commit()
    journal = open_journal(many.folder)
    journal.restore(LIMITS)
    world = fake_worlds(journal).live()
    journal.start()
    populate(world, 1, "s07")
    journal.stop()
    assert [agent.alias for agent in many.restored()["s07"].agents] == [1]


async def test_a_full_disk_is_told_once_and_waited_for(kept, caplog):
    populate(kept.world, 2)
    await kept.journal.durable()
    limit_pages(kept.journal, 1)
    populate(kept.world, 60, "t")
    await asyncio.wait_for(kept.journal.durable(), 5)
    assert kept.journal.failing
    for number in range(3):  # the service continues
        populate(kept.world, 2, f"u{number}")
        await asyncio.wait_for(kept.journal.durable(), 5)
    kept.world.delete_session("u1")
    told = caplog.text
    assert told.count("the journal cannot be written") == 1 and "full" in told
    limit_pages(kept.journal, 1 << 30)
    for _ in range(200):
        if not kept.journal.failing:
            break
        await asyncio.sleep(0.05)
    assert "written again" in caplog.text
    await kept.journal.durable()
    kept.close()
    found = kept.restored()
    assert found.keys() == {"s", "t", "u0", "u2"}
    assert len(found["t"].agents) == 60


def limit_pages(journal, pages):
    """Like a full disk: SQLite takes the present size if it is larger."""
    journal._file._connection.execute(f"PRAGMA max_page_count = {pages}")


async def test_what_waits_for_a_full_disk_does_not_grow(kept):
    populate(kept.world, 1)
    await kept.journal.durable()
    limit_pages(kept.journal, 1)
    populate(kept.world, 60, "big")
    await kept.journal.durable()
    assert kept.journal.failing
    for number in range(50):
        populate(kept.world, 2, f"t{number}")
        kept.world.delete_session(f"t{number}")
        list(kept.world.advance(0.1 * number))
        kept.world.checkpoint()
    waiting = len(kept.journal._pending)
    assert waiting <= 2 * 61 + 3 + 5 * 50
    for _ in range(100):
        await asyncio.sleep(0.05)
        if len(kept.journal._pending) <= 2 * 61 + 3:
            break
    else:
        pytest.fail(f"{len(kept.journal._pending)} entries wait")
    kept.close()


async def test_an_entry_that_cannot_be_written_keeps_no_other_back(kept, caplog):
    populate(kept.world, 1)
    kept.world.create_agents("s", people(1, name="\ud800"), 0.0)  # half a character
    kept.world.create_agents("s", people(1), 0.0)
    await kept.journal.durable()
    assert not kept.journal.failing
    assert "cannot be written to the journal" in caplog.text
    kept.close()
    assert [agent.alias for agent in kept.restored()["s"].agents] == [1, 3]


def test_entries_are_written_all_or_none(tmp_path):
    file = JournalFile(tmp_path)
    file.write({(EntryKind.SESSION, "a"): b"1"})
    with pytest.raises(sqlite3.Error):
        file.write({(EntryKind.SESSION, "b"): b"2", (EntryKind.SESSION, object()): b"3"})
    file.write({(EntryKind.SESSION, "c"): b"4"})
    file.close()
    again = JournalFile(tmp_path)
    assert again.entries.of(EntryKind.SESSION) == {"a": b"1", "c": b"4"}
    again.close()


def test_the_stamp_of_the_body_is_kept(kept):
    kept.close()
    again = JournalFile(kept.folder)
    assert STICK.name.encode() in again.entries.of(EntryKind.BODY)[""]
    again.close()
