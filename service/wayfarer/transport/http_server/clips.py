"""Endpoints for motion made off the real-time path: steps, clips, snapshots, logs, replays."""

import re
from typing import Annotated, Any, Final

from fastapi import Depends, Request, Response

from wayfarer.clips.files import MEDIA_TYPES, FileFormat
from wayfarer.transport import schema
from wayfarer.transport.conversion import wire
from wayfarer.transport.gateway import Gateway
from wayfarer.transport.http_server.calls import Special
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


def clip_endpoints(gateway: Gateway) -> Special:
    """Endpoints of lock-step, clips, snapshots, logs and replays; they carry files or lines."""
    motion, snapshots = gateway.motion, gateway.snapshots

    async def step_agents(
        session_id: SessionId, request: schema.StepRequest | None = None
    ) -> schema.Steps:
        reply = await motion.step(session_id, request or schema.StepRequest())
        return schema.Steps.model_validate(wire.values(reply))

    async def generate_clip(request: schema.ClipRequest) -> Response:
        made = motion.generate_clip(request)
        if request.file is None:
            return await clip_lines(made)
        data = b"".join([message.file_part async for message in made])
        return file_answer(data, request.file.format, request.agent.name or "motion")

    async def export_session(session_id: SessionId) -> Response:
        return Response(await snapshots.export_session(session_id), media_type=PROTOBUF)

    async def import_session(request: Request) -> schema.Session:
        return await snapshots.import_session(await request.body())

    async def export_log(session_id: SessionId) -> Response:
        return Response(await snapshots.export_log(session_id), media_type=PROTOBUF)

    async def export_motion(session_id: SessionId, request: schema.MotionExport) -> Response:
        data = await snapshots.export_motion(session_id, request)
        return file_answer(data, request.file.format, session_id)

    async def replay(
        request: Request, chosen: Annotated[schema.PoseFormat, Depends(pose_format)]
    ) -> Response:
        return await clip_lines(snapshots.replay(await request.body(), chosen))

    lines_or_file = {200: {**LINES[200], **FILES[200]}}
    snapshot, log = (binary_answer(f"opaque; for {use}") for use in ("importSession", "replay"))
    return {
        "StepAgents": (step_agents, {}),
        "GenerateClip": (generate_clip, {"response_class": Lines, "responses": lines_or_file}),
        "ExportSession": (export_session, {"response_class": Response, "responses": snapshot}),
        "ImportSession": (
            import_session,
            {"openapi_extra": binary_body("as given by exportSession")},
        ),
        "ExportLog": (export_log, {"response_class": Response, "responses": log}),
        "ExportMotion": (export_motion, {"response_class": Response, "responses": FILES}),
        "Replay": (
            replay,
            {
                "response_class": Lines,
                "responses": LINES,
                "openapi_extra": binary_body("as given by exportLog"),
            },
        ),
    }
