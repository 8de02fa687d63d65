"""SessionService over the gateway."""

from grpc.aio import ServicerContext as Context

from wayfarer.transport import schema, wire
from wayfarer.transport.gateway import Gateway
from wayfarer.v1 import session_pb2, session_pb2_grpc


class SessionService(session_pb2_grpc.SessionServiceServicer):
    """See session.proto."""

    def __init__(self, gateway: Gateway) -> None:
        self._sessions = gateway.sessions

    async def CreateSession(  # noqa: N802
        self, request: session_pb2.CreateSessionRequest, context: Context
    ) -> session_pb2.CreateSessionResponse:
        """Open a session."""
        session = await self._sessions.create(wire.parse(schema.NewSession, request))
        return session_pb2.CreateSessionResponse(session=wire.message(session_pb2.Session, session))

    async def GetSession(  # noqa: N802
        self, request: session_pb2.GetSessionRequest, context: Context
    ) -> session_pb2.GetSessionResponse:
        """Describe a session."""
        session = await self._sessions.get(request.session_id)
        return session_pb2.GetSessionResponse(session=wire.message(session_pb2.Session, session))

    async def ListSessions(  # noqa: N802
        self, request: session_pb2.ListSessionsRequest, context: Context
    ) -> session_pb2.ListSessionsResponse:
        """Describe the caller's sessions."""
        return wire.message(session_pb2.ListSessionsResponse, await self._sessions.list_own())

    async def RenewSession(  # noqa: N802
        self, request: session_pb2.RenewSessionRequest, context: Context
    ) -> session_pb2.RenewSessionResponse:
        """Begin the lease anew."""
        renewal = await self._sessions.renew(request.session_id)
        return wire.message(session_pb2.RenewSessionResponse, renewal)

    async def DeleteSession(  # noqa: N802
        self, request: session_pb2.DeleteSessionRequest, context: Context
    ) -> session_pb2.DeleteSessionResponse:
        """End a session."""
        await self._sessions.delete(request.session_id)
        return session_pb2.DeleteSessionResponse()
