"""Idempotency."""

import asyncio

import pytest

from tests.transport.fakes import opened
from tests.transport.gateway.calls import called_by, caller, session
from tests.transport.samples import NOW
from tests.world.fakes import ManualClock
from wayfarer.config.limits import Limits
from wayfarer.endpoint import Endpoint
from wayfarer.errors import Aborted, Misdirected, ResourceExhausted
from wayfarer.ids import group_of
from wayfarer.ownership import SingleNode
from wayfarer.transport import schema
from wayfarer.transport.conversion.bodies import BodyLibrary
from wayfarer.transport.gateway import Gateway
from wayfarer.transport.gateway.idempotency import KEPT, IdempotencyCache

REQUEST = schema.NewSession(request_id="a", basis="unity")
AGENTS = schema.NewAgents(request_id="b", agents=[schema.AgentSpec()])


async def test_agents_that_a_server_made_before_its_end_are_found_and_not_made_again(service, api):
    request = AGENTS.model_copy(update={"agents": (schema.AgentSpec(), schema.AgentSpec())})
    session_id = (await api.sessions.create(REQUEST)).session_id
    made = await api.agents.create(session_id, request)
    after = await opened(service)  # after a restart, or on the node that has adopted the session
    assert await after.agents.create(session_id, request) == made
    await after.agents.delete(made.agents[0].agent_id)
    again = await opened(service)
    assert (await again.agents.create(session_id, request)).agents == made.agents[1:]
    other = request.model_copy(update={"request_id": "c"})
    ids = {
        one.agent_id
        for one in (*made.agents, *(await again.agents.create(session_id, other)).agents)
    }
    assert len(ids) == 4


async def test_what_a_server_made_before_its_end_is_found_and_not_made_again(service, api):
    corridor = "corridor", schema.NewExampleScene(request_id="b")
    alone, scene = await api.sessions.create(REQUEST), await api.scenes.create_example(*corridor)
    inside = REQUEST.model_copy(update={"request_id": "c", "scene": scene.scene_id})
    within = await api.sessions.create(inside)
    assert group_of(within.session_id) == group_of(scene.scene_id) != group_of(alone.session_id)
    after = await opened(service)  # after a restart, or on the node that has adopted them
    assert await after.sessions.create(REQUEST) == alone
    assert (await after.scenes.create_example(*corridor)).scene_id == scene.scene_id
    assert await after.sessions.create(inside) == within
    await after.sessions.delete(alone.session_id)
    again = await opened(service)
    assert (await again.sessions.create(REQUEST)).created_at_us, "what has ended is made again"
    assert len(service.registry.infos()) == 1 and service.created == 3
    with called_by(caller("bob")):
        assert (await again.sessions.create(REQUEST)).session_id != alone.session_id


async def test_a_request_that_another_node_has_answered_is_sent_there(service):
    there = Endpoint(1, 1001, 2001, "10.0.0.2")

    class Ownership(SingleNode):
        def endpoint_of(self, name):
            return there if name.startswith("session-") else None

    bodies = BodyLibrary("anny52")
    api = Gateway(service, bodies, Limits(), ManualClock(NOW), lambda: None, Ownership())
    await api.take_over()
    with pytest.raises(Misdirected) as error:
        await api.sessions.create(REQUEST)
    assert error.value.endpoint == there and not service.created


async def test_without_an_id_each_is_another(api):
    assert await session(api) != await session(api)


async def test_an_id_that_was_used_for_another_request_is_refused(api):
    one = await api.sessions.create(REQUEST)
    other = await session(api)
    await api.agents.create(one.session_id, AGENTS)
    for call in (
        api.sessions.create(REQUEST.model_copy(update={"seed": 9})),
        api.agents.create(one.session_id, AGENTS.model_copy(update={"request_id": "a"})),
        api.agents.create(other, AGENTS),
    ):
        with pytest.raises(Aborted, match="request id"):
            await call


async def test_callers_do_not_share_ids(api):
    made = set()
    for name in ("ada", "bob"):
        with called_by(caller(name)):
            made.add((await api.sessions.create(REQUEST)).session_id)
    assert len(made) == 2


async def test_duplicates_wait_for_the_first_even_when_it_has_gone_away(service, api):
    service.slow = asyncio.Event()
    calls = [asyncio.create_task(api.sessions.create(REQUEST)) for _ in range(3)]
    for _ in range(3):
        await asyncio.sleep(0)
    calls[0].cancel()
    service.slow.set()
    _, second, third = await asyncio.gather(*calls, return_exceptions=True)
    assert second == third and service.created == 1


async def test_a_request_that_failed_may_be_tried_again(service, api):
    session_id = await session(api)
    service.fail_with = ResourceExhausted("full")
    with pytest.raises(ResourceExhausted):
        await api.agents.create(session_id, AGENTS)
    assert len((await api.agents.create(session_id, AGENTS)).agents) == 1


async def test_replies_are_forgotten_after_ten_minutes(service, clock, api):
    await api.sessions.create(REQUEST)
    clock.now += 599
    await api.sessions.create(REQUEST)
    assert service.created == 1
    clock.now += 2
    await api.sessions.create(REQUEST)
    assert service.created == 2


async def test_replies_of_a_caller_are_bounded():
    done = []

    async def act(digest: str) -> int:
        done.append(None)
        return len(done)

    replies = IdempotencyCache(ManualClock(NOW))
    for number in range(KEPT + 1):
        await replies.once(f"id-{number}", ("here", REQUEST), act)
    assert await replies.once(f"id-{KEPT}", ("here", REQUEST), act) == KEPT + 1  # remembered
    assert await replies.once("id-0", ("here", REQUEST), act) == KEPT + 2  # forgotten
