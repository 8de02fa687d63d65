"""HTTP: the API as JSON, body meshes, the WebSocket stream, and the viewer."""

import hashlib
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any, Final

import numpy as np
from fastapi import APIRouter, FastAPI, Query, Request, Response
from fastapi import Path as InPath
from fastapi.concurrency import run_in_threadpool

from wayfarer import __version__
from wayfarer.body.glb import body_glb
from wayfarer.body.library import Detail
from wayfarer.errors import InvalidArgument, NotFound
from wayfarer.spec import BETAS
from wayfarer.transport import schema
from wayfarer.transport.bodies import BodyLibrary
from wayfarer.transport.gateway import ID_LENGTH, Gateway
from wayfarer.transport.http_edge import (
    PROBLEMS,
    Edge,
    RevalidatedFiles,
    add_problem_handlers,
)
from wayfarer.transport.websocket import add_stream

VIEWER: Final = Path(__file__).parent / "viewer"
DESCRIPTION: Final = """
Motion of digital humans. Open a session, create agents, give them goals; their poses come over
`WS /v1/stream` (protobuf in binary frames, see docs/wire-format.md) or gRPC.

All lengths, places and headings are in the basis of the session. Errors are RFC 9457 problem
documents. There is no authentication yet: keep the server on loopback or behind a proxy.
"""

SessionId = Annotated[str, InPath(max_length=ID_LENGTH, description="as given at creation")]
AgentId = Annotated[str, InPath(max_length=ID_LENGTH, description="as given at creation")]


def http_app(gateway: Gateway, viewer: Path = VIEWER) -> FastAPI:
    """The ASGI application."""
    app = FastAPI(title="Wayfarer", version=__version__, description=DESCRIPTION)
    app.include_router(_sessions(gateway), responses=PROBLEMS)
    app.include_router(_agents(gateway), responses=PROBLEMS)
    app.include_router(_catalogue(gateway), responses=PROBLEMS)
    app.include_router(_health(gateway))
    add_stream(app, gateway)
    add_problem_handlers(app)
    app.add_middleware(Edge, body_bytes=gateway.limits.message_bytes)
    if viewer.is_dir():
        app.mount("/", RevalidatedFiles(directory=viewer, html=True), name="viewer")
    return app


def _sessions(gateway: Gateway) -> APIRouter:
    router = APIRouter(prefix="/v1/sessions", tags=["sessions"])

    @router.post("", status_code=201, summary="Open a session")
    async def create_session(wish: schema.NewSession | None = None) -> schema.Session:
        return await gateway.create_session(wish or schema.NewSession())

    @router.get("/{session_id}", summary="Describe a session")
    async def get_session(session_id: SessionId) -> schema.Session:
        return await gateway.get_session(session_id)

    @router.delete("/{session_id}", status_code=204, summary="End a session")
    async def delete_session(session_id: SessionId) -> None:
        """Its agents and streams end with it."""
        await gateway.delete_session(session_id)

    @router.post("/{session_id}/agents", status_code=201, summary="Create agents, all or none")
    async def create_agents(session_id: SessionId, wish: schema.NewAgents) -> schema.Agents:
        return schema.Agents(agents=await gateway.create_agents(session_id, wish.agents))

    @router.get("/{session_id}/agents", summary="Describe all agents of a session")
    async def list_agents(session_id: SessionId) -> schema.Agents:
        return schema.Agents(agents=await gateway.list_agents(session_id))

    return router


def _agents(gateway: Gateway) -> APIRouter:
    router = APIRouter(prefix="/v1/agents", tags=["agents"])

    @router.get("/{agent_id}", summary="Describe an agent")
    async def get_agent(agent_id: AgentId) -> schema.Agent:
        return await gateway.get_agent(agent_id)

    @router.delete("/{agent_id}", status_code=204, summary="Remove an agent")
    async def delete_agent(agent_id: AgentId) -> None:
        await gateway.delete_agent(agent_id)

    @router.put("/{agent_id}/goal", summary="Give an agent a goal in place of its present one")
    async def set_goal(agent_id: AgentId, goal: schema.Goal) -> schema.GoalRevision:
        return schema.GoalRevision(revision=await gateway.set_goal(agent_id, goal))

    @router.put("/{agent_id}/path", summary="Give an agent goals to visit in turn")
    async def set_path(agent_id: AgentId, path: schema.Path) -> schema.GoalRevision:
        """In place of its present goal or path. `DELETE …/goal` takes it away."""
        return schema.GoalRevision(revision=await gateway.set_path(agent_id, path.goals))

    @router.delete("/{agent_id}/goal", summary="Take the goal or path away: the agent stops")
    async def clear_goal(agent_id: AgentId) -> schema.GoalRevision:
        return schema.GoalRevision(revision=await gateway.clear_goal(agent_id))

    return router


def _catalogue(gateway: Gateway) -> APIRouter:
    router = APIRouter(prefix="/v1", tags=["catalogue"])

    @router.get("/skeleton", summary="Bones, their parents, their names in common engines")
    async def get_skeleton() -> schema.Skeleton:
        return gateway.skeleton

    @router.get("/bodies", summary="Bodies that agents can have")
    async def list_bodies() -> schema.Bodies:
        return schema.Bodies(bodies=gateway.list_bodies())

    @router.get(
        "/bodies/{body}-{gender}.glb",
        summary="A skinned body in T-pose, glTF binary",
        response_class=Response,
        responses={200: {"content": {"model/gltf-binary": {}}}, 304: {"description": "unchanged"}},
    )
    async def get_body(
        request: Request,
        body: Annotated[str, InPath(max_length=ID_LENGTH)],
        gender: Annotated[str, InPath(max_length=ID_LENGTH)],
        betas: Annotated[
            str, Query(max_length=400, description=f"{BETAS} numbers with commas; none: mean body")
        ] = "",
        detail: Annotated[Detail, Query(description="mesh resolution")] = "high",
        style: Annotated[int, Query(ge=0, lt=1 << 32, description="seed of its colours")] = 0,
    ) -> Response:
        """Always in the glTF basis; joint nodes carry the canonical bone names."""
        if body != gateway.bodies.name or gender not in list(schema.Gender):
            known = ", ".join(f"{gateway.bodies.name}-{known}" for known in schema.Gender)
            raise NotFound(f"there is no body {body}-{gender}; there are {known}")
        shape = _numbers(betas)
        made = await run_in_threadpool(_glb, gateway.bodies, gender, shape, detail, style)
        headers = {"etag": made[0], "cache-control": "public, max-age=3600"}
        if request.headers.get("if-none-match") == made[0]:
            return Response(status_code=304, headers=headers)
        return Response(made[1], media_type="model/gltf-binary", headers=headers)

    @router.get("/models", summary="Motion models that are loaded")
    async def list_models() -> schema.Models:
        return schema.Models(models=gateway.list_models())

    @router.get("/info", summary="Version, frame rate, limits, bases")
    async def get_info() -> schema.ServerInfo:
        return gateway.server_info()

    @router.get("/stats", summary="Health of the motion loop over the last few seconds")
    async def get_stats() -> schema.Stats:
        return await gateway.stats()

    return router


def _health(gateway: Gateway) -> APIRouter:
    router = APIRouter(prefix="/v1/health", tags=["health"])
    down: dict[int | str, dict[str, Any]] = {
        503: {"model": schema.Health, "description": "Not now"}
    }

    @router.get("/live", summary="The motion loop runs", responses=down)
    async def live(response: Response) -> schema.Health:
        """A failure here means: restart me."""
        response.status_code = 200 if gateway.alive else 503
        return schema.Health(status="live" if gateway.alive else "stuck")

    @router.get("/ready", summary="New work is welcome", responses=down)
    async def ready(response: Response) -> schema.Health:
        """A failure here means: send me nothing new for now."""
        response.status_code = 200 if gateway.ready else 503
        return schema.Health(status="ready" if gateway.ready else "not ready")

    return router


@lru_cache(maxsize=64)
def _glb(
    bodies: BodyLibrary, gender: str, betas: tuple[float, ...], detail: Detail, style: int
) -> tuple[str, bytes]:
    """ETag and file."""
    data = body_glb(bodies.model(gender, detail), np.array(betas), style)
    return f'"{hashlib.sha256(data).hexdigest()[:32]}"', data


def _numbers(text: str) -> tuple[float, ...]:
    """Betas of a query. Raises InvalidArgument."""
    if not text:
        return (0.0,) * BETAS
    try:
        return tuple(float(part) for part in text.split(","))
    except ValueError:
        raise InvalidArgument(f"must be {BETAS} numbers with commas between", "betas") from None
