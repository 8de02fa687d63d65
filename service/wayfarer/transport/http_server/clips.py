"""Routes for motion made off the real-time path: clips, snapshots, logs, replays."""

from typing import Annotated, Any, Final

from fastapi import APIRouter, Depends, Request, Response

from wayfarer.transport import schema
from wayfarer.transport.gateway import Gateway
from wayfarer.transport.http_server.parameters import (
    PROTOBUF,
    SessionId,
    binary_answer,
    binary_body,
    pose_format,
)
from wayfarer.transport.http_server.streaming import Lines, clip_lines

LINES: Final[dict[int | str, dict[str, Any]]] = {
    200: {
        "model": schema.ClipLine,
        "description": "one JSON document a line: a header, then batches in order of time; "
        "a problem at the end if it broke off",
    }
}


def clip_routes(gateway: Gateway) -> APIRouter:
    """`/v1/clips`."""
    router = APIRouter(prefix="/v1", tags=["clips"])

    @router.post(
        "/clips",
        operation_id="generateClip",
        summary="Make a clip of one agent",
        response_class=Lines,
        responses=LINES,
    )
    async def generate_clip(request: schema.ClipRequest) -> Response:
        """It is made as fast as the server has time for beside its streams."""
        return await clip_lines(gateway.motion.generate_clip(request))

    return router


def snapshot_routes(gateway: Gateway) -> APIRouter:
    """Snapshots, logs, replays."""
    router = APIRouter(prefix="/v1", tags=["snapshots"])
    snapshots = gateway.snapshots

    @router.get(
        "/sessions/{session_id}/snapshot",
        operation_id="exportSession",
        summary="The state of a session, for another server",
        response_class=Response,
        responses=binary_answer("opaque; for importSession"),
    )
    async def export_session(session_id: SessionId) -> Response:
        """As of the last frames sent. The session goes on living here."""
        return Response(await snapshots.export_session(session_id), media_type=PROTOBUF)

    @router.post(
        "/snapshots",
        status_code=201,
        operation_id="importSession",
        summary="Go on with a session where a snapshot left it",
        openapi_extra=binary_body("as given by exportSession"),
    )
    async def import_session(request: Request) -> schema.Session:
        """It keeps its ids, and the next chunk of each agent follows its last one."""
        return await snapshots.import_session(await request.body())

    @router.get(
        "/sessions/{session_id}/log",
        operation_id="exportLog",
        summary="The commands of a recorded session",
        response_class=Response,
        responses=binary_answer("opaque; for replay"),
    )
    async def export_log(session_id: SessionId) -> Response:
        """409 for a session that was not made with record."""
        return Response(await snapshots.export_log(session_id), media_type=PROTOBUF)

    @router.post(
        "/replays",
        operation_id="replay",
        summary="Make the motion of a log again",
        response_class=Lines,
        responses=LINES,
        openapi_extra=binary_body("as given by exportLog"),
    )
    async def replay(
        request: Request, chosen: Annotated[schema.PoseFormat, Depends(pose_format)]
    ) -> Response:
        """On the same model and engine the poses are the same, bit for bit."""
        return await clip_lines(snapshots.replay(await request.body(), chosen))

    return router
