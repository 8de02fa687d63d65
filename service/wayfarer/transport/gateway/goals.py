"""Goal commands of clients, converted to world space."""

import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any

from wayfarer.errors import InvalidArgument
from wayfarer.transport import schema
from wayfarer.transport.conversion.basis import Axes
from wayfarer.transport.conversion.convert import in_basis
from wayfarer.transport.conversion.units import in_world
from wayfarer.transport.conversion.violations import renamed
from wayfarer.transport.gateway.context import GatewayContext, implements
from wayfarer.world import behaviours
from wayfarer.world.agents.goal import Goal
from wayfarer.world.goals.commands import Append, GoalCommand, Path, Stop

CommandRequest = schema.Goal | schema.Goals | schema.Wander | schema.Behaviour | None


class GoalApi:
    """GoalService. Each call returns the new revision.

    All raise what `MotionService.give` raises. InvalidArgument names the field as the client wrote
    it; Unreachable has the nearest place in the session's basis.
    """

    def __init__(self, context: GatewayContext) -> None:
        self._context = context

    @implements("SetGoal")
    async def set_goal(
        self, agent_id: str, goal: schema.Goal, expected_revision: int | None = None
    ) -> schema.GoalRevision:
        """Replaces the agent's goal, path or behaviour with a goal."""
        return await self._give(agent_id, goal, expected_revision)

    @implements("SetPath")
    async def set_path(
        self, agent_id: str, path: schema.Goals, expected_revision: int | None = None
    ) -> schema.GoalRevision:
        """Replaces the agent's goal, path or behaviour with goals to visit in turn."""
        return await self._give(agent_id, path, expected_revision)

    @implements("AppendGoals")
    async def append_goals(
        self, agent_id: str, more: schema.Goals, expected_revision: int | None = None
    ) -> schema.GoalRevision:
        """Adds goals to the end of the path."""
        return await self._give(agent_id, more, expected_revision, append=True)

    @implements("Wander")
    async def wander(
        self, agent_id: str, request: schema.Wander, expected_revision: int | None = None
    ) -> schema.GoalRevision:
        """Replaces the agent's goal, path or behaviour with the behaviour `wander`."""
        return await self._give(agent_id, request, expected_revision)

    @implements("Behave")
    async def behave(
        self, agent_id: str, behaviour: schema.Behaviour, expected_revision: int | None = None
    ) -> schema.GoalRevision:
        """Replaces the agent's goal, path or behaviour with a behaviour."""
        return await self._give(agent_id, behaviour, expected_revision)

    @implements("ClearGoal")
    async def clear_goal(
        self, agent_id: str, expected_revision: int | None = None
    ) -> schema.GoalRevision:
        """Removes the agent's goal, path or behaviour, so that it stops."""
        return await self._give(agent_id, None, expected_revision)

    async def _give(
        self, agent_id: str, request: CommandRequest, expected: int | None, append: bool = False
    ) -> schema.GoalRevision:
        axes = (await self._context.session_of(agent_id)).basis.axes
        command = _command(request, axes, append)
        with _fields_named(request), in_basis(axes):
            number = await self._context.service.give(agent_id, command, expected)
        return schema.GoalRevision(revision=number)


def _command(request: CommandRequest, axes: Axes, append: bool) -> GoalCommand:
    """The command in world space; missing fields take the world's defaults."""
    match request:
        case None:
            return Stop()
        case schema.Goal():
            return in_world(Goal, request, axes)
        case schema.Goals():
            return (Append if append else Path)(path(request.goals, axes))
    return _behaviour(request, axes)


def _behaviour(request: schema.Message, axes: Axes) -> Any:
    """A behaviour in world space, of its name's class; missing fields take its defaults."""
    others: dict[str, Any] = {}
    match request:
        case schema.Behaviour():
            return _behaviour(request.given[1], axes)
        case schema.Part():
            return behaviours.Part(_behaviour(request.given[1], axes), request.seconds)
        case schema.Routine():
            others["parts"] = tuple(_behaviour(part, axes) for part in request.parts)
        case schema.Wander(area=area):
            request = request.model_copy(update={"area": None})
            others = in_world(dict[str, Any], area, axes) if area else {"center": None}
        case schema.Patrol() | schema.Visit():
            others["goals"] = path(request.goals, axes)
    return in_world(behaviours.KINDS[type(request).__name__], request, axes, **others)


def path(goals: Iterable[schema.Goal], axes: Axes) -> tuple[Goal, ...]:
    """Goals in world space; missing fields take the world's defaults."""
    return tuple(in_world(Goal, goal, axes) for goal in goals)


@contextmanager
def _fields_named(request: CommandRequest) -> Iterator[None]:
    """Names the field at fault as the client wrote it, with the kind of each behaviour."""
    try:
        yield
    except InvalidArgument as error:
        raise renamed(error, _client_field(error.field, request)) from None


def _client_field(field: str, request: CommandRequest) -> str:
    """`behaviour.parts[1].radius` → `behaviour.routine.parts[1].wander.area.radius`."""
    match request:
        case schema.Wander():
            field = field.replace("behaviour.", "wander.", 1)
        case schema.Behaviour():
            kind, does = request.given
            field = re.sub(r"^behaviour(?=\b)", f"behaviour.{kind}", field)
            found = re.match(r"behaviour\.routine\.parts\[(\d+)\](?!\.seconds)", field)
            if found is not None and isinstance(does, schema.Routine):
                part = does.parts[int(found[1])].given[0]
                field = f"{found[0]}.{part}{field[found.end() :]}"
    field = re.sub(r"\bwander\.(?=center|radius)", "wander.area.", field)
    return field.removeprefix("wander.")
