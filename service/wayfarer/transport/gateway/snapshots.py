"""Sessions moved from server to server, and recorded ones replayed."""

import contextlib
from collections.abc import AsyncGenerator
from contextlib import aclosing
from typing import Final

from wayfarer.errors import InvalidArgument, NotFound
from wayfarer.navigation.scene import Scene
from wayfarer.transport import schema
from wayfarer.transport.conversion import convert
from wayfarer.transport.conversion.basis import Basis
from wayfarer.transport.conversion.motion_files import live_motion, motion_file
from wayfarer.transport.edge.caller import current_caller
from wayfarer.transport.gateway.context import GatewayContext, implements
from wayfarer.transport.gateway.idempotency import finish
from wayfarer.v1 import snapshot_pb2

MARK: Final = b"wayfarer-log "
"""A log begins with this and the basis of its session; the runtime's log follows the line."""


class SnapshotApi:
    """SnapshotService."""

    def __init__(self, context: GatewayContext) -> None:
        self._context = context

    @implements("ExportSession")
    async def export_session(self, session_id: str) -> bytes:
        """The state of a session. Raises NotFound."""
        self._context.sessions.session(session_id)
        return await self._context.service.export_session(session_id)

    @implements("ImportSession")
    async def import_session(self, snapshot: bytes) -> schema.Session:
        """Resumes a session, which then belongs to the caller.

        Raises InvalidArgument, FailedPrecondition, AlreadyExists, ResourceExhausted.
        """
        self._context.require_ready()
        return await finish(self._import(snapshot))

    async def _import(self, snapshot: bytes) -> schema.Session:
        caller, service = current_caller(), self._context.service
        with self._context.sessions.session_room(caller):
            info = await service.import_session(snapshot, {"owner": caller.name})
            try:
                self._context.locator.require_own(info.session_id)
                if info.spec.scene:
                    self._context.scenes.scene(info.spec.scene)
                with self._context.sessions.agent_room(caller, len(info.agent_ids)):
                    agents = await service.list_agents(info.session_id)
                    made = self._context.sessions.open(info, agents).describe(info)
            except BaseException:
                with contextlib.suppress(NotFound):
                    await service.delete_session(info.session_id)
                raise
        await self._context.locator.claimed(made.session_id)
        return made

    @implements("ExportLog")
    async def export_log(self, session_id: str) -> bytes:
        """The commands of a recorded session. Raises NotFound, FailedPrecondition."""
        session = self._context.sessions.session(session_id)
        log = await self._context.service.export_log(session_id)
        return MARK + session.basis.value.encode() + b"\n" + log

    @implements("ExportMotion")
    async def export_motion(self, session_id: str, request: schema.MotionExport) -> bytes:
        """A session's motion as a file, with its scene: the next seconds, or what was recorded.

        Raises NotFound, FailedPrecondition, InvalidArgument, ResourceExhausted.
        """
        context, service, limits = self._context, self._context.service, self._context.limits
        context.require_ready()
        options = convert.file_options(request.file)
        session = context.sessions.session(session_id)
        if request.seconds > limits.clip_s:
            raise InvalidArgument(
                f"a file has {limits.clip_s:g} s at most, not {request.seconds:g}", "seconds"
            )
        scene = None
        if session.scene:
            scene = await service.scenes.look(Scene.triangles, session.scene)
        body = context.bodies.name
        if not request.seconds:
            made = service.replay(await service.export_log(session_id))
            return await motion_file(made, options, body, "session", scene)
        with context.sessions.place(current_caller(), session):
            made = live_motion(service, session_id, request.seconds)
            return await motion_file(made, options, body, "session", scene)

    @implements("Replay")
    async def replay(
        self, log: bytes, pose_format: schema.PoseFormat
    ) -> AsyncGenerator[snapshot_pb2.ReplayResponse]:
        """Yields the motion of a log again. Close it with `aclose`.

        Raises InvalidArgument, FailedPrecondition, ResourceExhausted.
        """
        self._context.require_ready()
        basis, recorded = _opened(log)
        writer = self._context.writer(basis, convert.pose_format(pose_format))
        made = self._context.service.replay(recorded)
        async with aclosing(writer.offline(made)) as parts:
            async for header, batch in parts:
                yield snapshot_pb2.ReplayResponse(header=header, batch=batch)


def _opened(log: bytes) -> tuple[Basis, bytes]:
    """Basis of the session, and the runtime's log. Raises InvalidArgument."""
    line, _, recorded = log.partition(b"\n")
    try:
        if line.startswith(MARK):
            return Basis(line.removeprefix(MARK).decode()), recorded
    except ValueError:
        pass
    raise InvalidArgument("not a log as ExportLog gives it", "log")
