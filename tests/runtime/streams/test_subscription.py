import asyncio
import math

import numpy as np
import pytest

from tests.runtime.chunks import KeepingMeter, chunk, entry, subscription, together
from tests.runtime.streams.stage import seqs, take
from tests.world.fakes import ManualClock
from wayfarer.config.limits import Limits
from wayfarer.errors import (
    FailedPrecondition,
    InvalidArgument,
    ResourceExhausted,
)
from wayfarer.runtime.streams.publications import Publication, SlowReader
from wayfarer.runtime.streams.sequence_tracker import SILENCE
from wayfarer.runtime.streams.subscription import (
    MAX_EVENTS,
    KeptPublication,
    QueuedPublication,
    SubscriptionStart,
)
from wayfarer.spec import NEW_FRAMES, POSED_JOINTS
from wayfarer.world.agents.agent import ChunkFlag, MotionChunks
from wayfarer.world.events import Event, EventKind
from wayfarer.world.rows import flat_columns


def put(queue, entries, spare=False):
    for each in entries:
        queue.put(each, spare)


async def is_empty(queue):
    """Nothing is available now."""
    reader = asyncio.ensure_future(anext(queue))
    await asyncio.sleep(0)
    idle = not reader.done()
    reader.cancel()
    await asyncio.gather(reader, return_exceptions=True)
    return idle


def flags(publications):
    return [[c.flags for c in p.chunks] for p in publications]


async def test_first_chunk_of_each_agent_is_marked():
    queue = subscription()
    put(queue, [entry(0, "a", "b"), entry(1, "a", "b"), entry(2, "a", "b", "c")])
    first, none = ChunkFlag.FIRST, ChunkFlag.NONE
    assert flags(await take(queue, 3)) == [[first, first], [none, none], [none, none, first]]


async def test_marks_are_added_to_those_of_the_chunk():
    queue = subscription()
    arrived = chunk(0, flags=ChunkFlag.ARRIVED)
    queue.put(QueuedPublication(Publication(1, together(arrived)), 0.0), False)
    assert flags(await take(queue, 1)) == [[ChunkFlag.FIRST | ChunkFlag.ARRIVED]]
    assert arrived.flags == ChunkFlag.ARRIVED, "others get it unmarked"


async def test_a_slow_reader_loses_the_oldest_and_is_told():
    meter = KeepingMeter()
    queue = subscription(queue_s=1.0, meter=meter)
    put(queue, [entry(0)])
    await take(queue, 1)
    put(queue, map(entry, range(1, 20)))
    told, *rest = await take(queue, 7)
    assert seqs(rest) == [14, 15, 16, 17, 18, 19], "one second of motion is kept"
    assert flags(rest) == [[ChunkFlag.GAP]] + [[ChunkFlag.NONE]] * 5
    assert told.position == 1 and not told.chunks, "a reader that resumes there may still get them"
    assert [e.kind for e in told.events] == [EventKind.GAP]
    assert "13 publications" in told.events[0].detail
    assert queue.dropped == 13 == meter.dropped[SlowReader.DROP_OLDEST]
    assert max(meter.queues) <= 1.0 + 1e-9


async def test_events_of_lost_publications_are_kept_in_number_bounded():
    queue = subscription()
    reached = [Event(EventKind.GOAL_REACHED, 0.2 * i, "a", waypoint=i) for i in range(1000)]
    put(queue, [entry(i, events=[event]) for i, event in enumerate(reached)])
    told, *rest = await take(queue, 4)
    assert told.events[0].kind is EventKind.GAP
    lost = len(reached) - 3
    assert list(told.events[1:]) == reached[lost - MAX_EVENTS : lost]
    assert [p.events[0] for p in rest] == reached[lost:]


async def test_publications_far_apart_are_kept_all_the_same():
    queue = subscription(queue_s=0.2)
    put(queue, map(entry, range(5)))
    assert seqs((await take(queue, 4))[1:]) == [2, 3, 4]


async def test_a_reader_that_waits_loses_nothing_when_much_comes_at_once():
    """The process got no CPU for seconds, and then delivers everything before the reader runs."""
    queue = subscription(queue_s=0.5)
    reading = asyncio.create_task(take(queue, 20))
    await asyncio.sleep(0)
    put(queue, map(entry, range(20)))
    assert seqs(await reading) == list(range(20)) and queue.dropped == 0
    put(queue, map(entry, range(20, 40)))
    assert queue.dropped > 0, "bounded without a waiting reader"


async def test_a_reader_that_waits_for_its_own_playhead_is_bounded():
    queue = subscription(queue_s=0.5)
    queue.ack(0, 0.0)
    reading = asyncio.create_task(take(queue, 40))
    await asyncio.sleep(0)
    put(queue, map(entry, range(40)))
    await asyncio.sleep(0)
    put(queue, map(entry, range(40, 80)))
    assert queue.dropped > 0
    reading.cancel()


async def test_a_schedule_that_was_moved_drops_nothing():
    queue = subscription()
    moved = [
        QueuedPublication(Publication(i + 1, together(chunk(i, at=at))), 0.2 * i)
        for i, at in enumerate((0.0, 0.2, 60.4, 60.6))
    ]
    put(queue, moved[:3])
    assert seqs(await take(queue, 3)) == [0, 1, 2]


async def test_the_filter_passes_over_what_does_not_concern_the_reader():
    queue = subscription("b")
    other = Event(EventKind.GOAL_REACHED, 0.0, "a")
    own = Event(EventKind.GOAL_REACHED, 0.0, "b")
    server = Event(EventKind.DRAINING, 0.0)
    put(
        queue,
        [
            entry(0, events=[other]),
            entry(1, "a", "b", events=[other, own]),
            entry(2),
            entry(3, "b"),
            QueuedPublication(Publication(5, events=(server,)), 0.8),
        ],
    )
    got = await take(queue, 3)
    assert [p.position for p in got] == [2, 4, 5]
    assert [[c.agent_id for c in p.chunks] for p in got] == [["b"], ["b"], []]
    assert [list(p.events) for p in got] == [[own], [], [server]]
    assert await is_empty(queue)


async def test_a_filtered_reader_is_not_behind_when_nothing_concerns_it():
    queue = subscription("b")
    put(queue, map(entry, range(50)))
    assert queue.taken == pytest.approx(0.2 * 49)


# Resume


def ring(*numbers, agents=("a",)):
    return kept(*(entry(seq, *agents) for seq in numbers))


def kept(*entries):
    return tuple(map(KeptPublication.of, entries))


async def test_an_agent_that_began_after_the_resumed_position_is_first():
    born = QueuedPublication(Publication(5, together(chunk(4, "a"), chunk(0, "z"))), 0.8)
    after = QueuedPublication(Publication(6, together(chunk(5, "a"), chunk(1, "z"))), 1.0)
    start = SubscriptionStart("epoch", 3, 0.6, resumed=True, held=(*ring(2, 3), *kept(born, after)))
    got = await take(subscription(start=start), 3)
    none = ChunkFlag.NONE
    assert flags(got) == [[none], [none, ChunkFlag.FIRST], [none, none]]


def test_a_kept_publication_is_the_same_but_for_rounded_rotations():
    rotations = np.random.default_rng(1).normal(size=(NEW_FRAMES, POSED_JOINTS, 4))
    rotations /= np.linalg.norm(rotations, axis=-1, keepdims=True)
    chunks = together(chunk(3, rotations=rotations.astype(np.float32)), chunk(3, "b"))
    before = QueuedPublication(Publication(5, chunks, (gone := Event(EventKind.GAP, 1.0),)), 0.8)
    one = KeptPublication.of(before)
    after = one.whole
    assert (after.publication.position, after.publication.events, after.motion) == (5, (gone,), 0.8)
    same = {name.path for name in flat_columns(MotionChunks)} - {"rotations"}
    for name in same:
        found, expected = (getattr(e.publication.chunks, name) for e in (after, before))
        assert found.tolist() == expected.tolist(), name
    turned = after.publication.chunks.rotations
    assert turned.dtype == np.float32
    angle = 2 * np.linalg.norm(turned.astype(float) - chunks.rotations, axis=-1)
    assert 0.003 < np.degrees(angle.max()) <= 0.007
    assert (KeptPublication.of(after).rotations == one.rotations).all(), "on the next server, too"


async def test_a_replay_longer_than_the_queue_is_not_dropped_at_once():
    start = SubscriptionStart("epoch", 1, 0.0, resumed=True, held=ring(*range(20)))
    queue = subscription(start=start)
    put(queue, map(entry, range(20, 22)))
    assert seqs(await take(queue, 21)) == list(range(1, 22))
    put(queue, map(entry, range(22, 40)))
    told, *rest = await take(queue, 4)
    assert told.events[0].kind is EventKind.GAP and seqs(rest) == [37, 38, 39], "bounded again"


async def test_a_stalled_reader_that_has_resumed_is_bounded_too():
    start = SubscriptionStart("epoch", 1, 0.0, resumed=True, held=ring(*range(20)))
    meter = KeepingMeter()
    queue = subscription(start=start, meter=meter)
    put(queue, map(entry, range(20, 400)))
    assert max(meter.queues) <= Limits().resume_s + 0.5 + 1e-9
    _, late = await take(queue, 2)
    assert flags([late]) == [[ChunkFlag.GAP]], "known from before the resume"


async def test_who_resumes_loses_nothing_while_its_connection_is_set_up():
    start = SubscriptionStart("epoch", 1, 0.0, resumed=True, held=ring(1, 2))
    queue = subscription(start=start)
    put(queue, map(entry, range(3, 20)))  # 3.4 s until it is read for the first time
    assert seqs(await take(queue, 19)) == list(range(1, 20)) and queue.dropped == 0


async def test_who_resumes_loses_nothing_while_the_agents_of_its_first_publication_are_described():
    start = SubscriptionStart("epoch", 1, 0.0, resumed=True, held=ring(1))
    queue = subscription(start=start)
    assert seqs(await take(queue, 1)) == [1]
    put(queue, map(entry, range(2, 12)))  # the motion thread has much to do, and answers late
    assert seqs(await take(queue, 10)) == list(range(2, 12)) and queue.dropped == 0
    put(queue, map(entry, range(12, 30)))
    assert queue.dropped > 0, "bounded again"


async def test_agents_silent_for_long_are_forgotten_and_those_present_are_not():
    queue = subscription()
    for seq in range(200):
        names = ("a", chr(0x4E00 + seq))  # "a" stays, one more comes and goes each time
        put(queue, [entry(seq, *names)])
        [got] = await take(queue, 1)
        assert (got.chunks[0].flags == ChunkFlag.NONE) == (seq > 0)
    assert len(queue._tracker._new) + len(queue._tracker._old) < 3 * SILENCE / 0.2


# Acknowledgements


async def test_nothing_is_sent_that_begins_beyond_the_lead():
    queue = subscription(queue_s=10.0, lead_s=0.5)
    put(queue, map(entry, range(10)))
    assert seqs(await take(queue, 2)) == [0, 1]
    queue.ack(2, 0.4)
    assert seqs(await take(queue, 3)) == [2, 3, 4], "0.8 s is within 0.4 + 0.5"
    assert await is_empty(queue)
    waiting = asyncio.ensure_future(anext(queue))
    await asyncio.sleep(0)
    queue.ack(5, 0.5)
    assert (await waiting).chunks[0].seq == 5


async def test_a_reader_that_stops_acknowledging_is_a_slow_one():
    queue = subscription()
    put(queue, [entry(0)])
    await take(queue, 1)
    queue.ack(1, 0.0)
    put(queue, map(entry, range(1, 30)))
    assert queue.dropped > 20
    [told] = await take(queue, 1)
    assert told.events[0].kind is EventKind.GAP and await is_empty(queue)
    queue.ack(told.position, 10.0)
    assert seqs(await take(queue, 1))[0] >= 27


async def test_an_ended_session_lifts_the_lead():
    queue = subscription()
    put(queue, [entry(0)])
    await take(queue, 1)
    queue.ack(1, 0.0)
    put(queue, [entry(4)])
    queue.end()
    assert seqs([p async for p in queue]) == [4]


@pytest.mark.parametrize("playhead", [math.nan, math.inf, -math.inf, 1e9])
async def test_a_playhead_that_cannot_be_is_refused(playhead):
    clock = ManualClock(1000.0)
    queue = subscription(clock=clock)
    put(queue, map(entry, range(3)))
    await take(queue, 1)
    with pytest.raises(InvalidArgument, match=r"playhead.*allowed") as caught:
        queue.ack(1, playhead)
    assert caught.value.field == "playhead"
    assert seqs(await take(queue, 2)) == [1, 2], "as if it had not been said"


@pytest.mark.parametrize("position", [-1, 2, 10**12])
async def test_a_position_never_sent_is_refused(position):
    queue = subscription()
    put(queue, map(entry, range(3)))
    await take(queue, 1)
    with pytest.raises(InvalidArgument, match=r"position.*allowed: 0 to 1") as caught:
        queue.ack(position, 0.0)
    assert caught.value.field == "position"


# Policies


async def test_a_slow_reader_may_be_disconnected():
    meter = KeepingMeter()
    queue = subscription(slow_reader=SlowReader.DISCONNECT, meter=meter)
    put(queue, map(entry, range(3)))
    assert seqs(await take(queue, 1)) == [0]
    put(queue, map(entry, range(3, 10)))
    with pytest.raises(ResourceExhausted, match=r"0\.5 s of motion behind.*resume"):
        await anext(queue)
    assert queue.closed and meter.dropped[SlowReader.DISCONNECT] > 0
    put(queue, [entry(10)])
    with pytest.raises(ResourceExhausted):
        await anext(queue)


async def test_a_reader_that_keeps_up_is_not_disconnected():
    queue = subscription(slow_reader=SlowReader.DISCONNECT)
    for seq in range(30):
        put(queue, [entry(seq)])
        assert seqs(await take(queue, 1)) == [seq]


# Ends


async def test_close_ends_a_waiting_reader_and_may_be_repeated():
    queue = subscription()
    reader = asyncio.ensure_future(anext(queue, None))
    await asyncio.sleep(0)
    await queue.close()
    await queue.close()
    assert await reader is None
    put(queue, [entry(0)])
    assert [p async for p in queue] == []


async def test_a_second_reader_is_refused_and_a_cancelled_one_gives_way():
    queue = subscription()
    reader = asyncio.ensure_future(anext(queue))
    await asyncio.sleep(0)
    with pytest.raises(FailedPrecondition, match="one reader"):
        await anext(queue)
    reader.cancel()
    await asyncio.sleep(0)
    put(queue, [entry(0)])
    assert seqs(await take(queue, 1)) == [0]
