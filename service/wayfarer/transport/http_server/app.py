"""The ASGI application: the API as JSON, body meshes, WebSockets, and the viewer."""

from pathlib import Path
from typing import Any, Final

from fastapi import Depends, FastAPI
from fastapi.openapi.utils import get_openapi
from starlette.responses import RedirectResponse
from starlette.routing import Route

from wayfarer import __version__
from wayfarer.config.limits import Limits
from wayfarer.transport import schema
from wayfarer.transport.edge.request_limits import (
    PROBLEMS,
    RequestLimits,
    add_problem_handlers,
)
from wayfarer.transport.gateway import Gateway
from wayfarer.transport.http_server.calls import call_routes
from wayfarer.transport.http_server.catalogue import catalogue_routes
from wayfarer.transport.http_server.clips import clip_endpoints
from wayfarer.transport.http_server.events import event_routes
from wayfarer.transport.http_server.health import health_routes
from wayfarer.transport.http_server.page_files import PageFiles
from wayfarer.transport.http_server.parameters import only_known_query
from wayfarer.transport.http_server.scenes import scene_endpoints
from wayfarer.transport.http_server.unknown_path import UnknownPath
from wayfarer.transport.streams.websocket import add_sockets

VIEWER: Final = Path(__file__).parent.parent / "viewer"
REFERENCE: Final = Path(__file__).parent.parent / "reference"
"""The page /docs."""

DESCRIPTION: Final = """
Motion of digital humans. Open a session, create agents, give them goals; their poses come over
`WS /v1/stream`, or `WS /v1/control` with goals and acknowledgements over the same socket (protobuf
in binary frames: docs/wire-format.md), or over gRPC.

All lengths, places and headings are in the basis of the session. Errors are RFC 9457 problem
documents (docs/errors.md). Where the server asks for credentials: an API key in `x-api-key`, or an
API key or JWT in `authorization: Bearer`.
"""
SECURITY: Final = {
    "bearer": {"type": "http", "scheme": "bearer", "description": "an API key or a JWT"},
    "apiKey": {"type": "apiKey", "in": "header", "name": "x-api-key"},
}
LIMITED: Final = {
    "NewAgents.agents": ("maxItems", "agents_per_call"),
    "Goals.goals": ("maxItems", "path_goals"),
    "Patrol.goals": ("maxItems", "path_goals"),
    "Visit.goals": ("maxItems", "path_goals"),
    "ClipRequest.goals": ("maxItems", "path_goals"),
    "ClipRequest.seconds": ("maximum", "clip_s"),
    "MotionExport.seconds": ("maximum", "clip_s"),
    "StepRequest.steps": ("maximum", "steps_per_call"),
    "Crowd.count": ("maximum", "agents_per_session"),
    "NewSession.lease_s": ("maximum", "lease_s"),
    "NewScene.lease_s": ("maximum", "lease_s"),
    "NewExampleScene.lease_s": ("maximum", "lease_s"),
}
"""Fields whose bounds are settings of the server: keyword of JSON schema, name of the limit."""


def http_app(gateway: Gateway, root_path: str = "") -> FastAPI:
    """The ASGI application; `root_path` precedes the paths of its OpenAPI document."""
    app = FastAPI(
        title="Wayfarer",
        version=__version__,
        description=DESCRIPTION,
        docs_url=None,  # FastAPI's own pages load scripts from other hosts
        redoc_url=None,
    )
    special = {**scene_endpoints(gateway), **clip_endpoints(gateway)}
    calls = call_routes(gateway.calls, special)
    for routes in (calls, event_routes(gateway), catalogue_routes(gateway)):
        app.include_router(routes, responses=PROBLEMS, dependencies=[Depends(only_known_query)])
    app.include_router(health_routes(gateway))  # probes may add query parameters
    add_sockets(app, gateway)
    add_problem_handlers(app)
    limits = gateway.limits
    app.add_middleware(RequestLimits, body_bytes=limits.message_bytes, mesh_bytes=limits.mesh_bytes)
    app.openapi = lambda: _document(app, limits, root_path)  # type: ignore[method-assign]
    app.router.routes.append(Route("/v1/{rest:path}", UnknownPath(app.openapi)))
    app.router.routes.append(Route("/docs", lambda request: RedirectResponse("docs/")))
    app.mount("/docs", PageFiles(REFERENCE), name="docs")
    if VIEWER.is_dir():
        # client/ is a link to clients/web/src in a checkout; an installed package has the files
        app.mount("/", PageFiles(VIEWER), name="viewer")
    return app


def _document(app: FastAPI, limits: Limits, root_path: str) -> dict[str, Any]:
    """The OpenAPI document, with the parts that FastAPI does not know."""
    if app.openapi_schema is None:
        document = get_openapi(
            title=app.title,
            version=app.version,
            description=app.description,
            routes=app.routes,
            servers=[{"url": root_path or "/"}],
            license_info={"name": "Apache License 2.0", "identifier": "Apache-2.0"},
        )
        components = document["components"]
        for message in (schema.Problem, schema.FieldProblem):
            components["schemas"][message.__name__] = message.model_json_schema(
                mode="serialization", ref_template="#/components/schemas/{model}"
            )
        components["schemas"]["Problem"].pop("$defs", None)
        for path, (bound, limit) in LIMITED.items():
            name, _, field = path.partition(".")
            properties = components["schemas"][name]["properties"]
            properties[field][bound] = getattr(limits, limit)
        area = components["schemas"]["Area"]["properties"]
        area["radius"] |= schema.bounds(None, limits.goal_distance_m)
        components["securitySchemes"] = SECURITY
        document["security"] = [{}, *({name: []} for name in SECURITY)]
        app.openapi_schema = document
    return app.openapi_schema
