"""CatalogService over the gateway."""

from grpc.aio import ServicerContext as Context

from wayfarer.transport import wire
from wayfarer.transport.gateway import Gateway
from wayfarer.v1 import catalog_pb2, catalog_pb2_grpc


class CatalogService(catalog_pb2_grpc.CatalogServiceServicer):
    """See catalog.proto."""

    def __init__(self, gateway: Gateway) -> None:
        self._catalogue = gateway.catalogue

    async def GetSkeleton(  # noqa: N802
        self, request: catalog_pb2.GetSkeletonRequest, context: Context
    ) -> catalog_pb2.GetSkeletonResponse:
        """The bones of all agents."""
        skeleton = wire.message(catalog_pb2.Skeleton, self._catalogue.skeleton())
        return catalog_pb2.GetSkeletonResponse(skeleton=skeleton)

    async def ListBodies(  # noqa: N802
        self, request: catalog_pb2.ListBodiesRequest, context: Context
    ) -> catalog_pb2.ListBodiesResponse:
        """The bodies that agents can have."""
        return wire.message(catalog_pb2.ListBodiesResponse, self._catalogue.bodies())

    async def ListModels(  # noqa: N802
        self, request: catalog_pb2.ListModelsRequest, context: Context
    ) -> catalog_pb2.ListModelsResponse:
        """The motion models that are loaded."""
        return wire.message(catalog_pb2.ListModelsResponse, await self._catalogue.models())

    async def GetServerInfo(  # noqa: N802
        self, request: catalog_pb2.GetServerInfoRequest, context: Context
    ) -> catalog_pb2.GetServerInfoResponse:
        """Version, frame rate, limits, bases."""
        return wire.message(catalog_pb2.GetServerInfoResponse, self._catalogue.info())
