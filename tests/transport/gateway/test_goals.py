import pytest

from tests.transport.fakes import FakeService, opened
from tests.transport.gateway.calls import GOAL, session_of_two
from wayfarer.errors import Aborted
from wayfarer.transport import schema
from wayfarer.transport.basis import Basis
from wayfarer.world.agents.agent import Goal
from wayfarer.world.behaviours import Patrol, Wander
from wayfarer.world.goals.commands import Append, Path, Stop

GOALS = schema.Goals(goals=[GOAL, GOAL])
PLACE = Goal((0.0, 0.0, 0.0))


async def test_every_wish_becomes_a_command_with_the_revision_that_it_expects():
    service = FakeService()
    api = await opened(service)
    _, (agent, _) = await session_of_two(api)
    area = schema.Wander(area={"center": {"x": 0, "y": 0, "z": 0}, "radius": 3})
    patrol = schema.Behaviour(patrol={"goals": GOALS.goals})
    give = api.goals.give
    assert await give(agent.agent_id, GOAL, 0) == 1
    assert await give(agent.agent_id, GOALS, 1) == 2
    assert await give(agent.agent_id, GOALS, 2, append=True) == 3
    assert await give(agent.agent_id, area, 3) == 4
    assert await give(agent.agent_id, patrol, 4) == 5
    assert await give(agent.agent_id, None) == 6
    assert service.expected == [0, 1, 2, 3, 4, None]
    both = (PLACE, PLACE)
    assert [command for _, command in service.commands] == [
        PLACE,
        Path(both),
        Append(both),
        Wander((0.0, 0.0), 3.0),
        Patrol(both),
        Stop(),
    ]
    with pytest.raises(Aborted, match="stale"):
        await give(agent.agent_id, None, 7)


async def test_wandering_is_in_the_basis_of_the_session():
    service = FakeService()
    api = await opened(service)
    _, (agent, _) = await session_of_two(api, basis=Basis.UNREAL)
    center = schema.Vector3(x=200, y=100, z=0)
    area = schema.Wander(area=schema.Area(center=center, radius=300), speed=150)
    await api.goals.give(agent.agent_id, area)
    assert service.commands[-1][1] == Wander(
        pytest.approx((1.0, 2.0)), pytest.approx(3.0), pytest.approx(1.5), 0.0
    )
