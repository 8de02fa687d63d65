"""Control, apart from its transports."""

import asyncio
from contextlib import aclosing

import pytest

from tests.transport.fakes import opened
from tests.transport.gateway.calls import called_by, caller, session_of_two
from wayfarer.errors import InvalidArgument, NotFound
from wayfarer.transport.edge import call_rates as limits
from wayfarer.transport.edge.caller import Scope
from wayfarer.transport.streams.control import control
from wayfarer.v1 import control_pb2


class Client:
    """Requests are sent one by one; `taken` of them have been read."""

    def __init__(self) -> None:
        self._queue: asyncio.Queue[control_pb2.ControlRequest | None] = asyncio.Queue()
        self.taken = 0

    def send(self, **payload: object) -> None:
        self._queue.put_nowait(control_pb2.ControlRequest(**payload))

    def leave(self) -> None:
        self._queue.put_nowait(None)

    async def requests(self):
        while (request := await self._queue.get()) is not None:
            self.taken += 1
            yield request


async def read(messages):
    async with aclosing(messages):
        async for message in messages:
            yield control_pb2.ControlResponse.FromString(message)


async def begun(api, client: Client, session_id: str):
    client.send(open={"session_id": session_id})
    messages = read(control(api, client.requests()))
    assert (await anext(messages)).motion.HasField("header")
    return messages


async def test_commands_are_answered_in_order_and_a_bad_one_ends_nothing(api):
    session_id, (agent, _) = await session_of_two(api)
    of = {"agent_id": agent.agent_id}
    client = Client()
    async with aclosing(await begun(api, client, session_id)) as messages:
        client.send(command_id=1, clear_goal=of)
        client.send(command_id=2, clear_goal={**of, "expected_revision": 4})
        client.send(command_id=3, set_goal={**of, "goal": {"position": {"x": float("nan")}}})
        client.send(command_id=4, set_goal={"agent_id": "x", "goal": {"position": {}}})
        client.send(command_id=5, open={"session_id": session_id})
        client.send(command_id=6)
        client.send(command_id=7, clear_goal=of)
        replies = [(await anext(messages)).reply for _ in range(7)]
    assert [r.command_id for r in replies] == list(range(1, 8))
    assert [r.revision for r in replies] == [1, 0, 0, 0, 0, 0, 2]
    problems = [(r.problem.code, r.problem.field) for r in replies if r.HasField("problem")]
    assert problems == [(10, ""), (3, "goal.position.x"), (5, ""), (3, "open"), (3, "payload")]


async def test_acknowledgements_reach_the_subscription(service, api):
    session_id, _ = await session_of_two(api)
    client = Client()
    async with aclosing(await begun(api, client, session_id)) as messages:
        service.emit(session_id)
        token = (await anext(messages)).motion.batch.resume_token
        client.send(ack={"resume_token": token, "playhead_us": 2_500_000})
        client.send(ack={"resume_token": "another-life.9", "playhead_us": 1})
        client.send(ack={"resume_token": "?", "playhead_us": 1})
        reply = (await anext(messages)).reply
    assert (reply.problem.code, reply.problem.field) == (3, "resume_token")
    assert service.subscriptions[0].acks == [(1, 2.5)]


async def test_a_flood_of_commands_is_not_read_ahead(service, api):
    session_id, (agent, _) = await session_of_two(api)
    client = Client()
    async with aclosing(await begun(api, client, session_id)) as messages:
        for _ in range(1000):
            client.send(clear_goal={"agent_id": agent.agent_id})
        service.emit(session_id)
        got = [await anext(messages) for _ in range(5)]
        assert client.taken <= 8
    assert sum(m.HasField("motion") for m in got) == 1  # nor does it starve the motion


async def test_commands_count_as_calls(monkeypatch, api):
    session_id, (agent, _) = await session_of_two(api)
    counted = []
    limits.count_with(lambda: counted.append(None))
    client = Client()
    async with aclosing(await begun(api, client, session_id)) as messages:
        client.send(ack={})
        client.send(clear_goal={"agent_id": agent.agent_id})
        await anext(messages)
    limits.count_with(lambda: None)
    assert counted == [None]


async def test_a_reader_may_follow_and_not_command(api):
    with called_by(caller("ada")):
        session_id, (agent, _) = await session_of_two(api)
    with called_by(caller("ada", Scope.READ)):
        client = Client()
        async with aclosing(await begun(api, client, session_id)) as messages:
            client.send(clear_goal={"agent_id": agent.agent_id})
            problem = (await anext(messages)).reply.problem
    assert problem.code == 7 and "scope control" in problem.message


@pytest.mark.parametrize("first", [{"ack": {}}, {}, None])
async def test_the_first_message_opens(first, api):
    client = Client()
    client.leave() if first is None else client.send(**first)
    with pytest.raises(InvalidArgument, match="first message must be `open`"):
        await anext(control(api, client.requests()))


async def test_a_client_that_says_nothing_is_not_waited_for(monkeypatch):
    monkeypatch.setattr("wayfarer.transport.streams.control.OPEN_TIMEOUT_S", 0.01)
    with pytest.raises(InvalidArgument, match="first message must be `open`"):
        await anext(control(await opened(), Client().requests()))


async def test_an_open_that_fails_ends_the_stream():
    client = Client()
    client.send(open={"session_id": "x"})
    with pytest.raises(NotFound):
        await anext(control(await opened(), client.requests()))
