import asyncio
import random

import pytest

from tests.runtime.chunks import chunk, together
from tests.runtime.streams.stage import HOLD, Stage, kinds, seqs, take
from wayfarer.errors import InvalidArgument, Unavailable
from wayfarer.runtime.metrics_sink import ResumeResult
from wayfarer.runtime.streams.publications import Resume, SlowReader
from wayfarer.runtime.streams.sights import Sights
from wayfarer.world.agents.agent import ChunkFlag, Sight
from wayfarer.world.events import EventKind

# Positions


async def test_positions_count_per_session():
    stage = Stage()
    one, other = await stage.subscribe(), await stage.subscribe(session="t")
    await stage.walk(2)
    await stage.walk(1, session="t")
    await stage.walk(1)
    assert [p.position for p in await take(one, 3)] == [1, 2, 3]
    assert [p.position for p in await take(other, 1)] == [1]
    assert one.epoch != other.epoch


async def test_one_call_reaches_all_subscribers_of_an_event_loop(monkeypatch):
    stage = Stage()
    readers = [await stage.subscribe() for _ in range(8)]
    calls = []
    monkeypatch.setattr(
        "wayfarer.runtime.streams.publisher.post",
        lambda loop, call, *args: calls.append((call, args)),
    )
    stage.publisher.publish("s", together(chunk(0, "a")))
    stage.publisher.publish("t", together(chunk(0, "b")))
    stage.publisher.publish("s", together(chunk(1, "a")))
    stage.publisher.flush()
    [(call, args)] = calls
    call(*args)
    assert [seqs(await take(r, 2)) for r in readers] == [[0, 1]] * 8


async def test_what_falls_due_is_packed_before_it_is_delivered_and_a_failure_is_the_streams():
    stage, packed = Stage(), []

    def failing(chunks):
        raise ValueError("pack")

    readers = [await stage.subscribe(pack=pack) for pack in (packed.append, failing, None)]
    chunks = together(chunk(0, "a"))
    stage.publisher.publish("s", chunks)
    assert packed == [chunks]
    stage.publisher.tell("s", [])
    stage.publisher.flush()
    await asyncio.sleep(0)
    assert [seqs(await take(reader, 1)) for reader in readers] == [[0]] * 3
    assert packed == [chunks]


# Resume


async def test_resume_goes_on_without_a_gap():
    stage = Stage()
    first = await stage.subscribe()
    await stage.walk(3)
    got = await take(first, 3)
    await stage.walk(2)
    await first.close()
    await stage.walk(4)
    again = await stage.subscribe(resume=Resume(first.epoch, got[-1].position))
    await stage.walk(2)
    rest = await take(again, 8)
    assert again.resumed and again.epoch == first.epoch
    assert seqs(got + rest) == list(range(11))
    assert [p.position for p in got + rest] == list(range(1, 12))
    assert {c.flags for p in rest for c in p.chunks} == {ChunkFlag.NONE}
    assert stage.meter.resumes == {ResumeResult.RESUMED: 1}


@pytest.mark.parametrize("position", [0, 4])
async def test_the_first_and_the_last_position_can_be_resumed_from(position):
    stage = Stage()
    first = await stage.subscribe()
    await stage.walk(4)
    again = await stage.subscribe(resume=Resume(first.epoch, position))
    await stage.walk(1)
    assert again.resumed
    assert (await take(again, 1))[0].position == position + 1


async def test_a_resume_keeps_its_filter():
    stage = Stage()
    first = await stage.subscribe("b")
    await stage.walk(3, "a", "b")
    again = await stage.subscribe("b", resume=Resume(first.epoch, 1))
    got = await take(again, 2)
    assert [[c.agent_id for c in p.chunks] for p in got] == [["b"], ["b"]]


async def test_who_resumes_with_other_agents_begins_with_each_of_them():
    stage = Stage()
    first = await stage.subscribe("b")
    await stage.walk(3, "a", "b")
    resume = Resume(first.epoch, 2, same_agents=False)
    got = await take(await stage.subscribe(resume=resume), 1)
    assert [(c.agent_id, c.seq, c.flags) for p in got for c in p.chunks] == [
        ("a", 2, ChunkFlag.FIRST),
        ("b", 2, ChunkFlag.FIRST),
    ]


async def test_what_is_no_longer_held_is_told():
    stage = Stage(resume_s=1.0)
    first = await stage.subscribe()
    await stage.walk(20)
    again = await stage.subscribe(resume=Resume(first.epoch, 3))
    await stage.walk(1)
    opening, live = await take(again, 2)
    assert not again.resumed and again.epoch == first.epoch
    assert kinds(opening) == [EventKind.GAP] and not opening.chunks
    assert "17 publications were lost" in opening.events[0].detail
    assert opening.position == 3, "a reader that leaves now has received no more"
    assert live.position == 21 and live.chunks[0].flags == ChunkFlag.FIRST
    assert stage.meter.resumes == {ResumeResult.GAP: 1}


async def test_the_ring_is_as_long_as_asked_for_and_no_longer():
    stage = Stage(resume_s=1.0)
    first = await stage.subscribe()
    await stage.walk(500)
    oldest = 500 - 6  # 1 s: chunks 494 to 499, positions 495 to 500
    assert (await stage.subscribe(resume=Resume(first.epoch, oldest))).resumed
    assert not (await stage.subscribe(resume=Resume(first.epoch, oldest - 1))).resumed


async def test_who_goes_away_on_news_of_a_loss_gets_what_is_still_held():
    stage = Stage()
    first = await stage.subscribe()
    await stage.walk(1)
    await take(first, 1)
    await stage.walk(9)
    [told] = await take(first, 1)
    assert kinds(told) == [EventKind.GAP]
    again = await stage.subscribe(resume=Resume(first.epoch, told.position))
    assert again.resumed and seqs(await take(again, 9)) == list(range(1, 10))


async def test_who_resumes_from_the_start_knows_nobody():
    stage = Stage()
    stage.seq = 700  # an agent that was restored
    first = await stage.subscribe()
    await stage.walk(2)
    again = await stage.subscribe(resume=Resume(first.epoch, 0))
    got = await take(again, 2)
    assert again.resumed
    assert [p.chunks[0].flags for p in got] == [ChunkFlag.FIRST, ChunkFlag.NONE]


async def test_another_epoch_begins_anew_and_says_so():
    stage = Stage()
    first = await stage.subscribe()
    await stage.walk(3)
    stage.publisher.end("s")
    again = await stage.subscribe(resume=Resume(first.epoch, 3))
    await stage.walk(1)
    opening, live = await take(again, 2)
    assert not again.resumed and again.epoch != first.epoch
    assert kinds(opening) == [EventKind.GAP] and "restarted the session" in (
        opening.events[0].detail
    )
    assert (opening.position, live.position) == (0, 1)
    assert live.chunks[0].flags == ChunkFlag.FIRST
    assert stage.meter.resumes == {ResumeResult.NEW_EPOCH: 1}


@pytest.mark.parametrize("position", [-1, 4, 2**63])
async def test_a_position_that_never_was_is_refused(position):
    stage = Stage()
    first = await stage.subscribe()
    await stage.walk(3)
    with pytest.raises(InvalidArgument, match=r"allowed: 0 to 3"):
        await stage.subscribe(resume=Resume(first.epoch, position))


async def test_a_stalled_reader_does_not_lengthen_the_ring():
    stage = Stage(resume_s=1.0)
    stalled = await stage.subscribe(slow_reader=SlowReader.DROP_OLDEST)
    await stage.walk(1000)
    log = stage.publisher._logs["s"]
    assert len(log._ring) == 6 and len(stalled._waiting) == 3
    assert stage.meter.dropped[SlowReader.DROP_OLDEST] == 997


async def test_a_schedule_that_was_moved_keeps_what_the_ring_holds():
    stage = Stage()
    first = await stage.subscribe()
    await stage.walk(3)
    stage.publisher.publish("s", together(chunk(3, at=600.0)))
    assert (await stage.subscribe(resume=Resume(first.epoch, 1))).resumed


@pytest.mark.parametrize("seed", range(25))
async def test_whatever_readers_do_nothing_is_lost_without_a_word(seed):
    """A reader reads, stalls, goes and resumes at random; agents come and go."""
    chance = random.Random(seed)
    stage = Stage(resume_s=2.0)
    policy = chance.choice([SlowReader.DROP_OLDEST, HOLD])
    reader, position, last = await stage.subscribe(slow_reader=policy), 0, {}
    numbers, names = {"a": 0}, iter(map(chr, range(0x4E00, 0x9000)))
    for _ in range(300):
        if chance.random() < 0.1:
            numbers[next(names)] = 0
        if chance.random() < 0.1 and len(numbers) > 2:
            del numbers[chance.choice([name for name in numbers if name != "a"])]
        stage.now += 0.2
        stage.publisher.publish(
            "s", together(*(chunk(n, a, at=stage.now) for a, n in numbers.items()))
        )
        stage.publisher.flush()
        numbers = {name: seq + 1 for name, seq in numbers.items()}
        await asyncio.sleep(0)
        if chance.random() < 0.1:
            await reader.close()
            resume = Resume(reader.epoch, position)
            reader = await stage.subscribe(resume=resume, slow_reader=policy)
        while chance.random() < 0.6 and (reader._waiting or reader._opening or reader._loss):
            [got] = await take(reader, 1)
            assert got.position > position or (got.position == position and not got.chunks)
            position = got.position
            for each in got.chunks:
                follows = last.get(each.agent_id) == each.seq - 1
                marked = bool(each.flags & (ChunkFlag.FIRST | ChunkFlag.GAP))
                assert follows or marked, "an unreported gap"
                assert not (follows and each.flags & ChunkFlag.GAP)
                last[each.agent_id] = each.seq
        assert reader._span() <= 2.0 + 0.5 + 0.2


# Ends and figures


async def test_a_session_that_ends_gives_the_last_and_then_ends_its_readers():
    stage = Stage()
    reader = await stage.subscribe()
    stage.publisher.publish("s", together(chunk(0)))
    stage.publisher.end("s")
    assert seqs([p async for p in reader]) == [0]
    assert not stage.publisher._logs, "forgotten"


async def test_all_readers_are_told_of_a_failure():
    stage = Stage()
    readers = [await stage.subscribe(session=name) for name in "st"]
    stage.publisher.end_all(Unavailable("the loop has failed"))
    for reader in readers:
        with pytest.raises(Unavailable, match="has failed"):
            await take(reader, 1)


async def test_closed_and_vanished_readers_are_forgotten():
    stage = Stage()
    closed, vanished, open_ = [await stage.subscribe() for _ in range(3)]
    await closed.close()
    del vanished
    assert list(stage.publisher.open()) == [open_]


async def test_readers_who_come_and_go_leave_nothing_where_nothing_is_published():
    stage = Stage()
    for _ in range(100):
        await (await stage.subscribe()).close()
    assert len(stage.publisher._logs["s"]._subscribers) == 1


async def test_goal_to_motion_is_measured_to_the_first_chunk_planned_for_it():
    stage = Stage()
    stage.publisher.await_goal("s", "a", 2, asked_at=0.1)
    stage.publisher.await_goal("s", "b", 1, asked_at=0.1)
    stage.publisher.forget_agent("s", "b")
    stage.publisher.publish(
        "s", together(chunk(1, goal_revision=1), chunk(1, "b", goal_revision=1))
    )
    assert stage.meter.goals == []
    stage.publisher.publish("s", together(chunk(2, goal_revision=2)))
    stage.publisher.publish("s", together(chunk(3, goal_revision=2)))
    assert stage.meter.goals == [pytest.approx(0.3)]


# How well readers see agents


async def test_an_agent_is_seen_as_well_as_by_the_reader_that_sees_it_best():
    stage, one, other = Stage(), Sights(), Sights()
    one.see([(ord("a"), Sight.ROOT), (ord("b"), Sight.NONE), (ord("c"), Sight.FAR)])
    other.see([(ord("a"), Sight.NONE), (ord("b"), Sight.NONE), (ord("d"), Sight.NONE)])
    chunks = together(*(chunk(0, agent) for agent in "abcd"))
    assert stage.publisher.sights("s", chunks) is Sight.NEAR, "it may be read later"
    await stage.subscribe(events_only=True)
    kept = [await stage.subscribe(sights=one), await stage.subscribe(sights=other)]
    expected = [Sight.ROOT, Sight.NONE, Sight.NEAR, Sight.NEAR]  # not seen yet: it may be near
    assert stage.publisher.sights("s", chunks) == expected
    whole = await stage.subscribe()
    assert stage.publisher.sights("s", chunks) is Sight.NEAR
    await whole.close()
    one.forget(ord("a"))
    assert stage.publisher.sights("s", chunks)[0] is Sight.NEAR
    for reader in kept:
        await reader.close()
    assert stage.publisher.sights("s", chunks) is Sight.NEAR
