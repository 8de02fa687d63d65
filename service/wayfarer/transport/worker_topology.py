"""The workers of a server: the processes, this one among them, that share its sessions."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from wayfarer.errors import Misdirected
from wayfarer.shard import Shard, shard_of
from wayfarer.transport import schema


@dataclass(frozen=True, slots=True)
class WorkerTopology:
    """`endpoints` of all workers, in order; none of them for a server that is one process."""

    shard: Shard = field(default_factory=Shard)
    endpoints: Sequence[schema.Endpoint] = ()

    @property
    def own(self) -> schema.Endpoint | None:
        """Where this worker is called; None for a server that is one process."""
        return self.endpoints[self.shard.index] if self.endpoints else None

    def require_own(self, name: str) -> None:
        """Raises Misdirected when the session or agent of this id lives in another worker."""
        if self.endpoints and not self.shard.holds(name):
            right = self.endpoints[shard_of(name, self.shard.count)]
            raise Misdirected(
                f"{name!r} lives in worker {right.worker}, and this is worker {self.shard.index}; "
                f"call port {right.grpc_port} (gRPC) or {right.http_port} (HTTP) of this host, or "
                "the port of the whole server",
                right.worker,
                right.grpc_port,
                right.http_port,
            )
