"""Streams, clips, lock-step."""

import asyncio
import contextlib

import pytest

from tests.transport.fakes import FakeService, opened
from tests.transport.gateway.calls import (
    DONE,
    REACHED,
    kinds,
    session,
    session_of_two,
    stream,
    take,
)
from tests.transport.samples import NOW
from wayfarer.config.limits import Limits
from wayfarer.errors import (
    FailedPrecondition,
    NotFound,
    ResourceExhausted,
    Unavailable,
)
from wayfarer.runtime.streams.publications import SlowReader
from wayfarer.transport import schema
from wayfarer.transport.codec import encoder
from wayfarer.v1 import motion_pb2


async def test_stream_introduces_agents_with_their_first_chunk(service, api):
    session_id, (first, second) = await session_of_two(api)
    async with contextlib.aclosing(stream(api, session_id)) as messages:
        header = (await anext(messages)).header
        assert header.session_id == session_id and header.fps == header.sent_fps == 40
        assert len(header.skeleton.bones) == 52 and header.skeleton.posed_bones == 22
        assert list(header.bones) == list(range(22)) and header.frame_bytes == 364
        assert header.resume_s == 5.0 and not header.resumed
        service.emit(session_id)
        batch = (await anext(messages)).batch
        assert [a.agent_id for a in batch.added] == [first.agent_id, second.agent_id]
        assert list(batch.chunks.aliases) == [a.alias for a in batch.added]
        service.emit(session_id)
        batch = (await anext(messages)).batch
        assert not batch.added and list(batch.chunks.seqs) == [1, 1]
        late = schema.NewAgents(agents=[schema.AgentSpec(name="late")])
        (third,) = (await api.agents.create(session_id, late)).agents
        service.emit(session_id)
        assert [a.name for a in (await anext(messages)).batch.added] == [third.name]


@pytest.mark.parametrize("encoding", ["smallest_three", "root"])
async def test_a_stream_writes_what_the_publisher_has_packed(service, api, monkeypatch, encoding):
    plain, packed = encoder.encode, []

    def counting(*args):
        packed.append(args)
        return plain(*args)

    monkeypatch.setattr(encoder, "encode", counting)
    session_id, _ = await session_of_two(api)
    chosen = {"encoding": encoding}
    async with contextlib.aclosing(stream(api, session_id, format=chosen)) as messages:
        await anext(messages)
        [subscription] = service.subscriptions
        if encoding == "root":  # it has its own way
            assert subscription.options.pack is None
            return
        service.emit(session_id)
        published = await subscription.queue.get()
        subscription.options.pack(published.chunks)
        subscription.queue.put_nowait(published)
        assert (await anext(messages)).batch.chunks.poses
        assert len(packed) == 1


async def test_stream_tells_of_deleted_agents_and_drops_their_late_chunks(service, api):
    session_id, (first, second) = await session_of_two(api)
    async with contextlib.aclosing(stream(api, session_id)) as messages:
        await anext(messages)
        service.emit(session_id)
        await anext(messages)
        service.emit(session_id)  # waits in the queue while the agent is deleted
        await api.agents.delete(first.agent_id)
        batch = (await anext(messages)).batch
        assert list(batch.removed) == [first.alias]
        assert list(batch.chunks.aliases) == [second.alias]


async def test_an_agent_deleted_before_its_first_chunk_is_never_shown(service, api):
    session_id, (first, second) = await session_of_two(api)
    async with contextlib.aclosing(stream(api, session_id)) as messages:
        await anext(messages)
        service.emit(session_id)
        await service.delete_agent(first.agent_id)  # behind the gateway's back
        batch = (await anext(messages)).batch
        assert [a.alias for a in batch.added] == list(batch.chunks.aliases) == [second.alias]


async def test_chosen_agents_only(service, api):
    session_id, (_, second) = await session_of_two(api)
    chosen = stream(api, session_id, agent_ids=[second.agent_id], slow_reader="hold")
    async with contextlib.aclosing(chosen) as messages:
        await anext(messages)
        service.emit(session_id)
        message = await anext(messages)
        assert list(message.batch.chunks.aliases) == [second.alias]
        assert service.subscriptions[0].options.slow_reader is SlowReader.HOLD
    with pytest.raises(NotFound):
        await anext(stream(api, session_id, agent_ids=["stranger"]))


async def test_a_format_decides_the_frames(service, api):
    session_id, _ = await session_of_two(api)
    chosen = schema.PoseFormat(
        encoding="smallest_three", profile="bones", bones=("head", "pelvis"), fps=10
    )
    async with contextlib.aclosing(stream(api, session_id, format=chosen)) as messages:
        header = (await anext(messages)).header
        assert header.pose_encoding == motion_pb2.POSE_ENCODING_SMALLEST_THREE
        assert (header.fps, header.sent_fps, header.frame_bytes) == (40, 10, 12 + 2 * 6)
        assert [header.skeleton.bones[b].name for b in header.bones] == ["pelvis", "head"]
        (sent, _) = service.emit(session_id)
        chunks = (await anext(messages)).batch.chunks  # two agents, two frames each
        assert len(chunks.poses) == 2 * 2 * header.frame_bytes and len(chunks.contacts) == 2 * 2
        assert list(chunks.first_frames) == [0, 0]
        assert list(chunks.scheduled_at_us) == [round(sent.scheduled_at * 1e6)] * 2


async def test_heartbeat_when_nothing_happens(monkeypatch):
    monkeypatch.setattr("wayfarer.transport.streams.stream.HEARTBEAT_S", 0.01)
    api = await opened()
    async with contextlib.aclosing(stream(api, await session(api))) as messages:
        assert kinds(await take(messages, 3)) == ["header", "heartbeat", "heartbeat"]


async def test_events_follow_their_chunks(service, api):
    session_id, _ = await session_of_two(api)
    async with contextlib.aclosing(stream(api, session_id)) as messages:
        await anext(messages)
        service.emit(session_id, REACHED, DONE)
        got = await take(messages, 3)
    assert kinds(got) == ["batch", "event", "event"]
    assert got[1].event == motion_pb2.Event(
        kind="EVENT_KIND_GOAL_REACHED",
        agent_id="agent-2",
        alias=1,
        at_us=round(NOW * 1e6),
        goal_revision=3,
        waypoint=4,
        detail="there",
    )
    assert got[2].event.kind == motion_pb2.EVENT_KIND_PATH_DONE


# the end


async def test_stream_ends_with_its_session(service, api):
    session_id = await session(api)
    messages = stream(api, session_id)
    await anext(messages)
    await api.sessions.delete(session_id)
    with pytest.raises(StopAsyncIteration):
        await anext(messages)
    assert service.subscriptions[0].closed


async def test_closing_a_stream_frees_the_subscription_and_its_place():
    service = FakeService()
    api = await opened(service, Limits(streams_per_session=1))
    session_id = await session(api)
    messages = stream(api, session_id)
    await anext(messages)
    with pytest.raises(ResourceExhausted, match="1 streams"):
        await anext(stream(api, session_id))
    await messages.aclose()
    assert service.subscriptions[0].closed and api.streams == 0
    again = stream(api, session_id)
    await anext(again)
    await again.aclose()


async def test_a_refused_subscription_frees_its_place():
    api = await opened(limits=Limits(streams=1))
    session_id = await session(api, lock_step=True)
    with pytest.raises(FailedPrecondition):
        await anext(stream(api, session_id))
    assert api.streams == 0


async def test_streams_of_the_server_are_limited():
    api = await opened(limits=Limits(streams=1))
    messages = stream(api, await session(api))
    await anext(messages)
    with pytest.raises(ResourceExhausted) as caught:
        await anext(stream(api, await session(api)))
    assert caught.value.retry_after > 0
    await messages.aclose()


async def test_drain_tells_streams_ends_them_and_refuses_work(service, api):
    session_id = await session(api)
    got = []

    async def read(messages) -> None:
        async with contextlib.aclosing(messages):
            async for message in messages:
                got.append(message)  # noqa: PERF401 what came before the error counts

    request = schema.StreamRequest(session_id=session_id)
    readers = [
        asyncio.create_task(read(messages))
        for messages in (stream(api, session_id), api.motion.events(request))
    ]
    while len(service.subscriptions) < 2:
        await asyncio.sleep(0)
    await api.drain(grace=5.0)
    for reader in readers:
        with pytest.raises(Unavailable, match="shutting down"):
            await reader
    told = [item[1].kind for item in got if isinstance(item, tuple)]
    told += [m.event.kind for m in got if not isinstance(m, tuple | None) and m.HasField("event")]
    assert told == [motion_pb2.EVENT_KIND_DRAINING] * 2
    assert all(s.closed for s in service.subscriptions) and not api.ready
    with pytest.raises(Unavailable, match="shutting down"):
        await api.sessions.create(schema.NewSession())


async def test_a_broken_runtime_ends_streams_with_its_error(service, api):
    messages = stream(api, await session(api))
    await anext(messages)
    service.break_down()
    with pytest.raises(Unavailable, match="has failed"):
        await anext(messages)
