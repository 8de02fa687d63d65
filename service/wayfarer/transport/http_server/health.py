"""Probes."""

from typing import Any

from fastapi import APIRouter, Response

from wayfarer.transport import schema
from wayfarer.transport.gateway import Gateway


def health_routes(gateway: Gateway) -> APIRouter:
    """`/v1/health`: needs no credentials."""
    router = APIRouter(prefix="/v1/health", tags=["health"])
    down: dict[int | str, dict[str, Any]] = {
        503: {"model": schema.Health, "description": "Not now"}
    }

    @router.get("/live", operation_id="getLive", summary="The motion loop runs", responses=down)
    async def live(response: Response) -> schema.Health:
        """A failure here means: restart me."""
        response.status_code = 200 if gateway.alive else 503
        return schema.Health(status="live" if gateway.alive else "stuck")

    @router.get("/ready", operation_id="getReady", summary="New work is welcome", responses=down)
    async def ready(response: Response) -> schema.Health:
        """A failure here means: send me nothing new for now."""
        response.status_code = 200 if gateway.ready else 503
        return schema.Health(status="ready" if gateway.ready else "not ready")

    @router.get(
        "/startup", operation_id="getStartup", summary="The models are warm", responses=down
    )
    async def startup(response: Response) -> schema.Health:
        """A failure here means: wait before you ask for the others."""
        response.status_code = 200 if gateway.started else 503
        return schema.Health(status="started" if gateway.started else "starting")

    return router
