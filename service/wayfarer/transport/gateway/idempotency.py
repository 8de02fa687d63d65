"""Idempotency: a request that is sent again under the same id gets the same reply."""

import asyncio
from collections import OrderedDict
from collections.abc import Callable, Coroutine
from dataclasses import dataclass
from hashlib import sha256
from typing import Any, Final, TypeVar

from pydantic import BaseModel

from wayfarer.errors import Aborted
from wayfarer.transport.edge.caller import current_caller

KEPT_S: Final = 600.0
KEPT: Final = 128
"""Maximum number of replies kept for one caller; the oldest are forgotten first."""

CALLERS: Final = 1024
"""Maximum number of callers whose replies are kept; the longest silent are forgotten first."""

Reply = TypeVar("Reply")

_running: Final[set[asyncio.Task[Any]]] = set()  # asyncio itself holds tasks only weakly


async def finish(work: Coroutine[Any, Any, Reply]) -> Reply:
    """The outcome of `work`, which runs to its end even if the caller disconnects.

    So the runtime never holds a session that the transport does not know.
    """
    task = asyncio.get_running_loop().create_task(work)
    _running.add(task)
    task.add_done_callback(_running.discard)
    return await asyncio.shield(task)


@dataclass(frozen=True, slots=True)
class _Kept:
    request: str  # SHA-256 of the request
    outcome: asyncio.Task[Any]
    until: float


class IdempotencyCache:
    """The replies of the last ten minutes, by caller and request id."""

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._callers: OrderedDict[str, OrderedDict[str, _Kept]] = OrderedDict()

    async def once(
        self,
        request_id: str,
        request: tuple[str, BaseModel],
        act: Callable[[str], Coroutine[Any, Any, Reply]],
    ) -> Reply:
        """The outcome of `act`, or that of the same request under the same id before. `act` gets a
        digest of the caller and the request, or an empty text for a request without an id.

        `request` is the address and the content of the request. A duplicate of a request in
        progress waits for it; a request that failed may be tried again. A caller that disconnects
        does not cancel its request. Raises Aborted if the id belonged to another request.
        """
        if not request_id:
            return await finish(act(""))
        kept = self._of_caller()
        where, what = request
        text = f"{current_caller().name}\n{where}\n{what.model_dump_json()}"
        digest = sha256(text.encode()).hexdigest()
        known = kept.get(request_id)
        if known is None:
            outcome = asyncio.get_running_loop().create_task(act(digest))
            known = kept[request_id] = _Kept(digest, outcome, self._clock() + KEPT_S)
            outcome.add_done_callback(lambda done: _forget_failed(kept, request_id, done))
            while len(kept) > KEPT:
                kept.popitem(last=False)
        elif known.request != digest:
            raise Aborted(
                f"request id {request_id!r} was used for another request; make up a new one"
            )
        result: Reply = await asyncio.shield(known.outcome)
        return result

    def _of_caller(self) -> OrderedDict[str, _Kept]:
        """Recent replies to the present caller."""
        name, now = current_caller().name, self._clock()
        kept = self._callers.setdefault(name, OrderedDict())
        self._callers.move_to_end(name)
        if len(self._callers) > CALLERS:
            self._callers.popitem(last=False)
        while kept and (first := next(iter(kept))) and kept[first].until < now:
            del kept[first]
        return kept


def _forget_failed(
    kept: OrderedDict[str, _Kept], request_id: str, outcome: asyncio.Task[Any]
) -> None:
    if outcome.cancelled() or outcome.exception() is not None:
        known = kept.get(request_id)
        if known is not None and known.outcome is outcome:
            del kept[request_id]
