"""What nodes send each other: replicas and live sessions, as bytes over gRPC on a port of its own;
and what an entry asks each of them.

Both ends are of one cluster and one version, so the messages are the service's own containers
(persistence/container.py), which check themselves; a header of JSON says what they are:

    4 bytes  length of the header  uint32, little-endian
    rest     header, then containers

Who calls shows the cluster's secret; with TLS both show a certificate of the cluster's authority.
"""

import itertools
import json
import secrets
import struct
import time
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field
from typing import Any, Final

import grpc

from wayfarer.cluster.messages import NodeInfo
from wayfarer.errors import (
    InvalidArgument,
    PermissionDenied,
    ResourceExhausted,
    Unavailable,
    WayfarerError,
)
from wayfarer.ids import group_of
from wayfarer.service.persistence.replica import Replica
from wayfarer.transport import errors
from wayfarer.transport.grpc_server import bracketed
from wayfarer.transport.tls import Tls

SERVICE: Final = "/wayfarer.cluster.Peer/"
MESSAGE_BYTES: Final = 64 * 1024 * 1024
REPLICA_BYTES: Final = 512 * 1024 * 1024
"""All replicas that a node keeps for others."""

LOG_BYTES: Final = 128 * 1024 * 1024
"""The logs beside them. A log without room is not kept, and begins again when its node dies."""

PART_BYTES: Final = 64
"""What a part of a log takes beside its own bytes."""

KEPT_S: Final = 60.0
"""A replica that nobody has renewed for so long is dropped."""

LOOPBACK: Final = "127.0.0.1"
"""Where nodes reach each other that are all on one machine."""

CALL_S: Final = 10.0
SESSION_S: Final = 0.1
"""How much longer a call may take for each session that it gives away."""

STOP_S: Final = 1.0
CALLS: Final = 32

_LENGTH: Final = struct.Struct("<I")


@dataclass(slots=True)
class KeptReplica:
    """The latest of a session or scene."""

    owner: str  # node
    state: bytes
    at: float  # monotonic
    log_parts: list[bytes] = field(default_factory=list)  # of a recorded session
    log_bytes: int = 0


class Replicas:
    """The latest state of other nodes' sessions and scenes."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._kept: dict[str, KeptReplica] = {}  # by id of a session or scene

    def keep(self, owner: str, name: str, state: bytes, part: bytes = b"", after: int = 0) -> int:
        """In place of an earlier one. `part` of its log follows `after` others, if it is not empty.

        Returns how many parts there are now: none where others are missing, or where there is no
        room for a log. Raises ResourceExhausted.
        """
        before = self._kept.get(name)
        if self.bytes + len(state) - (len(before.state) if before else 0) > REPLICA_BYTES:
            raise ResourceExhausted(f"a node keeps {REPLICA_BYTES >> 20} MiB of replicas at most")
        now = KeptReplica(owner, state, self._clock())
        if before is not None and after and len(before.log_parts) == after:
            now.log_parts, now.log_bytes = before.log_parts, before.log_bytes
        self._kept[name] = now
        if part and len(now.log_parts) == after:
            now.log_parts.append(part)
            now.log_bytes += len(part) + PART_BYTES
        if sum(replica.log_bytes for replica in self._kept.values()) > LOG_BYTES:
            now.log_parts, now.log_bytes = [], 0
        return len(now.log_parts)

    def renew(self, owner: str, present: set[str]) -> None:
        """These are on the owner now, and no others."""
        now = self._clock()
        for name, replica in list(self._kept.items()):
            if replica.owner == owner and name.removesuffix(CONTENT) in present:
                replica.at = now
            elif replica.owner == owner or now - replica.at > KEPT_S:
                del self._kept[name]

    def of(self, group: str) -> dict[str, KeptReplica]:
        """Those of a group, by name; they are kept until `drop`."""
        return {name: kept for name, kept in self._kept.items() if group_of(name) == group}

    def drop(self, group: str) -> None:
        """What lived in this group lives here, or nowhere any more."""
        for name in self.of(group):
            del self._kept[name]

    @property
    def bytes(self) -> int:
        """Of all states."""
        return sum(len(replica.state) for replica in self._kept.values())

    def __len__(self) -> int:
        return len(self._kept)


Take = Callable[[str, str, int, dict[str, bytes]], Awaitable[None]]
"""Let the live sessions and scenes, by id, go on here: of this owner, group and epoch."""

Prepare = Callable[[str, bytes], Awaitable[None]]
"""A scene of this content may come: bake it."""

CONTENT: Final = "/content"
"""Behind a scene's id: the replica of what never changes of it; under the id is what does."""

PREPARE_S: Final = 60.0
"""Within which a scene is baked."""


Ask = Callable[[bytes], Awaitable[bytes]]
"""Answer a NodeQuestion."""


class PeerServer:
    """Answers other nodes and entries. Create it inside a running event loop."""

    def __init__(
        self,
        host: str,
        secret: str,
        replicas: Replicas,
        take: Take,
        prepare: Prepare,
        ask: Ask,
        tls: Tls | None = None,
    ) -> None:
        """Raises Unavailable when no port can be had."""
        self._secret = secret.encode()
        self._replicas = replicas
        self._take = take
        self._prepare = prepare
        self._ask = ask
        self._server = grpc.aio.server(
            maximum_concurrent_rpcs=CALLS,
            options=[
                ("grpc.max_receive_message_length", MESSAGE_BYTES),
                ("grpc.so_reuseport", 0),
            ],
        )
        self._server.add_generic_rpc_handlers((_Methods(self),))
        where = f"{bracketed(host)}:0"
        try:
            if tls:
                self.port = self._server.add_secure_port(where, tls.grpc())
            else:
                self.port = self._server.add_insecure_port(where)
        except RuntimeError as error:
            raise Unavailable(f"cannot listen for other nodes on {host}: {error}") from None

    async def start(self) -> None:
        """Take calls."""
        await self._server.start()

    async def stop(self) -> None:
        """Let calls end."""
        await self._server.stop(STOP_S)

    async def handle(self, name: str, data: bytes, metadata: dict[str, Any]) -> bytes:
        """The answer to one call. Raises PermissionDenied, InvalidArgument, ResourceExhausted, …"""
        shown = str(metadata.get("authorization", "")).encode()
        if not secrets.compare_digest(shown, b"Bearer " + self._secret):
            raise PermissionDenied("not a node of this cluster")
        try:
            header, data = _opened(data)
            if name == "Ask":
                return await self._ask(data)
            if name == "Keep":
                state, part = _split(data, header["sizes"])
                owner, kept, after = header["owner"], header["name"], int(header["after"])
                return b"%d" % self._replicas.keep(owner, kept, state, part, after)
            if name == "Prepare":
                self._replicas.keep(header["owner"], header["scene_id"] + CONTENT, data)
                await self._prepare(header["scene_id"], data)
            elif name == "Present":
                self._replicas.renew(header["owner"], set(json.loads(data)))
            else:
                parts = _split(data, header["sizes"])
                live = dict(zip(header["names"], parts, strict=True))
                group, epoch = str(header["group"]), int(header["epoch"])
                await self._take(header["owner"], group, epoch, live)
        except (KeyError, ValueError, TypeError) as error:
            raise InvalidArgument(f"not a call of a node: {error!r}") from None
        return b""


class _Methods(grpc.GenericRpcHandler):
    def __init__(self, server: PeerServer) -> None:
        self._server = server

    def service(self, handler_call_details: grpc.HandlerCallDetails) -> Any:
        name = handler_call_details.method.removeprefix(SERVICE)
        if name not in ("Keep", "Present", "Take", "Prepare", "Ask"):
            return None

        async def handle(data: bytes, context: Any) -> bytes:
            try:
                metadata = dict(context.invocation_metadata() or ())
                return await self._server.handle(name, data, metadata)
            except WayfarerError as error:
                await context.abort_with_status(errors.to_grpc(error))
                raise

        return grpc.unary_unary_rpc_method_handler(handle)


def _closed(header: dict[str, Any], data: bytes) -> bytes:
    """Not as metadata of the call: that has room for some 200 names."""
    written = json.dumps(header).encode()
    return _LENGTH.pack(len(written)) + written + data


def _opened(body: bytes) -> tuple[dict[str, Any], bytes]:
    if len(body) < _LENGTH.size:
        raise ValueError("there is no header")
    end = _LENGTH.size + _LENGTH.unpack_from(body)[0]
    return json.loads(body[_LENGTH.size : end]), body[end:]


def _split(data: bytes, sizes: list[int]) -> list[bytes]:
    if sum(sizes) != len(data):
        raise ValueError("sizes are not those of the parts")
    ends = list(itertools.accumulate(sizes, initial=0))
    return [data[start:end] for start, end in itertools.pairwise(ends)]


class Peers:
    """Calls other nodes. All calls raise ResourceExhausted when the node has no room or the message
    is too large, and Unavailable when there is no answer for another reason.
    """

    def __init__(self, secret: str, tls: Tls | None = None) -> None:
        self._secret = secret
        self._tls = tls
        self._channels: dict[str, grpc.aio.Channel] = {}  # by node

    async def keep(
        self, node: NodeInfo, owner: str, name: str, replica: Replica, after: int
    ) -> int:
        """Leave a replica there; see `Replicas.keep`."""
        state, part = replica.state, replica.log_part
        sizes = [len(state), len(part)]
        header = {"owner": owner, "name": name, "sizes": sizes, "after": after}
        return int(await self._call(node, "Keep", header, state + part))

    async def present(self, node: NodeInfo, owner: str, names: list[str]) -> None:
        """Say which sessions and scenes there are."""
        await self._call(node, "Present", {"owner": owner}, json.dumps(names).encode())

    async def take(
        self, node: NodeInfo, owner: str, group: str, epoch: int, live: dict[str, bytes]
    ) -> None:
        """Give away what lives in a group, scenes first.

        If it raises, the node may have taken it all the same.
        """
        names, sizes = list(live), [len(one) for one in live.values()]
        header = {"owner": owner, "group": group, "epoch": epoch, "names": names, "sizes": sizes}
        seconds = CALL_S + SESSION_S * len(live)
        await self._call(node, "Take", header, b"".join(live.values()), seconds)

    async def prepare(self, node: NodeInfo, owner: str, scene_id: str, content: bytes) -> None:
        """Leave a scene's content there, and wait until it is baked."""
        header = {"owner": owner, "scene_id": scene_id}
        await self._call(node, "Prepare", header, content, PREPARE_S)

    async def ask(self, node: NodeInfo, question: bytes, seconds: float = CALL_S) -> bytes:
        """Its answer."""
        return await self._call(node, "Ask", {}, question, seconds)

    async def forget_others(self, nodes: set[str]) -> None:
        """Close the channels to all but these."""
        for name in self._channels.keys() - nodes:
            await self._channels.pop(name).close(None)

    async def _call(
        self,
        node: NodeInfo,
        name: str,
        header: dict[str, Any],
        data: bytes,
        seconds: float = CALL_S,
    ) -> bytes:
        channel = self._channels.get(node.name)
        if channel is None:
            channel = self._channels[node.name] = self._channel(node)
        metadata = (("authorization", f"Bearer {self._secret}"),)
        call: Any = channel.unary_unary(SERVICE + name, None, None)  # bytes both ways
        try:
            return bytes(await call(_closed(header, data), timeout=seconds, metadata=metadata))
        except grpc.aio.AioRpcError as error:
            full = error.code() is grpc.StatusCode.RESOURCE_EXHAUSTED
            kind = ResourceExhausted if full else Unavailable
            raise kind(f"node {node.name}: {error.details()}") from None

    def _channel(self, node: NodeInfo) -> grpc.aio.Channel:
        """The certificate must name the address at which the node is called."""
        options = [("grpc.max_send_message_length", MESSAGE_BYTES)]
        where = f"{bracketed(node.host or LOOPBACK)}:{node.peer_port}"
        if self._tls is None:
            return grpc.aio.insecure_channel(where, options=options)
        return grpc.aio.secure_channel(where, self._tls.grpc_channel(), options=options)
