"""Calls that concern all nodes: an entry asks each, as the caller, and joins the answers."""

import asyncio
import inspect
from collections.abc import Awaitable, Callable, Iterable
from typing import Any, Final

import structlog

from wayfarer.cluster.messages import CALL_S, NodeInfo, NodeLink
from wayfarer.errors import Unavailable
from wayfarer.transport import schema
from wayfarer.transport.edge.caller import Scope, current_caller
from wayfarer.transport.gateway.admin import AdminApi
from wayfarer.transport.gateway.scenes import SceneApi
from wayfarer.transport.gateway.sessions import SessionApi

log = structlog.get_logger(__name__)

MODEL_S: Final = 300.0
"""Seconds within which a model is loaded."""

Calls = dict[str, Callable[..., Awaitable[Any]]]
"""Methods by RPC, with the arguments of the gateway's."""

Asked = tuple[Callable[..., Any], float, Callable[[list[Any]], Any]]
"""The method that each node's gateway carries out, the seconds to wait, how answers are joined."""

ASKED: Final[dict[str, Asked]] = {
    "ListSessions": (
        SessionApi.list_own,
        CALL_S,
        lambda found: schema.Sessions(sessions=_by_age(one.sessions for one in found)),
    ),
    "ListScenes": (
        SceneApi.list_own,
        CALL_S,
        lambda found: schema.Scenes(scenes=_by_age(one.scenes for one in found)),
    ),
    "LoadModel": (AdminApi.load_model, MODEL_S, lambda found: found[0]),
    "UseModel": (
        AdminApi.use_model,
        MODEL_S,
        lambda found: schema.ModelUsed(moved=sum(one.moved for one in found)),
    ),
    "UnloadModel": (AdminApi.unload_model, MODEL_S, lambda found: None),
}


def calls_to_all(
    link: NodeLink, nodes: Callable[[], Awaitable[list[NodeInfo]]], stop: Callable[[], None]
) -> Calls:
    """The calls. Each raises what a node raises, and Unavailable when one does not answer.

    `stop` is what `Drain` does: it ends all that this command has started, as Ctrl-C does.
    """

    def asking(rpc: str) -> Callable[..., Awaitable[Any]]:
        method, seconds, joined = ASKED[rpc]

        async def ask(**told: Any) -> Any:
            present, caller = await nodes(), current_caller()
            if not present:
                raise Unavailable("no node runs; they are starting or stopping")
            asked = (link.call(one, "ask", rpc, caller, told, seconds=seconds) for one in present)
            return joined(await asyncio.gather(*asked))

        own = inspect.signature(method)
        arguments = [one for name, one in own.parameters.items() if name != "self"]
        ask.__signature__ = own.replace(parameters=arguments)  # type: ignore[attr-defined]
        return ask

    async def drain() -> None:
        current_caller().require(Scope.ADMIN)
        log.info("drain asked for", caller=current_caller().name)
        stop()

    return {rpc: asking(rpc) for rpc in ASKED} | {"Drain": drain}


def _by_age(lists: Iterable[Iterable[Any]]) -> tuple[Any, ...]:
    return tuple(sorted((one for found in lists for one in found), key=lambda o: o.created_at_us))
