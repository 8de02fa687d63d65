"""Routes for motion made off the real-time path: clips, snapshots, logs, replays."""

import re
from typing import Annotated, Any, Final

from fastapi import APIRouter, Depends, Request, Response

from wayfarer.clips.files import MEDIA_TYPES, FileFormat
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


FILES: Final[dict[int | str, dict[str, Any]]] = {
    200: {
        "content": {
            kind: {"schema": {"type": "string", "format": "binary"}}
            for kind in dict.fromkeys(MEDIA_TYPES.values())
        }
    }
}


def file_answer(data: bytes, kind: FileFormat, name: str) -> Response:
    """A file to be saved under this name."""
    plain = re.sub(r"[^A-Za-z0-9_-]", "_", name)
    headers = {"content-disposition": f'attachment; filename="{plain}.{kind}"'}
    return Response(data, media_type=MEDIA_TYPES[kind], headers=headers)


def clip_routes(gateway: Gateway) -> APIRouter:
    """`/v1/clips`."""
    router = APIRouter(prefix="/v1", tags=["clips"])

    @router.post(
        "/clips",
        operation_id="generateClip",
        summary="Make a clip of one agent",
        response_class=Lines,
        responses={200: {**LINES[200], **FILES[200]}},
    )
    async def generate_clip(request: schema.ClipRequest) -> Response:
        """It is made as fast as the server has time for beside its streams: as JSON lines, or as
        the file that `file` describes.
        """
        made = gateway.motion.generate_clip(request)
        if request.file is None:
            return await clip_lines(made)
        data = b"".join([message.file_part async for message in made])
        return file_answer(data, request.file.format, request.agent.name or "motion")

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
        "/sessions/{session_id}/motion",
        operation_id="exportMotion",
        summary="The motion of a session as a file",
        response_class=Response,
        responses=FILES,
    )
    async def export_motion(session_id: SessionId, request: schema.MotionExport) -> Response:
        """Of all its agents, with its scene: of the next seconds, or what it has recorded; without
        seconds 409 for a session that was not made with record.
        """
        data = await snapshots.export_motion(session_id, request)
        return file_answer(data, request.file.format, session_id)

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
