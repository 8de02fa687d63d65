"""Sessions go to another server and come from one, and nobody who watches notices.

Here: `freeze` stops planning and sends at once what is planned; `export` packs what is left;
`release` ends the session and its streams, `unfreeze` lets it go on here after all. There:
`import_` puts it into the world, frozen, and `unfreeze` lets it begin.
"""

import asyncio
import contextlib
from collections.abc import Callable, Sequence
from typing import Final

import structlog

from wayfarer.errors import FailedPrecondition, InvalidArgument, NotFound, WayfarerError
from wayfarer.service.archive import Archive
from wayfarer.service.gates import SessionGates
from wayfarer.service.live import LiveMotion
from wayfarer.service.lockstep import LockSteps
from wayfarer.service.persistence.log_copy import Replica
from wayfarer.service.persistence.log_format import decode_log
from wayfarer.service.persistence.persistence import Persistence
from wayfarer.service.persistence.record import CommandLog, LogMark
from wayfarer.service.persistence.session_record import (
    SessionCopy,
    decode_record,
    encode_record,
)
from wayfarer.service.worlds import Worlds
from wayfarer.world.agents.agent import SessionInfo
from wayfarer.world.world import World

log = structlog.get_logger(__name__)

CALL_S: Final = 0.1
"""Seconds that a move waits for engine calls under way; what they make is lost then, and made again
where the session goes.
"""

LOOK_S: Final = 0.002


class LiveMoves:
    """Of all sessions; one in lock-step goes between two steps. One move of a session at a time."""

    def __init__(
        self,
        worlds: Worlds,
        archive: Archive,
        live: LiveMotion,
        lock_steps: LockSteps,
        persistence: Persistence,
        gates: SessionGates,
    ) -> None:
        self._worlds = worlds
        self._archive = archive
        self._live = live
        self._lock_steps = lock_steps
        self._persistence = persistence
        self._gates = gates

    def is_lock_step(self, session_id: str) -> bool:
        """Whether it is in lock-step here."""
        return self._lock_steps.session(session_id) is not None

    async def freeze(self, session_id: str) -> None:
        """Let calls that change the session wait, plan nothing more, and send what is planned.

        Raises NotFound, and Unavailable when calls on it do not end.
        """
        await self._gates.close(session_id)
        if self._lock_steps.session(session_id) is not None:
            return
        try:
            ends = asyncio.get_running_loop().time() + CALL_S
            while not await self._live.ask(lambda world, _: _freeze(world, session_id)):
                if asyncio.get_running_loop().time() > ends:
                    break
                await asyncio.sleep(LOOK_S)
            await self._live.send_rest(session_id)
        except BaseException:
            await self._thaw(session_id)
            raise

    async def export(self, session_id: str) -> bytes:
        """A frozen session, packed. Raises NotFound."""
        home = self._lock_steps.session(session_id) or self._live
        taken = await home.taken(session_id)
        recording = b""
        if taken.part.spec.record:
            with contextlib.suppress(FailedPrecondition):  # it has been dropped
                recording = await self._archive.export_log(home, session_id)
        return await asyncio.to_thread(encode_record, taken, self._worlds.body, recording)

    async def unfreeze(self, session_id: str) -> None:
        """Let it go on here. Raises NotFound."""
        if self._lock_steps.session(session_id) is None:
            await self._live.ask(lambda world, _: _thaw(world, session_id))
        self._gates.open(session_id)

    async def release(self, session_id: str, error: WayfarerError) -> None:
        """It lives elsewhere: its streams end with `error`, once they have sent everything, and so
        do the calls that wait.
        """
        if self._lock_steps.session(session_id) is not None:
            await self._lock_steps.delete_session(session_id)
        else:
            await self._live.leave(session_id, error)
        self._gates.open(session_id, error)
        await self._persistence.durable(None)

    async def read(self, data: bytes) -> SessionCopy:
        """A session that another server has packed. Raises InvalidArgument, FailedPrecondition."""
        limits = self._worlds.settings.limits
        return await asyncio.to_thread(decode_record, data, self._worlds.body, limits)

    async def import_(self, session: SessionCopy) -> SessionInfo:
        """Put it into the world, frozen; calls that change it wait until `unfreeze`.

        Raises InvalidArgument, FailedPrecondition, AlreadyExists, ResourceExhausted, Unavailable.
        """
        spec, session_id = session.record.spec, session.record.session_id
        kept = await self._log(session.recording) if session.recording else None

        def entered() -> None:
            if spec.record:
                # who steps in lock-step begins as it stood; LiveRows are for real time
                self._worlds.recordings.go_on(kept, session_id, restarted=spec.lock_step)

        return await self._put(session, entered)

    # Of sessions in lock-step, and of logs: copies for when this server dies

    async def replica(self, session_id: str, mark: LogMark | None) -> Replica:
        """See `MotionService`, for a session in lock-step. Raises NotFound."""
        home = self._lock_steps.session(session_id)
        if home is None:
            raise NotFound(f"no session {session_id!r} is in lock-step")
        taken, news = await home.ask(
            lambda *_: (home.taken_now(session_id), self._archive.news(session_id, mark))
        )
        state = await asyncio.to_thread(encode_record, taken, self._worlds.body)
        return await self._archive.with_log(state, news)

    async def adopt(self, copy: SessionCopy, log_parts: Sequence[bytes]) -> SessionInfo:
        """See `MotionService`, for a session in lock-step. Raises as `import_`."""
        made = await self._put(copy, lambda: None, admit=False)
        try:
            if log_parts:
                await self.go_on_with_log(made.session_id, log_parts)
        finally:
            self._gates.open(made.session_id)
        return made

    async def go_on_with_log(self, session_id: str, parts: Sequence[bytes]) -> None:
        """Let an adopted session go on with its log; if that is damaged, with one that begins here.

        Raises NotFound.
        """
        try:
            kept = await self._archive.joined_log(parts)
        except (InvalidArgument, FailedPrecondition) as error:
            log.error("a log begins again", session_id=session_id, reason=str(error))
            return
        go_on, home = self._worlds.recordings.go_on, self._lock_steps.session(session_id)
        await (home or self._live).ask(lambda *_: go_on(kept, session_id, restarted=True))

    async def _put(
        self, session: SessionCopy, entered: Callable[[], None], admit: bool = True
    ) -> SessionInfo:
        session_id = session.record.session_id
        if session.log is None:
            raise InvalidArgument(f"session {session_id!r} is not on its way", "log")
        await self._gates.close(session_id)
        try:
            if session.record.spec.lock_step:
                put = self._lock_steps.put
                made = await asyncio.to_thread(put, session.record, session.log, entered, admit)
            else:
                made = await self._live.put_live(session)
                await self._live.ask(lambda *_: entered())
        except BaseException:
            self._gates.open(session_id)
            raise
        return await self._persistence.durable(made)

    async def _log(self, recording: bytes) -> CommandLog:
        limits = self._worlds.settings.limits
        origin, most = self._archive.origin, limits.log_entries
        return await asyncio.to_thread(decode_log, recording, origin, limits, most)

    async def _thaw(self, session_id: str) -> None:
        try:
            await self.unfreeze(session_id)
        except WayfarerError:
            self._gates.open(session_id)


def _freeze(world: World, session_id: str) -> bool:
    return world.members.freeze(world.registry.session(session_id), True)


def _thaw(world: World, session_id: str) -> None:
    world.members.freeze(world.registry.session(session_id), False)
