"""How a server is operated: guard, origins, TLS, metrics, traces, limits."""

from dataclasses import dataclass, field
from ipaddress import ip_network

from wayfarer.config.settings import Settings
from wayfarer.transport.auth import Authenticator
from wayfarer.transport.edge.call_rates import CallRates
from wayfarer.transport.edge.guard import Guard
from wayfarer.transport.edge.metrics import Metrics
from wayfarer.transport.edge.origins import Origins, own_names
from wayfarer.transport.edge.prefix import Network
from wayfarer.transport.edge.tls import Tls
from wayfarer.transport.edge.tracing import Tracing, tracing


@dataclass(frozen=True, slots=True)
class ServerOptions:
    """One per server; the defaults are those of a server on loopback without auth."""

    guard: Guard = field(default_factory=Guard)
    origins: Origins = field(default_factory=Origins)
    metrics: Metrics = field(default_factory=Metrics)
    metrics_access: str = "guarded"  # like the setting `metrics`
    tracing: Tracing = field(default_factory=Tracing)
    tls: Tls | None = None
    connections: int = 1024
    drain_s: float = 2.0
    access_log: bool = False
    root_path: str = ""
    proxies: tuple[Network, ...] = ()

    @classmethod
    def from_settings(cls, settings: Settings) -> "ServerOptions":
        """Reads keys and certificates. Raises InvalidArgument that names setting and file."""
        tls = None
        if settings.tls_cert and settings.tls_key:
            tls = Tls(settings.tls_cert, settings.tls_key, settings.tls_client_ca)
            tls.check()
        traces = tracing(settings.otlp_endpoint)
        return cls(
            guard=Guard(
                Authenticator.from_settings(settings), CallRates(settings.limits.calls_per_second)
            ),
            origins=Origins(
                frozenset(settings.cors_origins),
                None
                if settings.has_auth
                else own_names() | {settings.host.lower(), *settings.allowed_hosts},
                settings.node_hosts,
            ),
            metrics=Metrics(traces.step if settings.otlp_endpoint else None),
            metrics_access=settings.metrics,
            tracing=traces,
            tls=tls,
            connections=settings.connections,
            drain_s=settings.drain_s,
            access_log=settings.access_log,
            root_path=settings.root_path,
            proxies=tuple(map(ip_network, settings.trusted_proxies)),
        )
