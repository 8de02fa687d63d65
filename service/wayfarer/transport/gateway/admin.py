"""Administration: loads and unloads models, shuts the server down."""

from collections.abc import Callable

import structlog

from wayfarer.errors import ArtifactError, FailedPrecondition
from wayfarer.transport import schema
from wayfarer.transport.conversion import convert
from wayfarer.transport.edge.caller import current_caller
from wayfarer.transport.gateway.context import GatewayContext, implements

log = structlog.get_logger(__name__)


class AdminApi:
    """AdminService."""

    def __init__(self, context: GatewayContext, stop: Callable[[], None]) -> None:
        """`stop` begins the shutdown, as SIGTERM does."""
        self._context = context
        self._stop = stop

    @implements("LoadModel")
    async def load_model(self, request: schema.NewModel) -> schema.Model:
        """Loads another model. Raises NotFound, AlreadyExists, FailedPrecondition."""
        try:
            await self._context.service.load_model(request.name)
        except ArtifactError as error:
            raise FailedPrecondition(f"model {request.name!r} cannot be loaded: {error}") from error
        log.info("model loaded", model=request.name, caller=current_caller().name)
        infos = await self._context.service.list_models()
        return next(convert.model(info) for info in infos if info.name == request.name)

    @implements("UseModel")
    async def use_model(self, name: str, request: schema.ModelUse) -> schema.ModelUsed:
        """Makes a loaded model move agents. Raises NotFound."""
        moved = await self._context.service.use_model(name, request.move_agents)
        log.info("model in use", model=name, moved=moved, caller=current_caller().name)
        return schema.ModelUsed(moved=moved)

    @implements("UnloadModel")
    async def unload_model(self, name: str) -> None:
        """Unloads a model. Raises NotFound, FailedPrecondition."""
        await self._context.service.unload_model(name)
        log.info("model unloaded", model=name, caller=current_caller().name)

    @implements("Drain")
    async def drain(self) -> None:
        """Begins to shut down."""
        log.info("drain asked for", caller=current_caller().name)
        self._stop()
