"""Contents and limits of the server."""

import asyncio

from wayfarer import __version__
from wayfarer.spec import FPS, NEW_FRAMES
from wayfarer.transport import schema
from wayfarer.transport.conversion import convert
from wayfarer.transport.conversion.basis import Basis
from wayfarer.transport.edge.caller import Scope
from wayfarer.transport.gateway.context import GatewayContext, implements, needs


class CatalogueApi:
    """CatalogService."""

    def __init__(self, context: GatewayContext) -> None:
        self._context = context

    @implements("GetSkeleton")
    def skeleton(self) -> schema.Skeleton:
        """The bones of all agents."""
        return self._context.skeleton

    @implements("ListBodies")
    def bodies(self) -> schema.Bodies:
        """The bodies that agents can have."""
        return schema.Bodies(
            bodies=tuple(convert.body(self._context.bodies, gender) for gender in schema.Gender)
        )

    @implements("FitBody")
    async def fit_body(self, request: schema.CharacterJoints) -> schema.FittedBody:
        """The body with a character's proportions. Raises InvalidArgument."""
        return await asyncio.to_thread(convert.fitted_body, request, self._context.bodies)

    @implements("ListModels")
    async def models(self) -> schema.Models:
        """The motion models that are loaded."""
        infos = await self._context.service.list_models()
        return schema.Models(models=tuple(convert.model(info) for info in infos))

    @implements("GetServerInfo")
    def info(self) -> schema.ServerInfo:
        """Version, frame rate, limits, bases."""
        return schema.ServerInfo(
            version=__version__,
            fps=FPS,
            frames_per_chunk=NEW_FRAMES,
            limits=self._context.limits,
            bases=tuple(convert.basis_info(basis) for basis in Basis),
        )

    @needs(Scope.READ)
    async def stats(self) -> schema.Stats:
        """Health of the motion loop."""
        return convert.stats(await self._context.service.stats())
