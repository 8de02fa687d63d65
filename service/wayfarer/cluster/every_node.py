"""Calls that concern all nodes: an entry asks each, as the caller, and joins the answers."""

import asyncio
from collections.abc import Awaitable, Callable, Iterable
from typing import Any, Final

import structlog

from wayfarer.cluster.messages import CALL_S, NodeInfo, NodeLink
from wayfarer.errors import Unavailable
from wayfarer.transport import schema
from wayfarer.transport.edge.caller import Caller, Scope, current_caller, enter
from wayfarer.transport.gateway import Gateway

log = structlog.get_logger(__name__)

MODEL_S: Final = 300.0
"""Within which a model is loaded."""

METHODS: Final[dict[str, Callable[[Gateway, dict[str, Any]], Awaitable[Any]]]] = {
    "list_sessions": lambda gateway, told: gateway.sessions.list_own(),
    "list_scenes": lambda gateway, told: gateway.scenes.list_own(),
    "load_model": lambda gateway, told: gateway.admin.load_model(told["request"]),
    "use_model": lambda gateway, told: gateway.admin.use_model(told["name"], told["request"]),
    "unload_model": lambda gateway, told: gateway.admin.unload_model(told["name"]),
}


async def answer(gateway: Gateway, method: str, caller: Caller, told: dict[str, Any]) -> Any:
    """A node's; the gateway checks whether the caller may."""
    enter(caller)
    return await METHODS[method](gateway, told)


Calls = dict[str, Callable[..., Awaitable[Any]]]
"""Methods by RPC, with the arguments of the gateway's."""


class EveryNode:
    """The calls. Each raises what a node raises, and Unavailable when one does not answer."""

    def __init__(
        self,
        link: NodeLink,
        nodes: Callable[[], Awaitable[list[NodeInfo]]],
        stop: Callable[[], None],
    ) -> None:
        """`stop` is what `drain` does."""
        self._link = link
        self._nodes = nodes
        self._stop = stop
        self.calls: Calls = {
            "ListSessions": self.list_sessions,
            "ListScenes": self.list_scenes,
            "LoadModel": self.load_model,
            "UseModel": self.use_model,
            "UnloadModel": self.unload_model,
            "Drain": self.drain,
        }

    async def list_sessions(self) -> schema.Sessions:
        """The caller's, oldest first."""
        lists = [one.sessions for one in await self._ask("list_sessions")]
        return schema.Sessions(sessions=_by_age(lists))

    async def list_scenes(self) -> schema.Scenes:
        """The caller's, oldest first."""
        lists = [one.scenes for one in await self._ask("list_scenes")]
        return schema.Scenes(scenes=_by_age(lists))

    async def load_model(self, request: schema.NewModel) -> schema.Model:
        """Everywhere."""
        found: list[schema.Model] = await self._ask("load_model", MODEL_S, request=request)
        return found[0]

    async def use_model(self, name: str, request: schema.ModelUse) -> schema.ModelUsed:
        """Everywhere; how many people of all nodes it moves now."""
        found = await self._ask("use_model", MODEL_S, name=name, request=request)
        return schema.ModelUsed(moved=sum(one.moved for one in found))

    async def unload_model(self, name: str) -> None:
        """Everywhere."""
        await self._ask("unload_model", name=name)

    async def drain(self) -> None:
        """End all that this command has started, as Ctrl-C does."""
        current_caller().require(Scope.ADMIN)
        log.info("drain asked for", caller=current_caller().name)
        self._stop()

    async def _ask(self, method: str, seconds: float = CALL_S, **told: Any) -> list[Any]:
        nodes, caller = await self._nodes(), current_caller()
        if not nodes:
            raise Unavailable("no node runs; they are starting or stopping")
        asked = (
            self._link.call(node, "ask", method, caller, told, seconds=seconds) for node in nodes
        )
        return await asyncio.gather(*asked)


def _by_age(lists: Iterable[Iterable[Any]]) -> tuple[Any, ...]:
    return tuple(sorted((one for found in lists for one in found), key=lambda o: o.created_at_us))
