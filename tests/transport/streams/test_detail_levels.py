"""Rings around viewpoints: the tier of each agent, in streams and over Control."""

import asyncio
import json
import time
from collections import Counter
from contextlib import aclosing

import numpy as np
import pytest
from pydantic import ValidationError

from tests.runtime.kept_worlds import fake_worlds
from tests.runtime.running import until
from tests.transport.fakes import gateway
from tests.transport.gateway.calls import session, stream
from tests.transport.samples import NOW, chunk
from tests.transport.streams.test_control import Client, begun, read
from wayfarer.errors import InvalidArgument
from wayfarer.runtime.metrics_sink import MetricsSink
from wayfarer.runtime.motion_service import MotionService
from wayfarer.runtime.streams.root_tracks import RootTracks
from wayfarer.transport import schema
from wayfarer.transport.codec import PoseEncoder, PoseEncoding, PoseFormat
from wayfarer.transport.conversion.basis import Basis
from wayfarer.transport.edge.metrics import SIGHTS
from wayfarer.transport.streams.control import control
from wayfarer.transport.streams.detail_levels import DetailLevels, DetailRing, ViewPlace
from wayfarer.v1 import motion_pb2
from wayfarer.world.agents.agent import AgentSpec, ChunkFlag, MotionChunks, Sight
from wayfarer.world.events import Event, EventKind

RINGS = (DetailRing(10.0, PoseFormat()), DetailRing(30.0, PoseFormat(PoseEncoding.ROOT, (), 10)))
FIRST = motion_pb2.CHUNK_FLAG_FIRST
TIERS = {
    "rings": [
        {"radius": 10},
        {"radius": 20, "format": {"encoding": 3, "profile": 3, "bones": ["head"], "fps": 20}},
        {"radius": 30, "format": {"encoding": 4}},
    ],
    "viewpoints": [{"position": {"x": 0, "y": 0, "z": 0}}],
}


def at(*distances: float, seq: int = 0) -> MotionChunks:
    """Agents 1, 2 … at these distances from the origin."""
    return MotionChunks.of(
        [chunk(f"a{k}", k, seq, (x, 0.0, 0.0)) for k, x in enumerate(distances, start=1)]
    )


def sort(interest: DetailLevels, *distances: float):
    tiers, entered, left = interest.sort(at(*distances))
    return tiers.tolist(), entered.tolist(), left


def test_an_agent_leaves_a_ring_ten_per_cent_beyond_it():
    interest = DetailLevels(RINGS, [ViewPlace((0.0, 0.0, 0.0))])
    assert sort(interest, 9.9) == ([0], [True], [])
    assert sort(interest, 10.9) == ([0], [False], [])
    assert sort(interest, 11.1) == ([1], [False], [])
    assert sort(interest, 10.1) == ([1], [False], [])
    assert sort(interest, 9.9) == ([0], [False], [])
    assert sort(interest, 32.9) == ([1], [False], [])
    assert sort(interest, 33.1) == ([2], [False], [1])
    assert sort(interest, 30.1) == ([2], [False], [])
    assert sort(interest, 29.9) == ([1], [True], [])


def test_the_nearest_viewpoint_counts_by_its_reach():
    far, near = ViewPlace((100.0, 0.0, 0.0)), ViewPlace((0.0, 0.0, 0.0), reach=0.5)
    interest = DetailLevels(RINGS, [far, near])
    assert sort(interest, 4.9, 5.1, 15.1, 95.0)[0] == [0, 1, 2, 0]
    interest.look([far])
    assert sort(interest, 4.9, 5.1, 15.1, 95.0) == ([2, 2, 2, 0], [False] * 4, [1, 2])


def test_after_a_resume_who_may_be_shown_goes_on():
    interest = DetailLevels(RINGS, [ViewPlace((0.0, 0.0, 0.0))], resumed=True)
    assert sort(interest, 5.0, 10.5, 32.0, 40.0) == ([0, 0, 1, 2], [False] * 4, [4])
    assert sort(interest, 5.0, 10.5, 32.0, 29.0) == ([0, 0, 1, 1], [False, False, False, True], [])


def test_the_state_of_a_deleted_agent_goes_with_it():
    interest = DetailLevels(RINGS, [ViewPlace((0.0, 0.0, 0.0))])
    sort(interest, 5.0, 6.0)
    interest.forget(1)
    assert list(interest._tiers) == [2]


# the motion thread's knowledge


async def test_the_motion_thread_knows_who_is_near():
    """Through a real service: rings, a viewpoint that moves, an events stream, the end."""
    motion = MotionService(fake_worlds())
    motion.start()
    api = gateway(motion, clock=time.time)
    await until(lambda: motion.ready)
    await api.take_over()

    async def seen(*expected: Sight) -> None:
        columns = motion._world.slots
        await until(lambda: [*columns.sight[columns.active]] == [*expected])

    try:
        session_id = await crowd(api, 5, 15, 25, 100)
        client, messages, _ = await opened_with(api, session_id, interest=TIERS)
        events = api.motion.events(schema.StreamRequest(session_id=session_id))
        async with aclosing(messages), aclosing(events):
            reading = asyncio.create_task(read_on(messages))
            await anext(events)
            await seen(Sight.NEAR, Sight.FAR, Sight.ROOT, Sight.NONE)
            assert (await motion.stats()).sights == dict.fromkeys(SIGHTS, 1)
            client.send(viewpoints={"viewpoints": [{"position": {"z": 100}}]})
            await seen(Sight.NONE, Sight.NONE, Sight.NONE, Sight.NEAR)
            reading.cancel()
            await asyncio.gather(reading, return_exceptions=True)
        await seen(*[Sight.NEAR] * 4)
    finally:
        await motion.stop()


async def read_on(messages) -> None:
    async for _ in messages:
        pass


# packing


@pytest.mark.parametrize("basis", Basis)
def test_a_root_has_a_place_and_a_heading_in_the_basis(basis):
    chunks = at(1.0)
    roots = RootTracks().follow(chunks)
    packed = PoseEncoder().encode(chunks, basis, RINGS[1].pose_format, np.array([0]), roots)
    frames = np.frombuffer(packed.poses, np.dtype("<f4,<f4,<f4,<i2,u1,u1"))
    assert len(packed.poses) == 32 and len(packed.contacts) == 2
    first = [frames[0][k] for k in range(3)]
    np.testing.assert_array_equal(first, basis.axes.points_to_wire(chunks.translation[0, 0]))
    turn = basis.axes.handedness * roots[0, 1, 3]
    assert frames[1][3] == pytest.approx(turn / np.pi * 32768, abs=0.6) and turn != 0


# over the gateway


async def crowd(api, *distances: float) -> str:
    session_id = await session(api)
    specs = [schema.AgentSpec(position=schema.Vector3(x=0, y=0, z=d)) for d in distances]
    await api.agents.create(session_id, schema.NewAgents(agents=specs))
    return session_id


def aliases(batches) -> dict[int, list[int]]:
    return {batch.tier: list(batch.chunks.aliases) for batch in batches}


async def opened_with(api, session_id: str, **options: object):
    client = Client()
    client.send(open={"session_id": session_id, **options})
    messages = read(control(api, client.requests()))
    return client, messages, (await anext(messages)).motion.header


class CountingMeter(MetricsSink):
    """Counts chunks and bytes by tier."""

    def __init__(self) -> None:
        self.chunks: Counter[str] = Counter()
        self.bytes: Counter[str] = Counter()

    def sent(self, tier: str, chunks: int, size: int) -> None:
        self.chunks[tier] += chunks
        self.bytes[tier] += size


async def test_the_metrics_count_chunks_and_bytes_by_tier(service, api):
    session_id = await crowd(api, 5, 15, 25, 100)
    for interest, expected in (
        (TIERS, {"0": 1, "1": 1, "2": 1, "hidden": 1}),
        (None, {"whole": 4}),
    ):
        _, messages, _ = await opened_with(api, session_id, interest=interest)
        meter = service.subscriptions[-1].meter = CountingMeter()
        async with aclosing(messages):
            service.emit(session_id)
            sizes: Counter[str] = Counter()
            for _ in range(3 if interest else 1):
                motion = (await anext(messages)).motion
                sizes[str(motion.batch.tier) if interest else "whole"] += motion.ByteSize()
            assert meter.chunks == expected
            assert +meter.bytes == sizes


async def test_one_batch_per_tier_and_first_on_entering(service, api):
    session_id = await crowd(api, 5, 15, 25, 100)
    client, messages, header = await opened_with(api, session_id, interest=TIERS)
    async with aclosing(messages):
        assert [(t.radius, t.sent_fps, t.frame_bytes) for t in header.tiers] == [
            (10, 40, 364),
            (20, 20, 18),
            (30, 10, 16),
        ]
        assert (header.sent_fps, header.frame_bytes) == (40, 364)
        service.emit(session_id)
        first = [(await anext(messages)).motion.batch for _ in range(3)]
        assert aliases(first) == {0: [1], 1: [2], 2: [3]}
        assert [[a.alias for a in batch.added] for batch in first] == [[1], [2], [3]]
        assert all(flags & FIRST for batch in first for flags in batch.chunks.flags)
        tokens = [batch.resume_token.split(".")[1] for batch in first]
        assert tokens == ["0", "0", "1"]
        for batch, tier in zip(first, header.tiers, strict=True):
            frames = len(batch.chunks.contacts)
            assert frames == 8 * tier.sent_fps // 40
            assert len(batch.chunks.poses) == tier.frame_bytes * frames

        service.emit(session_id)
        again = [(await anext(messages)).motion.batch for _ in range(3)]
        assert not any(batch.added for batch in again)
        assert not any(flags for batch in again for flags in batch.chunks.flags)

        client.send(viewpoints={"viewpoints": [{"position": {"z": 100}}]})
        client.send(command_id=1, clear_goal={"agent_id": "agent-2"})
        assert (await anext(messages)).reply.command_id == 1
        service.emit(session_id)
        [moved] = [(await anext(messages)).motion.batch]
        assert aliases([moved]) == {0: [4]} and sorted(moved.hidden) == [1, 2, 3]
        assert moved.chunks.flags[0] & FIRST and [a.alias for a in moved.added] == [4]

        client.send(viewpoints={"viewpoints": [{"position": {"z": 25}}]})
        client.send(command_id=2, clear_goal={"agent_id": "agent-2"})
        assert (await anext(messages)).reply.command_id == 2
        service.emit(session_id)
        back = [(await anext(messages)).motion.batch for _ in range(3)]
        assert aliases(back) == {0: [3], 1: [2], 2: [1]} and list(back[0].hidden) == [4]
        assert all(flags & FIRST for batch in back for flags in batch.chunks.flags)
        assert sorted(a.alias for batch in back for a in batch.added) == [1, 2, 3]


async def test_a_resumed_stream_states_its_viewpoints_again(service, api):
    session_id = await crowd(api, 5, 100)
    _, messages, _ = await opened_with(api, session_id, interest=TIERS)
    async with aclosing(messages):
        service.emit(session_id)
        batch = (await anext(messages)).motion.batch
    service.emit(session_id)
    again = {"interest": TIERS, "resume_token": batch.resume_token}
    _, messages, header = await opened_with(api, session_id, **again)
    async with aclosing(messages):
        assert header.resumed
        batch = (await anext(messages)).motion.batch
        assert list(batch.chunks.seqs) == [1] and not batch.chunks.flags[0] & FIRST
        assert [a.alias for a in batch.added] == [1] and list(batch.hidden) == [2]


async def test_an_agent_that_is_deleted_is_removed_wherever_it_was(service, api):
    session_id = await crowd(api, 5, 100)
    agents = (await api.agents.list_of(session_id)).agents
    client, messages, _ = await opened_with(api, session_id, interest=TIERS)
    async with aclosing(messages):
        service.emit(session_id)
        await anext(messages)
        client.send(viewpoints={"viewpoints": [{"position": {"z": 1000}}]})
        client.send(command_id=1)
        await anext(messages)
        service.emit(session_id)
        assert list((await anext(messages)).motion.batch.hidden) == [1]
        for agent in agents:
            await api.agents.delete(agent.agent_id)
        await api.agents.create(session_id, schema.NewAgents(agents=[schema.AgentSpec()]))
        service.emit(session_id)
        batch = (await anext(messages)).motion.batch
        assert list(batch.removed) == [1] and not batch.chunks.aliases  # 2 was never seen


async def test_a_stream_keeps_nothing_of_who_has_left(service, api):
    """People of a crowd, within the rings and outside, and a person deleted by a call."""
    session_id = await crowd(api, 5)
    (agent,) = (await api.agents.list_of(session_id)).agents
    _, messages, _ = await opened_with(api, session_id, interest=TIERS)
    (place,) = api._context.sessions.session(session_id).places
    levels = place.stream._interest
    async with aclosing(messages):
        specs = [AgentSpec(position=(0.0, y)) for y in (5.0, 100.0)]
        near, far = await service.create_agents(session_id, specs)
        service.emit(session_id)
        assert list((await anext(messages)).motion.batch.chunks.aliases) == [1, near.alias]
        assert levels._tiers.keys() == levels.sights._by_alias.keys() == {1, 2, 3}
        for one in (near, far):
            await service.delete_agent(one.agent_id)
            left = Event(EventKind.AGENT_LEFT, NOW, one.agent_id, one.alias)
            service.emit(session_id, left)
            await anext(messages)
            assert (await anext(messages)).motion.event.alias == one.alias
        service.emit(session_id)
        assert list((await anext(messages)).motion.batch.chunks.aliases) == [1]
        assert levels._tiers.keys() == levels.sights._by_alias.keys() == {1}
        assert place.stream._known == place.stream._seen == {1} and not place.stream._gone
        service.emit(session_id)  # a late chunk
        await api.agents.delete(agent.agent_id)
        batch = (await anext(messages)).motion.batch
        assert list(batch.removed) == [1] and not batch.chunks.aliases
        assert not levels._tiers and not levels.sights._by_alias, "… is dropped"


async def test_who_sees_nobody_gets_a_token_every_second(service, api, clock):
    session_id = await crowd(api, 100)
    _, messages, _ = await opened_with(api, session_id, interest=TIERS)
    async with aclosing(messages):
        service.emit(session_id)
        service.emit(session_id)
        clock.now += 1.0
        service.emit(session_id)
        batch = (await anext(messages)).motion.batch
        assert batch.resume_token and not batch.chunks.aliases


@pytest.mark.parametrize("interest", [None, TIERS])
async def test_messages_keep_to_the_bound(service, api, interest):
    session_id = await crowd(api, *[5.0] * 40)
    options = {"interest": interest} if interest else {}
    _, messages, _ = await opened_with(api, session_id, max_message_bytes=16_384, **options)
    seen, sizes, tokens = [], [], []
    async with aclosing(messages):
        for _ in range(2):
            service.emit(session_id)
        while len(seen) < 80:
            motion = (await anext(messages)).motion
            sizes.append(motion.ByteSize())
            seen += motion.batch.chunks.aliases
            tokens.append(motion.batch.resume_token)
    assert sorted(seen) == sorted([*range(1, 41)] * 2)
    assert max(sizes) <= 16_384 and len(sizes) > 10
    positions = [int(token.split(".")[1]) for token in tokens]
    assert positions == sorted(positions) and positions.count(2) == 1  # a complete one has 2


async def test_a_stream_of_roots_alone(service, api):
    session_id = await crowd(api, 5, 100)
    wanted = schema.PoseFormat(encoding=PoseEncoding.ROOT)
    async with aclosing(stream(api, session_id, format=wanted)) as messages:
        header = (await anext(messages)).header
        assert (header.sent_fps, header.frame_bytes, len(header.bones)) == (10, 16, 0)
        service.emit(session_id)
        assert len((await anext(messages)).batch.chunks.poses) == 2 * 2 * 16


@pytest.mark.parametrize(
    ("changes", "field"),
    [
        ({"viewpoints": []}, "viewpoints"),
        ({"viewpoints": [{"position": {"x": 0, "y": 0, "z": 0}}] * 9}, "viewpoints"),
        ({"viewpoints": [{"position": {"x": 1e9, "y": 0, "z": 0}}]}, "viewpoints[0].position"),
        ({"viewpoints": [{"position": {"x": 0, "y": 0, "z": 0}, "reach": -1}]}, "reach"),
        ({"rings": []}, "rings"),
        ({"rings": [{"radius": 1}] * 9}, "rings"),
        ({"rings": [{"radius": 5}, {"radius": 5}]}, "rings[1].radius"),
        ({"rings": [{"radius": 1e6}]}, "rings[0].radius"),
        ({"rings": [{"radius": 0}]}, "rings[0].radius"),
        ({"rings": [{"radius": 1, "format": {"encoding": "root", "fps": 40}}]}, "format.fps"),
        ({"rings": [{"radius": 1, "format": {"fps": 30}}]}, "rings[0].format.fps"),
    ],
)
async def test_what_cannot_be_is_refused(api, changes, field):
    session_id = await crowd(api, 5)
    usual = {
        "rings": [{"radius": 1}],
        "viewpoints": [{"position": {"x": 0.0, "y": 0.0, "z": 0.0}}],
    }
    with pytest.raises((ValidationError, InvalidArgument)) as caught:
        request = schema.Interest.model_validate_json(json.dumps({**usual, **changes}))
        await anext(stream(api, session_id, interest=request))
    assert field in str(caught.value) or field in caught.value.field


async def test_viewpoints_need_rings_and_a_bound_needs_room(service, api):
    session_id = await crowd(api, 5)
    client = Client()
    async with aclosing(await begun(api, client, session_id)) as messages:
        client.send(command_id=3, viewpoints={"viewpoints": [{"position": {}}]})
        reply = (await anext(messages)).reply
        assert reply.command_id == 3 and "without `interest`" in reply.problem.message
        service.emit(session_id)
        assert (await anext(messages)).motion.HasField("batch")
    with pytest.raises(InvalidArgument, match="16384 at least"):
        await anext(stream(api, session_id, max_message_bytes=16_383))


async def test_roots_are_for_streams(api):
    wanted = schema.PoseFormat(encoding=PoseEncoding.ROOT)
    with pytest.raises(InvalidArgument, match=r"is for streams; here is one of F32_LE"):
        await anext(api.motion.generate_clip(schema.ClipRequest(seconds=1, format=wanted)))


def test_flags_are_the_runtimes():
    assert FIRST == ChunkFlag.FIRST
