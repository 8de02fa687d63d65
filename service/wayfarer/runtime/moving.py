"""Sessions move between servers without a visible interruption.

On the old server, `freeze` stops planning and sends planned motion at once, and `export` packs the
rest. Then `release` ends the session and its streams, or `unfreeze` resumes it there after all. On
the new server, `import_` puts it into the world, frozen, and `unfreeze` resumes it.
"""

import asyncio
import contextlib
from collections.abc import Callable
from typing import Final

import structlog

from wayfarer.errors import FailedPrecondition, InvalidArgument, NotFound, WayfarerError
from wayfarer.runtime.archive import Archive
from wayfarer.runtime.gates import SessionGates
from wayfarer.runtime.live import LiveMotion
from wayfarer.runtime.lockstep import LockSteps
from wayfarer.runtime.persistence.log_format import decode_log
from wayfarer.runtime.persistence.persistence import Persistence
from wayfarer.runtime.persistence.record import CommandLog
from wayfarer.runtime.persistence.session_record import (
    SessionCopy,
    decode_record,
    encode_record,
)
from wayfarer.runtime.worlds import Worlds
from wayfarer.world.agents.agent import SessionInfo
from wayfarer.world.world import World

log = structlog.get_logger(__name__)

CALL_S: Final = 0.1
"""Seconds that a move waits for engine calls in progress; their result is then lost, and made again
on the new server.
"""

LOOK_S: Final = 0.002


class LiveMoves:
    """The moves of all sessions, one at a time each; in lock-step they move between steps."""

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
        """Whether it is in lock-step on this server."""
        return self._lock_steps.session(session_id) is not None

    async def freeze(self, session_id: str) -> None:
        """Makes calls that change the session wait, stops planning, and sends the planned motion.

        Raises NotFound, and Unavailable if calls on it do not end.
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
        """Packs a frozen session. Raises NotFound."""
        home = self._lock_steps.session(session_id) or self._live
        taken = await home.taken(session_id)
        recording = b""
        if taken.part.spec.record:
            with contextlib.suppress(FailedPrecondition):  # the log has been dropped
                recording = await self._archive.export_log(home, session_id)
        return await asyncio.to_thread(encode_record, taken, self._worlds.body, recording)

    async def unfreeze(self, session_id: str) -> None:
        """Resumes it on this server. Raises NotFound."""
        if self._lock_steps.session(session_id) is None:
            await self._live.ask(lambda world, _: _thaw(world, session_id))
        self._gates.open(session_id)

    async def release(self, session_id: str, error: WayfarerError) -> None:
        """Ends it on this server, since it lives on another one. Its streams end with `error` once
        they have sent everything, and so do waiting calls.
        """
        if self._lock_steps.session(session_id) is not None:
            await self._lock_steps.delete_session(session_id)
        else:
            await self._live.leave(session_id, error)
        self._gates.open(session_id, error)
        await self._persistence.durable(None)

    async def read(self, data: bytes) -> SessionCopy:
        """Reads a packed session. Raises InvalidArgument, FailedPrecondition."""
        limits = self._worlds.settings.limits
        return await asyncio.to_thread(decode_record, data, self._worlds.body, limits)

    async def import_(self, session: SessionCopy) -> SessionInfo:
        """Puts it into the world, frozen; calls that change it wait until `unfreeze`.

        Raises InvalidArgument, FailedPrecondition, AlreadyExists, ResourceExhausted, Unavailable.
        """
        spec, session_id = session.record.spec, session.record.session_id
        kept = await self._log(session.recording) if session.recording else None

        def entered() -> None:
            if spec.record:
                # a lock-step session resumes in its last state; LiveRows are for real time
                self._worlds.recordings.go_on(kept, session_id, restarted=spec.lock_step)

        return await self._put(session, entered)

    # Replicas of sessions in lock-step: for the time when this server has died

    async def replica(self, session_id: str) -> bytes:
        """Implements `MotionService` for a session in lock-step. Raises NotFound."""
        home = self._lock_steps.session(session_id)
        if home is None:
            raise NotFound(f"no session {session_id!r} is in lock-step")
        taken = await home.taken(session_id)
        return await asyncio.to_thread(encode_record, taken, self._worlds.body)

    async def adopt(self, copy: SessionCopy) -> SessionInfo:
        """Implements `MotionService` for a session in lock-step. Raises as `import_`."""
        made = await self._put(copy, lambda: None, admit=False)
        self._gates.open(made.session_id)
        return made

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
