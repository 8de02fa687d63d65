import asyncio

import pytest

from tests.transport.fakes import opened
from tests.transport.gateway.calls import TWO, called_by, caller, session, session_of_two
from wayfarer.body.outfit import look
from wayfarer.config.limits import Limits
from wayfarer.errors import InvalidArgument, ResourceExhausted
from wayfarer.transport import schema
from wayfarer.transport.edge.caller import Quota

UNSEEDED = schema.NewAgents(agents=[schema.AgentSpec(), schema.AgentSpec(seed=5)])


async def test_agents_per_call_are_limited():
    api = await opened(limits=Limits(agents_per_call=1))
    with pytest.raises(InvalidArgument, match="1 to 1 agents per call, not 2") as caught:
        await api.agents.create(await session(api), TWO)
    assert caught.value.field == "agents"


async def seeds(api, session_id: str) -> list[int]:
    return [agent.seed for agent in (await api.agents.list_of(session_id)).agents]


async def test_seeds_are_drawn_from_the_sessions_and_the_agents_before(api):
    one, same, other = [await session(api, seed=seed) for seed in (7, 7, 8)]
    for session_id in (one, same, other):
        await api.agents.create(session_id, UNSEEDED)
        await api.agents.create(session_id, UNSEEDED)
    drawn = await seeds(api, one)
    assert drawn == await seeds(api, same)
    assert drawn[1] == drawn[3] == 5
    assert len({drawn[0], drawn[2], *(await seeds(api, other))}) == 5  # two, two others, and 5


async def test_a_deleted_agent_counts_and_a_refused_one_does_not(service, api):
    plain, deleted, refused = [await session(api, seed=7) for _ in range(3)]
    for session_id in (plain, deleted, refused):
        (first, _) = (await api.agents.create(session_id, UNSEEDED)).agents
        if session_id == deleted:
            await api.agents.delete(first.agent_id)
        if session_id == refused:
            service.fail_with = ResourceExhausted("full")
            with pytest.raises(ResourceExhausted):
                await api.agents.create(session_id, UNSEEDED)
        await api.agents.create(session_id, UNSEEDED)
    assert (await seeds(api, plain))[1:] == await seeds(api, deleted)
    assert await seeds(api, plain) == await seeds(api, refused)


async def test_an_agent_is_forgotten_though_the_caller_who_deletes_it_goes_away(service, api):
    delete, going = service.delete_agent, asyncio.Event()

    async def slowly(agent_id: str) -> None:
        await delete(agent_id)
        await going.wait()

    service.delete_agent = slowly
    with called_by(caller("ada", quota=Quota(agents=3))):
        session_id, (agent, _) = await session_of_two(api)
        call = asyncio.create_task(api.agents.delete(agent.agent_id))
        await asyncio.sleep(0.01)
        call.cancel()
        going.set()
        await asyncio.sleep(0.01)
        await api.agents.create(session_id, TWO)


async def test_what_is_absent_from_an_update_stays(api):
    _, (agent, _) = await session_of_two(api)
    named = await api.agents.update(agent.agent_id, schema.AgentUpdate(name="Ada"))
    assert named == agent.model_copy(update={"name": "Ada"})
    slid = await api.agents.update(agent.agent_id, schema.AgentUpdate(foot_lock=False))
    assert (slid.name, slid.foot_lock) == ("Ada", False)
    assert await api.agents.get(agent.agent_id) == slid


async def test_an_agent_wears_what_is_asked_for_or_what_its_seed_chooses(api):
    asked = schema.NewAgents(
        agents=[schema.AgentSpec(outfit="suit"), schema.AgentSpec(outfit="0"), schema.AgentSpec()]
    )
    made = (await api.agents.create(await session(api), asked)).agents
    assert [agent.outfit for agent in made[:2]] == ["suit", "0"]
    assert made[2].outfit == look(made[2].seed, "female").outfit


async def test_an_outfit_that_there_is_not_is_refused(api):
    asked = schema.NewAgents(agents=[schema.AgentSpec(outfit="toga")])
    with pytest.raises(InvalidArgument, match="there are tee, sweater"):
        await api.agents.create(await session(api), asked)
