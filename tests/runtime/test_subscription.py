import asyncio

import numpy as np
import pytest

from wayfarer.errors import FailedPrecondition, Unavailable
from wayfarer.runtime.agent import AgentState, ChunkFlag, MotionChunk
from wayfarer.runtime.subscription import ChunkQueue


def chunk(seq, agent="a", at=None):
    return MotionChunk(
        agent_id=agent,
        alias=1,
        seq=seq,
        first_frame=8 * seq,
        scheduled_at=0.2 * seq if at is None else at,
        goal_revision=0,
        flags=ChunkFlag.ARRIVED if seq == 0 else ChunkFlag.NONE,
        state=AgentState.STANDING,
        translation=np.zeros((8, 3), np.float32),
        rotations=np.zeros((8, 22, 4), np.float32),
        contacts=np.zeros((8, 2), np.bool_),
    )


async def test_first_chunk_of_each_agent_is_marked():
    queue = ChunkQueue("s", frozenset(), 0.5)
    queue.put([chunk(0), chunk(4, "b")])
    queue.put([chunk(1), chunk(5, "b")])
    first, second = await anext(queue), await anext(queue)
    assert [c.flags for c in first] == [ChunkFlag.FIRST | ChunkFlag.ARRIVED, ChunkFlag.FIRST]
    assert [c.flags for c in second] == [ChunkFlag.NONE] * 2


async def test_a_slow_reader_loses_the_oldest_and_is_told():
    queue = ChunkQueue("s", frozenset(), 1.0)
    queue.put([chunk(0)])
    await anext(queue)
    for seq in range(1, 20):
        queue.put([chunk(seq)])
    rest = [(await anext(queue))[0] for _ in range(6)]
    assert [c.seq for c in rest] == [14, 15, 16, 17, 18, 19], "one second of motion is kept"
    assert [c.flags for c in rest] == [ChunkFlag.GAP] + [ChunkFlag.NONE] * 5
    assert queue.dropped == 13


async def test_batches_far_apart_are_kept_all_the_same():
    queue = ChunkQueue("s", frozenset(), 0.1)
    for seq in range(5):
        queue.put([chunk(seq)])
    assert [(await anext(queue))[0].seq for _ in range(3)] == [2, 3, 4]


async def test_the_reader_gets_what_waits_and_then_the_end():
    queue = ChunkQueue("s", frozenset(), 0.5)
    queue.put([chunk(0)])
    queue.end()
    assert [batch[0].seq async for batch in queue] == [0]


async def test_close_ends_a_waiting_reader_and_may_be_repeated():
    queue = ChunkQueue("s", frozenset(), 0.5)
    reader = asyncio.ensure_future(anext(queue, None))
    await asyncio.sleep(0)
    await queue.close()
    await queue.close()
    assert await reader is None
    queue.put([chunk(0)])
    assert [batch async for batch in queue] == []


async def test_a_failed_loop_is_told_to_the_reader():
    queue = ChunkQueue("s", frozenset(), 0.5)
    queue.end(Unavailable("the loop has failed"))
    with pytest.raises(Unavailable, match="has failed"):
        await anext(queue)


async def test_a_second_reader_is_refused_and_a_cancelled_one_gives_way():
    queue = ChunkQueue("s", frozenset(), 0.5)
    reader = asyncio.ensure_future(anext(queue))
    await asyncio.sleep(0)
    with pytest.raises(FailedPrecondition, match="one reader"):
        await anext(queue)
    reader.cancel()
    await asyncio.sleep(0)
    queue.put([chunk(0)])
    assert (await anext(queue))[0].seq == 0
