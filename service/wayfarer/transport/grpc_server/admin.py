"""AdminService over the gateway."""

from grpc.aio import ServicerContext as Context

from wayfarer.transport import schema, wire
from wayfarer.transport.gateway import Gateway
from wayfarer.v1 import admin_pb2, admin_pb2_grpc, catalog_pb2


class AdminService(admin_pb2_grpc.AdminServiceServicer):
    """See admin.proto."""

    def __init__(self, gateway: Gateway) -> None:
        self._admin = gateway.admin

    async def LoadModel(  # noqa: N802
        self, request: admin_pb2.LoadModelRequest, context: Context
    ) -> admin_pb2.LoadModelResponse:
        """Load a model beside the others."""
        model = await self._admin.load_model(wire.parse(schema.NewModel, request))
        return admin_pb2.LoadModelResponse(model=wire.message(catalog_pb2.Model, model))

    async def UseModel(  # noqa: N802
        self, request: admin_pb2.UseModelRequest, context: Context
    ) -> admin_pb2.UseModelResponse:
        """Let agents be moved by a loaded model."""
        used = await self._admin.use_model(request.name, wire.parse(schema.ModelUse, request))
        return admin_pb2.UseModelResponse(moved=used.moved)

    async def UnloadModel(  # noqa: N802
        self, request: admin_pb2.UnloadModelRequest, context: Context
    ) -> admin_pb2.UnloadModelResponse:
        """Unload a model."""
        await self._admin.unload_model(request.name)
        return admin_pb2.UnloadModelResponse()

    async def Drain(  # noqa: N802
        self, request: admin_pb2.DrainRequest, context: Context
    ) -> admin_pb2.DrainResponse:
        """Begin to shut down."""
        await self._admin.drain()
        return admin_pb2.DrainResponse()
