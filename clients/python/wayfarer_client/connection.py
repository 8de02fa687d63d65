"""The channel to a server: connecting, credentials, and errors from failures."""

import asyncio
import random
import uuid
from collections.abc import AsyncGenerator, Callable
from contextlib import aclosing
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import grpc

from wayfarer_client.errors import (
    InvalidArgument,
    Misdirected,
    ResourceExhausted,
    Unavailable,
    WayfarerError,
    from_grpc,
)
from wayfarer_client.homes import Homes, Route
from wayfarer_client.methods import Methods, about, made
from wayfarer_client.v1 import (
    admin_pb2_grpc,
    agent_pb2_grpc,
    catalog_pb2,
    catalog_pb2_grpc,
    control_pb2_grpc,
    goal_pb2_grpc,
    motion_pb2_grpc,
    scene_pb2_grpc,
    session_pb2_grpc,
    snapshot_pb2_grpc,
)

BACKOFF_S: Final = (0.1, 2.0)
"""First and longest pause between attempts, seconds; each pause is twice the one before."""

OPTIONS: Final = [
    ("grpc.keepalive_time_ms", 20_000),
    ("grpc.keepalive_timeout_ms", 10_000),
    ("grpc.initial_reconnect_backoff_ms", 100),
    ("grpc.max_reconnect_backoff_ms", 2_000),
    # The server must notice a reader that is too slow: it then drops old frames, instead of piling
    # up minutes of motion in this process.
    ("grpc.http2.lookahead_bytes", 64 * 1024),
    ("grpc.max_receive_message_length", 64 * 1024 * 1024),
]


@dataclass(frozen=True, slots=True)
class Tls:
    """Encryption. Without fields, the server is checked against the system's authorities."""

    ca: Path | None = None  # PEM file of the authority that signed the server's certificate
    certificate: Path | None = None  # PEM file of this client's certificate chain (mTLS)
    key: Path | None = None  # PEM file of its private key
    server_name: str = ""  # name in the server's certificate, if it differs from the address

    def credentials(self) -> grpc.ChannelCredentials:
        """Raises InvalidArgument when a file cannot be read."""
        if bool(self.certificate) != bool(self.key):
            raise InvalidArgument("tls: certificate and key belong together: give both, or neither")
        try:
            ca, certificate, key = (
                None if path is None else Path(path).read_bytes()
                for path in (self.ca, self.certificate, self.key)
            )
        except OSError as error:
            raise InvalidArgument(f"tls: {error.filename}: {error.strerror}") from None
        return grpc.ssl_channel_credentials(ca, key, certificate)


@dataclass(frozen=True, slots=True)
class Access:
    """The caller's credentials. They are never logged or shown."""

    api_key: str = field(default="", repr=False)
    token: str | Callable[[], str] = field(default="", repr=False)  # a JWT, or a function

    def metadata(self) -> tuple[tuple[str, str], ...]:
        """Headers of a call."""
        found: list[tuple[str, str]] = []
        if self.api_key:
            found.append(("x-api-key", self.api_key))
        if token := self.token() if callable(self.token) else self.token:
            found.append(("authorization", f"Bearer {token}"))
        return tuple(found)


class Connection:
    """A channel and its stubs.

    A server may be several nodes: calls go to the node where their session or scene lives. A node
    that does not answer is forgotten, and the connection's address is asked for it again.
    """

    def __init__(self, address: str, timeout: float, access: Access, tls: Tls | None) -> None:
        """`timeout`: seconds for connecting, for each call, and for its retries."""
        self.address = address
        self.timeout = timeout
        self._access = access
        self.tls = tls
        self._channel = _channel(address, tls)
        self._nodes: dict[str, grpc.aio.Channel] = {}  # by address, as far as they were called
        self.homes = Homes(address)
        self._skeleton: catalog_pb2.Skeleton | None = None
        # The generated stubs are typed for the synchronous API only.
        methods: Any = Methods()
        self.scenes: Any = scene_pb2_grpc.SceneServiceStub(methods)
        self.sessions: Any = session_pb2_grpc.SessionServiceStub(methods)
        self.agents: Any = agent_pb2_grpc.AgentServiceStub(methods)
        self.goals: Any = goal_pb2_grpc.GoalServiceStub(methods)
        self.motion: Any = motion_pb2_grpc.MotionServiceStub(methods)
        self.control: Any = control_pb2_grpc.ControlServiceStub(methods)
        self.snapshots: Any = snapshot_pb2_grpc.SnapshotServiceStub(methods)
        self.catalog: Any = catalog_pb2_grpc.CatalogServiceStub(methods)
        self.admin: Any = admin_pb2_grpc.AdminServiceStub(methods)

    async def ready(self) -> None:
        """Waits until the server answers. Raises Unavailable."""
        try:
            async with asyncio.timeout(self.timeout):
                await self._channel.channel_ready()
        except TimeoutError:
            await self.close()
            raise Unavailable(
                f"no gRPC server at {self.address} within {self.timeout:g} s; expected: HOST:PORT, "
                "with its gRPC port (50051 by default)"
            ) from None

    async def close(self) -> None:
        """Closes the channels."""
        for channel in (self._channel, *self._nodes.values()):
            await channel.close(None)

    def learn(self, session_id: str, host: str, port: int) -> None:
        """Notes that a session lives at that node."""
        self.homes.learn(session_id, self.homes.node(host, port))

    def _node(self, address: str) -> grpc.aio.Channel:
        if address == self.address:
            return self._channel
        if address not in self._nodes:
            self._nodes[address] = _channel(address, self.tls)
        return self._nodes[address]

    def route(self, request: Any) -> Route:
        """The route of a call about the session, scene or agent that is named."""
        return self.homes.route(about(request))

    async def call(self, method: Any, request: Any, timeout: float | None = None) -> Any:
        """The reply to a request. Raises WayfarerError.

        A call that is refused temporarily is sent again after the server's waiting time, within
        the connection's `timeout`. A call that belongs to another node goes there.
        """
        limit = self.timeout if timeout is None else timeout
        ends_at = _now() + self.timeout
        route = self.route(request)
        while True:
            call = method.on(self._node(route.address))
            try:
                reply = await call(request, timeout=limit, metadata=self._access.metadata())
            except grpc.aio.AioRpcError as error:
                refusal = from_grpc(error)
            else:
                route.answered(made(reply))
                return reply
            if not goes_on(route, refusal) and not await come_again(refusal, ends_at):
                raise refusal

    async def skeleton(self) -> catalog_pb2.Skeleton:
        """The server's skeleton, asked for once."""
        if self._skeleton is None:
            reply = await self.call(self.catalog.GetSkeleton, catalog_pb2.GetSkeletonRequest())
            self._skeleton = reply.skeleton
        return self._skeleton

    async def create(self, method: Any, request: Any, timeout: float | None = None) -> Any:
        """As `call`, repeated while the server is unavailable, for `self.timeout`.

        The request carries an id, so that it takes effect once, whatever is lost on the way.
        """
        request.request_id = request.request_id or str(uuid.uuid4())
        backoff = Backoff(self.timeout)
        while True:
            try:
                return await self.call(method, request, timeout)
            except Unavailable:
                if not await backoff.pause():
                    raise

    def open(self, route: Route, method: Any, *request: Any) -> Any:
        """A stream of messages, without a time limit."""
        call = method.on(self._node(route.address))
        return call(*request, metadata=self._access.metadata())

    async def messages(self, method: Any, request: Any) -> AsyncGenerator[Any]:
        """All messages of a stream that is read once. Raises WayfarerError.

        A stream that is refused temporarily is requested again, as by `call`.
        """
        ends_at = _now() + self.timeout
        begun = False
        route = self.route(request)
        while True:
            call = self.open(route, method, request)
            try:
                async for message in call:
                    begun = True
                    yield message
                return
            except grpc.aio.AioRpcError as error:
                refusal = from_grpc(error)
            finally:
                call.cancel()
            if begun or not (goes_on(route, refusal) or await come_again(refusal, ends_at)):
                raise refusal

    async def file(self, method: Any, request: Any) -> bytes:
        """A file, from a stream of its parts. Raises WayfarerError."""
        async with aclosing(self.messages(method, request)) as messages:
            return b"".join([message.file_part async for message in messages])


def goes_on(route: Route, refusal: WayfarerError) -> bool:
    """Whether the call continues at another node, now the route's `address`."""
    if isinstance(refusal, Misdirected):
        return route.misdirected(refusal.host, refusal.grpc_port)
    return isinstance(refusal, Unavailable) and route.unavailable()


async def come_again(refusal: WayfarerError, ends_at: float) -> bool:
    """Waits for as long as the server asks; False at once if it does not, or time is up."""
    wait = refusal.retry_after * random.uniform(1.0, 1.2)  # so that not all come back together
    if not (isinstance(refusal, ResourceExhausted) and 0 < wait <= ends_at - _now()):
        return False
    await asyncio.sleep(wait)
    return True


class Backoff:
    """Pauses between attempts, longer each time, for `deadline` seconds since the last success."""

    def __init__(self, deadline: float) -> None:
        self.deadline = deadline
        self.succeeded()

    def succeeded(self) -> None:
        """Begins again with the shortest pause."""
        self._pause = BACKOFF_S[0]
        self._ends_at = _now() + self.deadline

    async def pause(self, at_least: float = 0.0) -> bool:
        """Waits before the next attempt; False, at once, when the time is over."""
        left = self._ends_at - _now()
        if left <= 0:
            return False
        # random: clients that a server lost together must not come back together
        pause = max(at_least, self._pause * random.uniform(0.5, 1.0))
        self._pause = min(2 * self._pause, BACKOFF_S[1])
        await asyncio.sleep(min(pause, left))
        return True


def _now() -> float:
    return asyncio.get_running_loop().time()


def _channel(address: str, tls: Tls | None) -> grpc.aio.Channel:
    if tls is None:
        return grpc.aio.insecure_channel(address, options=OPTIONS)
    named = [("grpc.ssl_target_name_override", tls.server_name)] if tls.server_name else []
    return grpc.aio.secure_channel(address, tls.credentials(), options=[*OPTIONS, *named])
