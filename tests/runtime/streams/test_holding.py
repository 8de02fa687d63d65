"""Agents that wait for a stalled reader."""

import pytest

from tests.runtime.streams.stage import HOLD, Stage, seqs, take
from wayfarer.runtime.streams.publications import SlowReader
from wayfarer.world.agents.agent import ChunkFlag


async def test_agents_wait_for_a_holder_that_has_stalled_and_it_loses_nothing():
    stage = Stage()
    reader = await stage.subscribe(slow_reader=HOLD)
    assert await stage.live(1.0) == 4, "until more than 0.5 s of motion wait"
    assert await stage.live(10.0) == 0
    got = await take(reader, 3)
    assert await stage.live(10.0) == 2
    got += await take(reader, 3)
    assert seqs(got) == list(range(6)) and reader.dropped == 0
    assert {c.flags for p in got[1:] for c in p.chunks} == {ChunkFlag.NONE}


async def test_two_holders_hold_only_together():
    stage = Stage()
    one, other = await stage.subscribe(slow_reader=HOLD), await stage.subscribe(slow_reader=HOLD)
    await stage.live(2.0)
    assert seqs(await take(one, 4)) == seqs(await take(other, 4)) == [0, 1, 2, 3]
    for seq in range(4, 24):
        await stage.live(0.2)
        assert seqs(await take(other, 1)) == [seq]
    assert one.dropped > 0, "an active reader prevents it, and then the oldest are lost"
    await stage.live(5.0)
    assert other.dropped == 0 and seqs(await take(other, 3)) == [24, 25, 26]


@pytest.mark.parametrize("policy", [SlowReader.DROP_OLDEST, SlowReader.DISCONNECT])
async def test_another_policy_prevents_holding(policy):
    stage = Stage()
    holder = await stage.subscribe(slow_reader=HOLD)
    other = await stage.subscribe(slow_reader=policy)
    for seq in range(20):
        assert await stage.live(0.2) == 1
        assert seqs(await take(other, 1)) == [seq]
    lost = holder.dropped
    assert lost > 0
    await other.close()
    await stage.live(2.0)
    assert await stage.live(2.0) == 0 and holder.dropped == lost, "alone, it is waited for"


async def test_agents_do_not_wait_for_longer_than_agreed():
    stage = Stage()
    reader = await stage.subscribe(slow_reader=HOLD, hold_s=3.0)
    await stage.live(1.0)
    assert await stage.live(2.0) == 0
    assert await stage.live(6.0) >= 20, "then the oldest are lost"
    assert reader.dropped > 0
    await take(reader, 4)
    await stage.live(2.0)
    assert await stage.live(1.0) == 0, "a reader that reads again may hold again"


async def test_nobody_waits_for_readers_who_have_gone():
    stage = Stage()
    reader = await stage.subscribe(slow_reader=HOLD)
    await stage.live(2.0)
    assert await stage.live(1.0) == 0
    await reader.close()
    assert await stage.live(1.0) == 5
    vanishing = await stage.subscribe(slow_reader=HOLD)
    await stage.live(2.0)
    del vanishing
    assert await stage.live(1.0) == 5


async def test_a_playhead_that_stands_holds_the_agents():
    stage = Stage()
    reader = await stage.subscribe(slow_reader=HOLD)
    await stage.live(0.2)
    [got] = await take(reader, 1)
    reader.ack(got.position, stage.now)
    await stage.live(2.0)
    assert await stage.live(2.0) == 0, "a paused game makes its people wait"
    reader.ack(got.position, stage.now)
    assert seqs(await take(reader, 2)) == [1, 2]
    assert await stage.live(1.0) > 0
