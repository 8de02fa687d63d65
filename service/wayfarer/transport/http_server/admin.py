"""Routes of AdminService."""

from fastapi import APIRouter

from wayfarer.transport import schema
from wayfarer.transport.gateway import Gateway
from wayfarer.transport.http_server.parameters import ModelName


def admin_routes(gateway: Gateway) -> APIRouter:
    """`/v1/admin`."""
    router = APIRouter(prefix="/v1/admin", tags=["admin"])
    admin = gateway.admin

    @router.post(
        "/models", status_code=201, operation_id="loadModel", summary="Load a motion model"
    )
    async def load_model(request: schema.NewModel) -> schema.Model:
        """Beside those loaded."""
        return await admin.load_model(request)

    @router.post(
        "/models/{name}/use",
        operation_id="useModel",
        summary="Let agents be moved by a loaded model",
    )
    async def use_model(
        name: ModelName, request: schema.ModelUse | None = None
    ) -> schema.ModelUsed:
        """New agents, and on request all present ones, each from its next primitive on."""
        return await admin.use_model(name, request or schema.ModelUse())

    @router.delete(
        "/models/{name}", status_code=204, operation_id="unloadModel", summary="Unload a model"
    )
    async def unload_model(name: ModelName) -> None:
        """409 while it is in use or moves an agent."""
        await admin.unload_model(name)

    @router.post("/drain", status_code=202, operation_id="drain", summary="Shut down")
    async def drain() -> None:
        """Take no new sessions and agents, end all streams, and stop: as SIGTERM does."""
        await admin.drain()

    return router
