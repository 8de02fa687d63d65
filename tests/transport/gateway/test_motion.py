"""Streams, clips, lock-step."""

import asyncio
import contextlib

import pytest

from tests.transport.fakes import NOW, FakeService, opened
from tests.transport.gateway.calls import TWO, session, session_of_two, stream, take
from wayfarer.config import Limits
from wayfarer.errors import (
    FailedPrecondition,
    InvalidArgument,
    NotFound,
    ResourceExhausted,
    Unavailable,
)
from wayfarer.runtime.agent import Event, EventKind, Resume, SlowReader
from wayfarer.transport import schema
from wayfarer.v1 import motion_pb2

REACHED = Event(EventKind.GOAL_REACHED, NOW, "agent-2", 1, 3, 4, "there")
DONE = Event(EventKind.PATH_DONE, NOW, "agent-2", 1, 3, 4)


def kinds(messages) -> list[str]:
    return [message.WhichOneof("payload") for message in messages]


async def test_stream_introduces_agents_with_their_first_chunk():
    service = FakeService()
    api = await opened(service)
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


async def test_stream_tells_of_deleted_agents_and_drops_their_late_chunks():
    service = FakeService()
    api = await opened(service)
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


async def test_an_agent_deleted_before_its_first_chunk_is_never_shown():
    service = FakeService()
    api = await opened(service)
    session_id, (first, second) = await session_of_two(api)
    async with contextlib.aclosing(stream(api, session_id)) as messages:
        await anext(messages)
        service.emit(session_id)
        await service.delete_agent(first.agent_id)  # behind the gateway's back
        batch = (await anext(messages)).batch
        assert [a.alias for a in batch.added] == list(batch.chunks.aliases) == [second.alias]


async def test_chosen_agents_only():
    service = FakeService()
    api = await opened(service)
    session_id, (_, second) = await session_of_two(api)
    chosen = stream(api, session_id, agent_ids=[second.agent_id], slow_reader="hold")
    async with contextlib.aclosing(chosen) as messages:
        await anext(messages)
        service.emit(session_id)
        message = await anext(messages)
        assert list(message.batch.chunks.aliases) == [second.alias]
        assert service.subscriptions[0].wish.slow_reader is SlowReader.HOLD
    with pytest.raises(NotFound):
        await anext(stream(api, session_id, agent_ids=["stranger"]))


async def test_a_format_decides_the_frames():
    service = FakeService()
    api = await opened(service)
    session_id, _ = await session_of_two(api)
    wish = schema.PoseFormat(encoding="f16_le", profile="bones", bones=("head", "pelvis"), fps=10)
    async with contextlib.aclosing(stream(api, session_id, format=wish)) as messages:
        header = (await anext(messages)).header
        assert header.pose_encoding == motion_pb2.POSE_ENCODING_F16_LE
        assert (header.fps, header.sent_fps, header.frame_bytes) == (40, 10, 12 + 2 * 8)
        assert [header.skeleton.bones[b].name for b in header.bones] == ["pelvis", "head"]
        (sent, _) = service.emit(session_id)
        chunks = (await anext(messages)).batch.chunks  # two agents, two frames each
        assert len(chunks.poses) == 2 * 2 * header.frame_bytes and len(chunks.contacts) == 2 * 2
        assert list(chunks.first_frames) == [0, 0]
        assert list(chunks.scheduled_at_us) == [round(sent.scheduled_at * 1e6)] * 2
    with pytest.raises(InvalidArgument, match="30 is none of 40, 20, 10") as caught:
        await anext(stream(api, session_id, format=schema.PoseFormat(fps=30)))
    assert caught.value.field == "format.fps"


async def test_heartbeat_when_nothing_happens(monkeypatch):
    monkeypatch.setattr("wayfarer.transport.stream.HEARTBEAT_S", 0.01)
    api = await opened()
    async with contextlib.aclosing(stream(api, await session(api))) as messages:
        assert kinds(await take(messages, 3)) == ["header", "heartbeat", "heartbeat"]


async def test_events_follow_their_chunks():
    service = FakeService()
    api = await opened(service)
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


# resuming


async def resumed(api, session_id: str, token: str, number: int):
    async with contextlib.aclosing(stream(api, session_id, resume_token=token)) as messages:
        return await take(messages, 1 + number)


async def test_a_stream_goes_on_where_its_token_left_off():
    service = FakeService()
    api = await opened(service)
    session_id, _ = await session_of_two(api)
    async with contextlib.aclosing(stream(api, session_id)) as messages:
        await anext(messages)
        service.emit(session_id)
        token = (await anext(messages)).batch.resume_token
    for _ in range(2):
        service.emit(session_id)
    header, *batches = await resumed(api, session_id, token, 2)
    assert header.header.resumed
    assert [seq for b in batches for seq in b.batch.chunks.seqs] == [1, 1, 2, 2]
    assert len(batches[0].batch.added) == 2  # told again: it is another connection


async def test_a_stream_that_resumes_is_told_who_was_deleted_meanwhile():
    service = FakeService()
    api = await opened(service)
    session_id, (first, second) = await session_of_two(api)
    async with contextlib.aclosing(stream(api, session_id)) as messages:
        await anext(messages)
        service.emit(session_id)
        token = (await anext(messages)).batch.resume_token
    service.emit(session_id)
    await api.agents.delete(second.agent_id)
    _, batch = await resumed(api, session_id, token, 1)
    assert list(batch.batch.removed) == [second.alias]
    assert list(batch.batch.chunks.aliases) == [first.alias]
    assert [agent.agent_id for agent in batch.batch.added] == [first.agent_id]
    async with contextlib.aclosing(stream(api, session_id)) as messages:  # without a token
        await anext(messages)
        service.emit(session_id)
        assert not (await anext(messages)).batch.removed


async def test_a_token_knows_which_agents_were_followed():
    service = FakeService()
    api = await opened(service)
    session_id, (first, second) = await session_of_two(api)
    ids = (first.agent_id, second.agent_id)

    async def token_of(*agent_ids: str) -> str:
        chosen = {"agent_ids": agent_ids} if agent_ids else {}
        async with contextlib.aclosing(stream(api, session_id, **chosen)) as messages:
            await anext(messages)
            service.emit(session_id)
            return (await anext(messages)).batch.resume_token

    async def is_same(token: str, *agent_ids: str) -> bool:
        wish = schema.StreamWish(session_id=session_id, resume_token=token, agent_ids=agent_ids)
        async with contextlib.aclosing(api.motion.stream(wish)) as messages:
            await anext(messages)
            return service.subscriptions[-1].wish.resume.same_agents

    token = await token_of(ids[0])
    assert await is_same(token, ids[0])
    assert not await is_same(token, *ids)
    assert not await is_same(token)
    assert await is_same(await token_of(*ids), *reversed(ids))
    assert await is_same(await token_of())


async def test_events_that_did_not_arrive_are_told_again():
    """The client went away between a batch and the second of its events."""
    service = FakeService()
    api = await opened(service)
    session_id, _ = await session_of_two(api)
    async with contextlib.aclosing(stream(api, session_id)) as messages:
        await anext(messages)
        service.emit(session_id, REACHED, DONE)
        with_events = (await anext(messages)).batch.resume_token
    service.emit(session_id)
    _, *rest = await resumed(api, session_id, with_events, 3)
    assert kinds(rest) == ["event", "event", "batch"]
    assert list(rest[2].batch.chunks.seqs) == [1, 1]


async def test_events_that_arrived_are_not_told_again():
    service = FakeService()
    api = await opened(service)
    session_id, _ = await session_of_two(api)
    events = api.motion.events(schema.StreamWish(session_id=session_id))
    async with contextlib.aclosing(events):
        assert await anext(events) is None  # a sign of life at once
        service.emit(session_id, REACHED, DONE)
        (first, one), (second, two) = await take(events, 2)
    assert (one, two) == (REACHED, DONE)
    service.emit(session_id)
    _, *rest = await resumed(api, session_id, first, 2)
    assert (
        kinds(rest) == ["event", "batch"] and rest[0].event.kind == motion_pb2.EVENT_KIND_PATH_DONE
    )
    _, batch = await resumed(api, session_id, second, 1)
    assert list(batch.batch.chunks.seqs) == [1, 1]


async def test_a_token_of_another_life_does_not_resume():
    service = FakeService()
    api = await opened(service)
    session_id, _ = await session_of_two(api)
    (header,) = await resumed(api, session_id, "before-restart.7", 0)
    assert not header.header.resumed
    assert service.subscriptions[0].wish.resume == Resume("before-restart", 7)


@pytest.mark.parametrize("token", ["x", "1", ".", "a.b", "a.-1", "a.1.", "a.1.2.3", "a.1 ", "é.1"])
async def test_a_malformed_token_is_refused(token):
    api = await opened()
    with pytest.raises(InvalidArgument, match="not a resume token") as caught:
        await anext(stream(api, await session(api), resume_token=token))
    assert caught.value.field == "resume_token"


# the end


async def test_stream_ends_with_its_session():
    service = FakeService()
    api = await opened(service)
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


async def test_drain_tells_streams_ends_them_and_refuses_work():
    service = FakeService()
    api = await opened(service)
    session_id = await session(api)
    got = []

    async def read(messages) -> None:
        async with contextlib.aclosing(messages):
            async for message in messages:
                got.append(message)  # noqa: PERF401 what came before the error counts

    wish = schema.StreamWish(session_id=session_id)
    readers = [
        asyncio.create_task(read(messages))
        for messages in (stream(api, session_id), api.motion.events(wish))
    ]
    while len(service.subscriptions) < 2:
        await asyncio.sleep(0)
    await api.drain(grace=5.0)
    for reader in readers:
        with pytest.raises(Unavailable, match="shutting down"):
            await reader
    told = [item[1].kind for item in got if isinstance(item, tuple)]
    told += [m.event.kind for m in got if not isinstance(m, tuple | None) and m.HasField("event")]
    assert told == [EventKind.DRAINING, motion_pb2.EVENT_KIND_DRAINING]
    assert all(s.closed for s in service.subscriptions) and not api.ready
    with pytest.raises(Unavailable, match="shutting down"):
        await api.sessions.create(schema.NewSession())


async def test_a_broken_runtime_ends_streams_with_its_error():
    service = FakeService()
    api = await opened(service)
    messages = stream(api, await session(api))
    await anext(messages)
    service.break_down()
    with pytest.raises(Unavailable, match="has failed"):
        await anext(messages)


# clips and lock-step


async def test_a_clip_is_a_header_and_batches():
    service = FakeService()
    api = await opened(service)
    wish = schema.ClipWish(
        agent=schema.AgentSpec(seed=3, position=schema.Vector3(x=0, y=0, z=1)),
        goals=[schema.Goal(position=schema.Vector3(x=0, y=0, z=4))],
        seconds=0.6,
        basis="unity",
        format=schema.PoseFormat(fps=20),
    )
    header, *batches = [m async for m in api.motion.generate_clip(wish)]
    assert header.header.sent_fps == 20 and not header.header.basis.right_handed
    assert [seq for b in batches for seq in b.batch.chunks.seqs] == [0, 1, 2]
    (agent,) = batches[0].batch.added
    assert (agent.seed, agent.position.z) == (3, 1.0)
    assert service.specs[-1].noise_seed == 3


@pytest.mark.parametrize(
    ("wish", "field"),
    [
        ({"seconds": 121}, "seconds"),
        ({"seconds": 1, "format": {"fps": 7}}, "format.fps"),
        ({"seconds": 1, "agent": {"phenotype": {"height_m": 9}}}, "agent.phenotype.height_m"),
        ({"seconds": 1, "goals": [{"position": {"x": 0, "y": 0, "z": 0}}] * 257}, "goals"),
    ],
)
async def test_a_clip_that_cannot_be_made_names_the_field(wish, field):
    api = await opened()
    with pytest.raises(InvalidArgument) as caught:
        await anext(api.motion.generate_clip(schema.ClipWish.model_validate(wish)))
    assert caught.value.field == field


async def test_time_passes_step_by_step():
    service = FakeService()
    api = await opened(service, Limits(steps_per_call=2))
    session_id, _ = await session_of_two(api, lock_step=True)
    reply = await api.motion.step(session_id, schema.StepWish())
    assert len(reply.batches) == 1 and len(reply.batches[0].added) == 2
    reply = await api.motion.step(session_id, schema.StepWish(steps=2))
    assert [seq for b in reply.batches for seq in b.chunks.seqs] == [1, 1, 2, 2]
    assert not any(b.added for b in reply.batches)
    with pytest.raises(InvalidArgument, match="1 to 2 primitives per call, not 3"):
        await api.motion.step(session_id, schema.StepWish(steps=3))
    with pytest.raises(FailedPrecondition, match="lock-step"):
        await api.motion.step(await session(api), schema.StepWish())
    await api.agents.create(session_id, TWO)
    assert len((await api.motion.step(session_id, schema.StepWish())).batches[0].added) == 2
