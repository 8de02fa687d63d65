"""Routes of SessionService, and the calls on a session as a whole."""

from fastapi import APIRouter

from wayfarer.transport import schema, wire
from wayfarer.transport.gateway import Gateway
from wayfarer.transport.http_server.parameters import IdempotencyKey, SessionId, request_id


def session_routes(gateway: Gateway) -> APIRouter:
    """`/v1/sessions`."""
    router = APIRouter(prefix="/v1/sessions", tags=["sessions"])

    @router.post("", status_code=201, operation_id="createSession", summary="Open a session")
    async def create_session(
        request: schema.NewSession | None = None, idempotency_key: IdempotencyKey = ""
    ) -> schema.Session:
        """It lives while it has a stream or a call in each lease period."""
        request = request or schema.NewSession()
        known_as = request_id(request.request_id, idempotency_key)
        return await gateway.sessions.create(request.model_copy(update={"request_id": known_as}))

    @router.get("", operation_id="listSessions", summary="Describe the caller's sessions")
    async def list_sessions() -> schema.Sessions:
        """Oldest first; a caller with the scope admin sees all. Renews no lease."""
        return await gateway.sessions.list_own()

    @router.get("/{session_id}", operation_id="getSession", summary="Describe a session")
    async def get_session(session_id: SessionId) -> schema.Session:
        return await gateway.sessions.get(session_id)

    @router.post("/{session_id}/renew", operation_id="renewSession", summary="Renew the lease")
    async def renew_session(session_id: SessionId) -> schema.Renewal:
        """As every call does that names the session or one of its agents."""
        return await gateway.sessions.renew(session_id)

    @router.delete(
        "/{session_id}", status_code=204, operation_id="deleteSession", summary="End a session"
    )
    async def delete_session(session_id: SessionId) -> None:
        """Its agents and streams end with it."""
        await gateway.sessions.delete(session_id)

    @router.post(
        "/{session_id}/agents",
        status_code=201,
        operation_id="createAgents",
        summary="Create agents, all or none",
    )
    async def create_agents(
        session_id: SessionId, request: schema.NewAgents, idempotency_key: IdempotencyKey = ""
    ) -> schema.Agents:
        """429 when a limit is reached, or when the server could not step them all in time."""
        known_as = request_id(request.request_id, idempotency_key)
        request = request.model_copy(update={"request_id": known_as})
        return await gateway.agents.create(session_id, request)

    @router.get(
        "/{session_id}/agents",
        operation_id="listAgents",
        summary="Describe all agents of a session",
    )
    async def list_agents(session_id: SessionId) -> schema.Agents:
        return await gateway.agents.list_of(session_id)

    @router.post(
        "/{session_id}/step",
        operation_id="stepAgents",
        summary="Advance the time of a lock-step session",
    )
    async def step_agents(
        session_id: SessionId, request: schema.StepRequest | None = None
    ) -> schema.Steps:
        """409 for a session that was not made with lock_step."""
        reply = await gateway.motion.step(session_id, request or schema.StepRequest())
        return schema.Steps.model_validate(wire.values(reply))

    return router
