"""SnapshotService over the gateway."""

from collections.abc import AsyncGenerator
from contextlib import aclosing

from grpc.aio import ServicerContext as Context

from wayfarer.transport import schema, wire
from wayfarer.transport.gateway import Gateway
from wayfarer.v1 import session_pb2, snapshot_pb2, snapshot_pb2_grpc


class SnapshotService(snapshot_pb2_grpc.SnapshotServiceServicer):
    """See snapshot.proto."""

    def __init__(self, gateway: Gateway) -> None:
        self._snapshots = gateway.snapshots

    async def ExportSession(  # noqa: N802
        self, request: snapshot_pb2.ExportSessionRequest, context: Context
    ) -> snapshot_pb2.ExportSessionResponse:
        """The state of a session."""
        snapshot = await self._snapshots.export_session(request.session_id)
        return snapshot_pb2.ExportSessionResponse(snapshot=snapshot)

    async def ImportSession(  # noqa: N802
        self, request: snapshot_pb2.ImportSessionRequest, context: Context
    ) -> snapshot_pb2.ImportSessionResponse:
        """Go on with a session."""
        session = await self._snapshots.import_session(request.snapshot)
        return snapshot_pb2.ImportSessionResponse(
            session=wire.message(session_pb2.Session, session)
        )

    async def ExportLog(  # noqa: N802
        self, request: snapshot_pb2.ExportLogRequest, context: Context
    ) -> snapshot_pb2.ExportLogResponse:
        """The commands of a recorded session."""
        log = await self._snapshots.export_log(request.session_id)
        return snapshot_pb2.ExportLogResponse(log=log)

    async def Replay(  # noqa: N802
        self, request: snapshot_pb2.ReplayRequest, context: Context
    ) -> AsyncGenerator[snapshot_pb2.ReplayResponse]:
        """Make the motion of a log again."""
        wish = wire.parse(schema.PoseFormat, request.format, "format")
        async with aclosing(self._snapshots.replay(request.log, wish)) as messages:
            async for message in messages:
                yield message
