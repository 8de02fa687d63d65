"""`GET /v1/events`: a session's events as server-sent events."""

from typing import Annotated

from fastapi import APIRouter, Header, Query, Response

from wayfarer.transport import errors, schema
from wayfarer.transport.conversion import wire
from wayfarer.transport.gateway import Gateway
from wayfarer.transport.http_server.streaming import ServerSentEvents, begun
from wayfarer.v1 import motion_pb2

Id = Annotated[str, Query(max_length=schema.ID_LENGTH)]


def event_routes(gateway: Gateway) -> APIRouter:
    """`/v1/events`."""
    router = APIRouter(prefix="/v1", tags=["motion"])

    @router.get(
        "/events",
        operation_id="streamEvents",
        summary="Follow the events of a session",
        response_class=ServerSentEvents,
        responses={200: {"description": "server-sent events; `data` is an Event in JSON"}},
    )
    async def stream_events(
        session: Annotated[Id, Query(description="the session to follow")],
        agent: Annotated[
            list[Id] | None, Query(max_length=1024, description="none: all, later ones too")
        ] = None,
        resume_token: Annotated[
            str, Query(max_length=128, description="the id of the last event received")
        ] = "",
        last_event_id: Annotated[
            str, Header(max_length=128, description="the same; browsers send it")
        ] = "",
    ) -> Response:
        """Goals reached, paths done, gaps, draining; no poses. A comment each second when there
        is nothing to tell. `event:` is the kind, `id:` the token that resumes after it.
        """
        request = schema.StreamRequest(
            session_id=session,
            agent_ids=tuple(agent or ()),
            resume_token=last_event_id or resume_token,
        )
        return ServerSentEvents(await begun(gateway.motion.events(request), _text, _problem_text))

    return router


def _text(item: tuple[str, motion_pb2.Event] | None) -> str:
    """One event; a comment for None."""
    if item is None:
        return ":\n\n"
    token, event = item
    message = schema.Event.model_validate(wire.values(event))
    name = f"id: {token}\n" if token else ""  # an empty id would make the reader forget its last
    return f"{name}event: {message.kind}\ndata: {message.model_dump_json()}\n\n"


def _problem_text(error: Exception) -> str:
    problem = schema.Problem.model_validate(errors.to_problem(error))
    return f"event: problem\ndata: {problem.model_dump_json()}\n\n"
