import pytest

from tests.transport.fakes import FakeService, opened
from tests.transport.gateway.calls import GOAL, session_of_two
from wayfarer.config import Limits
from wayfarer.errors import Aborted, InvalidArgument
from wayfarer.runtime.agent import Goal, Wander
from wayfarer.transport import schema
from wayfarer.transport.basis import Basis

GOALS = schema.Goals(goals=[GOAL, GOAL])


async def test_every_change_returns_its_revision_and_hands_on_the_expected_one():
    service = FakeService()
    api = await opened(service)
    _, (agent, _) = await session_of_two(api)
    area = schema.Wander(area={"center": {"x": 0, "y": 0, "z": 0}, "radius": 3})
    assert await api.goals.set(agent.agent_id, GOAL, 0) == 1
    assert await api.goals.set_path(agent.agent_id, GOALS, 1) == 3
    assert await api.goals.append(agent.agent_id, GOALS, 3) == 5
    assert await api.goals.wander(agent.agent_id, area, 5) == 6
    assert await api.goals.clear(agent.agent_id, 6) == 7
    assert await api.goals.set(agent.agent_id, GOAL) == 8
    assert service.expected == [0, 1, 3, 5, 6, None]
    with pytest.raises(Aborted, match="stale"):
        await api.goals.clear(agent.agent_id, 7)


async def test_wandering_is_in_the_basis_of_the_session():
    service = FakeService()
    api = await opened(service)
    _, (agent, _) = await session_of_two(api, basis=Basis.UNREAL)
    center = schema.Vector3(x=200, y=100, z=0)
    area = schema.Wander(area=schema.Area(center=center, radius=300), speed=150)
    await api.goals.wander(agent.agent_id, area)
    assert service.goals[-1][1] == Wander(
        pytest.approx((1.0, 2.0)), pytest.approx(3.0), pytest.approx(1.5), 0.0
    )


async def test_the_goals_of_a_path_are_limited():
    service = FakeService()
    api = await opened(service, Limits(path_goals=1))
    _, (agent, _) = await session_of_two(api)
    for change in (api.goals.set_path, api.goals.append):
        with pytest.raises(InvalidArgument, match="1 goals at most, not 2") as caught:
            await change(agent.agent_id, GOALS)
        assert caught.value.field == "goals"
    await api.goals.set_path(agent.agent_id, schema.Goals(goals=[GOAL]))
    assert service.goals == [(agent.agent_id, Goal((0.0, 0.0, 0.0)))]
