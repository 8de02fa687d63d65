"""Sessions, and the scenes that they are in, move between servers without a visible interruption.

On the old server, `freeze` stops planning and sends planned motion at once, and `export` packs the
rest. Then `release` ends the session and its streams, or `unfreeze` resumes it there after all. On
the new server, `import_` puts it into the world, frozen, and `unfreeze` resumes it. Scenes have the
same calls; their content never changes and is sent ahead.
"""

import asyncio
from contextlib import suppress
from dataclasses import replace
from typing import Final

from wayfarer.errors import FailedPrecondition, InvalidArgument, WayfarerError
from wayfarer.runtime.homes import Homes
from wayfarer.runtime.move_locks import MoveLocks
from wayfarer.runtime.persistence.log_format import decode_log
from wayfarer.runtime.persistence.persistence import Persistence
from wayfarer.runtime.persistence.record import CommandLog
from wayfarer.runtime.persistence.scene_entries import (
    content_bytes,
    decode_scene,
    obstacles_bytes,
)
from wayfarer.runtime.persistence.session_record import (
    SessionCopy,
    decode_record,
    encode_record,
)
from wayfarer.runtime.scenes import SceneService
from wayfarer.runtime.session_exports import SessionExports
from wayfarer.runtime.world_factory import WorldFactory
from wayfarer.world.agents.agent import SessionInfo
from wayfarer.world.scenes.messages import SceneInfo
from wayfarer.world.world import World

CALL_S: Final = 0.1
"""Seconds that a move waits for engine calls in progress; their result is then lost, and made again
on the new server.
"""

POLL_S: Final = 0.002


class LiveMoves:
    """The moves of all sessions, one at a time each; in lock-step they move between steps."""

    def __init__(
        self,
        worlds: WorldFactory,
        exports: SessionExports,
        homes: Homes,
        persistence: Persistence,
        move_locks: MoveLocks,
    ) -> None:
        self._worlds = worlds
        self._exports = exports
        self._homes = homes
        self._persistence = persistence
        self._move_locks = move_locks

    async def freeze(self, session_id: str) -> None:
        """Makes calls that change the session wait, stops planning, and sends the planned motion.

        Raises NotFound, and Unavailable if calls on it do not end.
        """
        await self._move_locks.close(session_id)
        home = self._homes.of(session_id)
        try:
            ends = asyncio.get_running_loop().time() + CALL_S
            while not await home.ask(lambda world, _: _freeze(world, session_id)):
                if asyncio.get_running_loop().time() > ends:
                    break
                await asyncio.sleep(POLL_S)
            await home.send_rest(session_id)
        except BaseException:
            await self._thaw(session_id)
            raise

    async def export(self, session_id: str) -> bytes:
        """Packs a frozen session. Raises NotFound."""
        home = self._homes.of(session_id)
        taken = await home.taken(session_id)
        recording = b""
        if taken.part.spec.record:
            with suppress(FailedPrecondition):  # the log has been dropped
                recording = await self._exports.export_log(home, session_id)
        return await asyncio.to_thread(encode_record, taken, self._worlds.body, recording)

    async def unfreeze(self, session_id: str) -> None:
        """Resumes it on this server. Raises NotFound."""
        await self._homes.of(session_id).ask(lambda world, _: _thaw(world, session_id))
        self._move_locks.open(session_id)

    async def release(self, session_id: str, error: WayfarerError) -> None:
        """Ends it on this server, since it lives on another one. Its streams end with `error` once
        they have sent everything, and so do waiting calls.
        """
        await self._homes.delete_session(session_id, error)
        self._move_locks.open(session_id, error)
        await self._persistence.durable(None)

    async def read(self, data: bytes) -> SessionCopy:
        """Reads a packed session. Raises InvalidArgument, FailedPrecondition."""
        limits = self._worlds.settings.limits
        return await asyncio.to_thread(decode_record, data, self._worlds.body, limits)

    async def import_(self, session: SessionCopy, orphan: bool = False) -> SessionInfo:
        """Puts it into the world, frozen; calls that change it wait until `unfreeze`.

        An `orphan` is the copy of a session whose server has ended. It is accepted even beyond
        `limits.sessions` and without time for its agents, since no other server steps them: all
        agents are then late and degraded. The log of a recorded session begins here.

        Raises InvalidArgument, FailedPrecondition, AlreadyExists, ResourceExhausted, Unavailable.
        """
        spec, session_id = session.record.spec, session.record.session_id
        if session.log is None and not orphan:
            raise InvalidArgument(f"session {session_id!r} is not on its way", "log")
        if orphan:  # in real time, the times of a move that came to nothing are over
            session = replace(session, rows=None, log=session.log if spec.lock_step else None)
        kept = await self._log(session.recording) if session.recording else None

        await self._move_locks.close(session_id)
        try:
            record, log = session.record, session.log
            with self._homes.opening(spec, record, log, admit=not orphan) as home:
                made = await home.put_live(session, admit=not orphan)
                if spec.record and not orphan:
                    await home.ask(lambda *_: self._worlds.recordings.go_on(kept, session_id))
        except BaseException:
            self._move_locks.open(session_id)
            raise
        return await self._persistence.durable(made)

    async def replica(self, session_id: str) -> bytes:
        """Packs its present state, from which another server resumes it after this one has ended.
        Not in it: its recording and, in real time, the progress of its streams. Raises NotFound.
        """
        home = self._homes.of(session_id)
        if not self._homes.is_stepped(session_id):
            return await self._exports.replica(home, session_id)
        taken = await home.taken(session_id)
        return await asyncio.to_thread(encode_record, taken, self._worlds.body)

    async def _log(self, recording: bytes) -> CommandLog:
        limits = self._worlds.settings.limits
        origin, most = self._exports.origin, limits.log_entries
        return await asyncio.to_thread(decode_log, recording, origin, limits, most)

    async def _thaw(self, session_id: str) -> None:
        try:
            await self.unfreeze(session_id)
        except WayfarerError:
            self._move_locks.open(session_id)


class SceneMoves:
    """The moves of all scenes."""

    def __init__(
        self, scenes: SceneService, persistence: Persistence, move_locks: MoveLocks
    ) -> None:
        self._scenes = scenes
        self._persistence = persistence
        self._move_locks = move_locks

    async def content(self, scene_id: str) -> bytes:
        """The parts of it that never change, baked, for `import_`. Raises NotFound."""
        return await self._scenes.work(content_bytes, self._scenes.registry.entry(scene_id))

    async def freeze(self, scene_id: str) -> None:
        """Makes calls wait that change it or make sessions in it, until `unfreeze` or `release`.

        Raises Unavailable if calls in progress do not end.
        """
        await self._move_locks.close(scene_id)

    async def export(self, scene_id: str) -> bytes:
        """The parts of it that change, for `import_`. Raises NotFound."""
        return obstacles_bytes(self._scenes.registry.entry(scene_id))

    replica = export

    async def unfreeze(self, scene_id: str) -> None:
        """Resumes it on this server."""
        self._move_locks.open(scene_id)

    async def import_(self, scene_id: str, content: bytes, obstacles: bytes) -> SceneInfo:
        """Puts a scene from another server into the registry. Nothing is baked again.

        Raises InvalidArgument, AlreadyExists, ResourceExhausted.
        """
        record = await self._scenes.work(decode_scene, scene_id, content, obstacles)
        made = await self._scenes.work(self._scenes.registry.restore, record, reported=False)
        return await self._persistence.durable(made)

    async def release(self, scene_id: str, error: WayfarerError) -> None:
        """Ends it on this server, since it and its sessions live on another; waiting calls end with
        `error`.

        Raises NotFound, FailedPrecondition if sessions are in it.
        """
        try:
            self._scenes.registry.delete(scene_id)
        finally:
            self._move_locks.open(scene_id, error)
        await self._persistence.durable(None)


def _freeze(world: World, session_id: str) -> bool:
    return world.members.freeze(world.registry.session(session_id), True)


def _thaw(world: World, session_id: str) -> None:
    world.members.freeze(world.registry.session(session_id), False)
