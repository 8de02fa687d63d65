"""Streams that resume where another one was cut off."""

import asyncio
import contextlib

import pytest

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
from wayfarer.errors import InvalidArgument, ResourceExhausted
from wayfarer.runtime.streams.publications import Resume
from wayfarer.transport import schema
from wayfarer.v1 import motion_pb2
from wayfarer.world.agents.agent import AgentSpec
from wayfarer.world.events import Event, EventKind


async def token_of(api, service, session_id: str, *events, **options: object) -> str:
    """The token of a stream's first batch, whose events are lost."""
    async with contextlib.aclosing(stream(api, session_id, **options)) as messages:
        await anext(messages)
        service.emit(session_id, *events)
        return (await anext(messages)).batch.resume_token


async def resumed(api, session_id: str, token: str, number: int):
    async with contextlib.aclosing(stream(api, session_id, resume_token=token)) as messages:
        return await take(messages, 1 + number)


async def test_a_stream_goes_on_where_its_token_left_off(service, api):
    session_id, _ = await session_of_two(api)
    token = await token_of(api, service, session_id)
    for _ in range(2):
        service.emit(session_id)
    header, *batches = await resumed(api, session_id, token, 2)
    assert header.header.resumed
    assert [seq for b in batches for seq in b.batch.chunks.seqs] == [1, 1, 2, 2]
    assert len(batches[0].batch.added) == 2  # sent again, since it is another connection


async def test_a_stream_that_resumes_is_told_who_was_deleted_meanwhile(service, api):
    session_id, (first, second) = await session_of_two(api)
    token = await token_of(api, service, session_id)
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


async def test_a_stream_that_resumes_is_told_of_who_left_before_it_showed_them_again(service, api):
    session_id = await session(api)
    (guest,) = await service.create_agents(session_id, [AgentSpec()])
    token = await token_of(api, service, session_id)
    await service.delete_agent(guest.agent_id)
    service.emit(session_id, Event(EventKind.AGENT_LEFT, NOW, guest.agent_id, guest.alias))
    service.emit(session_id)
    _, left, batch = await resumed(api, session_id, token, 2)
    assert left.event.alias == guest.alias and list(batch.batch.removed) == [guest.alias]


ONE = schema.NewAgents(agents=[schema.AgentSpec(seed=1)])


async def test_agents_that_are_being_created_while_a_stream_resumes_are_shown(service, api):
    session_id, _ = await session_of_two(api)
    token = await token_of(api, service, session_id)
    service.slow = asyncio.Event()
    coming = asyncio.create_task(api.agents.create(session_id, ONE))
    await asyncio.sleep(0.01)
    async with contextlib.aclosing(stream(api, session_id, resume_token=token)) as messages:
        await anext(messages)
        service.slow.set()
        (new,) = (await coming).agents
        service.emit(session_id)
        (batch,) = await take(messages, 1)
        assert not batch.batch.removed
        assert list(batch.batch.chunks.aliases) == [1, 2, new.alias]


async def test_agents_that_could_not_be_created_are_not_gone(service, api):
    session_id, _ = await session_of_two(api)
    create, going = service.create_agents, asyncio.Event()

    async def refuse(*_: object) -> None:
        await going.wait()
        raise ResourceExhausted("no room")

    service.create_agents = refuse
    failing = asyncio.create_task(api.agents.create(session_id, ONE))
    await asyncio.sleep(0.01)
    service.create_agents = create
    await api.agents.create(session_id, ONE)  # so that the counter of seeds is not reset
    going.set()
    await asyncio.gather(failing, return_exceptions=True)
    token = await token_of(api, service, session_id)
    async with contextlib.aclosing(stream(api, session_id, resume_token=token)) as messages:
        await anext(messages)
        (new,) = (await api.agents.create(session_id, ONE)).agents
        service.emit(session_id)
        (batch,) = await take(messages, 1)
        assert not batch.batch.removed and new.alias in batch.batch.chunks.aliases


async def test_a_token_knows_which_agents_were_followed(service, api):
    session_id, (first, second) = await session_of_two(api)
    ids = (first.agent_id, second.agent_id)

    async def following(*agent_ids: str) -> str:
        return await token_of(api, service, session_id, agent_ids=agent_ids)

    async def is_same(token: str, *agent_ids: str) -> bool:
        request = schema.StreamRequest(
            session_id=session_id, resume_token=token, agent_ids=agent_ids
        )
        async with contextlib.aclosing(api.motion.stream(request)) as messages:
            await anext(messages)
            return service.subscriptions[-1].options.resume.same_agents

    token = await following(ids[0])
    assert await is_same(token, ids[0])
    assert not await is_same(token, *ids)
    assert not await is_same(token)
    assert await is_same(await following(*ids), *reversed(ids))
    assert await is_same(await following())


async def test_events_that_did_not_arrive_are_told_again(service, api):
    """The client went away between a batch and the second of its events."""
    session_id, _ = await session_of_two(api)
    with_events = await token_of(api, service, session_id, REACHED, DONE)
    service.emit(session_id)
    _, *rest = await resumed(api, session_id, with_events, 3)
    assert kinds(rest) == ["event", "event", "batch"]
    assert list(rest[2].batch.chunks.seqs) == [1, 1]


async def test_events_that_arrived_are_not_told_again(service, api):
    session_id, _ = await session_of_two(api)
    events = api.motion.events(schema.StreamRequest(session_id=session_id))
    async with contextlib.aclosing(events):
        assert await anext(events) is None  # a sign of life at once
        service.emit(session_id, REACHED, DONE)
        (first, one), (second, two) = await take(events, 2)
    reached, done = motion_pb2.EVENT_KIND_GOAL_REACHED, motion_pb2.EVENT_KIND_PATH_DONE
    assert (one.kind, two.kind) == (reached, done)
    service.emit(session_id)
    _, *rest = await resumed(api, session_id, first, 2)
    assert (
        kinds(rest) == ["event", "batch"] and rest[0].event.kind == motion_pb2.EVENT_KIND_PATH_DONE
    )
    _, batch = await resumed(api, session_id, second, 1)
    assert list(batch.batch.chunks.seqs) == [1, 1]


async def test_a_token_of_another_life_does_not_resume(service, api):
    session_id, _ = await session_of_two(api)
    (header,) = await resumed(api, session_id, "before-restart.7", 0)
    assert not header.header.resumed
    assert service.subscriptions[0].options.resume == Resume("before-restart", 7)


@pytest.mark.parametrize("token", ["x", "1", ".", "a.b", "a.-1", "a.1.", "a.1.2.3", "a.1 ", "é.1"])
async def test_a_malformed_token_is_refused(token, api):
    with pytest.raises(InvalidArgument, match="not a resume token") as caught:
        await anext(stream(api, await session(api), resume_token=token))
    assert caught.value.field == "resume_token"
