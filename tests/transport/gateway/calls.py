"""Short ways to call a gateway."""

from contextlib import aclosing, contextmanager

from tests.transport.samples import NOW
from wayfarer.transport import schema
from wayfarer.transport.conversion.basis import Basis
from wayfarer.transport.edge.caller import LOCAL, Caller, Quota, Scope, enter
from wayfarer.v1 import motion_pb2
from wayfarer.world.events import Event, EventKind

ORIGIN = schema.Vector3(x=0, y=0, z=0)
GOAL = schema.Goal(position=ORIGIN)
REACHED = Event(EventKind.GOAL_REACHED, NOW, "agent-2", 1, 3, 4, "there")
DONE = Event(EventKind.PATH_DONE, NOW, "agent-2", 1, 3, 4)
TWO = schema.NewAgents(agents=[schema.AgentSpec(seed=1), schema.AgentSpec(seed=2, gender="male")])


def caller(name: str, *scopes: Scope, quota: Quota = Quota()) -> Caller:
    return Caller(name, frozenset(scopes or (Scope.READ, Scope.CONTROL)), quota)


@contextmanager
def called_by(who: Caller):
    """Calls inside are made by `who`."""
    enter(who)
    try:
        yield
    finally:
        enter(LOCAL)


async def session(api, basis: Basis = Basis.GLTF, **options: object) -> str:
    return (await api.sessions.create(schema.NewSession(basis=basis, **options))).session_id


async def session_of_two(api, **options: object) -> tuple[str, list[schema.Agent]]:
    session_id = await session(api, **options)
    return session_id, list((await api.agents.create(session_id, TWO)).agents)


async def stream(api, session_id: str, **options: object):
    sent = api.motion.stream(schema.StreamRequest(session_id=session_id, **options))
    async with aclosing(sent):
        async for message in sent:
            yield motion_pb2.StreamMotionResponse.FromString(message)


async def take(messages, number: int):
    return [await anext(messages) for _ in range(number)]


def kinds(messages) -> list[str]:
    return [message.WhichOneof("payload") for message in messages]
