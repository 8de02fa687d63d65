import pytest

from tests.transport.gateway.calls import session_of_two
from wayfarer.errors import InvalidArgument
from wayfarer.transport import schema
from wayfarer.transport.conversion.basis import Basis
from wayfarer.world import behaviours as world
from wayfarer.world.agents.goal import Goal

# Unreal: centimetres, x is forward (+Y of the world), y is right, headings turn the other way
HERE = {"x": 200, "y": 100, "z": 0}
SPOT = pytest.approx((1.0, 2.0))
GOAL = {"position": HERE}
MEANT = Goal(pytest.approx((1.0, 2.0, 0.0)))
AREA = {"area": {"center": HERE, "radius": 300}, "speed": 150}
WANDER = world.Wander(SPOT, pytest.approx(3.0), pytest.approx(1.5))
BEHAVIOURS = [
    ({"wander": AREA}, WANDER),
    ({"patrol": {"goals": [GOAL, GOAL], "to_and_fro": True}}, world.Patrol((MEANT, MEANT), True)),
    ({"follow": {"agent_id": "a", "behind": 150, "right": -50}}, world.Follow("a", 1.5, -0.5)),
    ({"keep_away": {"place": HERE}}, world.KeepAway(place=SPOT)),
    ({"keep_away": {"agent_id": "a", "distance": 300}}, world.KeepAway("a", distance=3.0)),
    (
        {"queue": {"name": "till", "head": HERE, "heading": 0.5, "spacing": 80}},
        world.Queue("till", SPOT, -0.5, pytest.approx(0.8)),
    ),
    (
        {"routine": {"parts": [{"visit": {"goals": [GOAL]}}, {"wander": AREA, "seconds": 9}]}},
        world.Routine((world.Part(world.Visit((MEANT,))), world.Part(WANDER, 9.0))),
    ),
]


@pytest.mark.parametrize(("body", "meant"), BEHAVIOURS)
async def test_behaviours_are_in_the_basis_of_the_session(service, api, body, meant):
    _, (agent, _) = await session_of_two(api, basis=Basis.UNREAL)
    await api.goals.behave(agent.agent_id, schema.Behaviour.model_validate(body))
    assert service.commands == [(agent.agent_id, meant)]


@pytest.mark.parametrize(
    ("told", "body", "named"),
    [
        ("behaviour.radius", {"wander": AREA}, "behaviour.wander.area.radius"),
        (
            "behaviour.parts[0].radius",
            {"routine": {"parts": [{"wander": AREA}]}},
            "behaviour.routine.parts[0].wander.area.radius",
        ),
    ],
)
async def test_what_the_world_refuses_is_named_as_the_client_wrote_it(
    service, api, told, body, named
):
    _, (agent, _) = await session_of_two(api)

    async def refuse(*_: object) -> int:
        raise InvalidArgument(f"{told} is 9", told)

    service.give = refuse
    with pytest.raises(InvalidArgument) as caught:
        await api.goals.behave(agent.agent_id, schema.Behaviour.model_validate(body))
    assert caught.value.field == named and str(caught.value) == f"{named} is 9"
