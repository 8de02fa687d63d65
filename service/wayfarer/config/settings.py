"""All settings: one frozen, validated value, read only by the composition root (serve.py).

The first source that has a setting wins: the command line, the environment
(`WAYFARER_HTTP_PORT=9000`, nested `WAYFARER_LIMITS__AGENTS=128`), a TOML file (`--config` or
`WAYFARER_CONFIG`), its default. Unknown keys are errors in every source. In the environment, lists
are written with commas.
"""

import re
from ipaddress import ip_address, ip_network
from pathlib import Path
from typing import Annotated, Final, Literal
from urllib.parse import urlsplit

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, model_validator
from pydantic_settings import (
    BaseSettings,
    NoDecode,
    PydanticBaseSettingsSource,
    SettingsConfigDict,
)

from wayfarer.config.limits import Limits
from wayfarer.engines.engine import EngineKind

PREFIX: Final = "WAYFARER_"

SIGNATURES: Final = (
    *("ES256", "ES384", "ES512", "RS256", "RS384", "RS512", "PS256", "PS384", "PS512", "EdDSA"),
)
"""Signature algorithms that JWTs may use."""


Texts = Annotated[
    tuple[str, ...],
    NoDecode,
    BeforeValidator(lambda v: v.replace(",", " ").split() if isinstance(v, str) else v),
]


def _origin(text: str) -> str:
    parts = urlsplit(text)
    if parts.scheme not in ("http", "https") or f"{parts.scheme}://{parts.netloc}" != text:
        raise ValueError(f"{text!r} is no origin; write https://example.org, with no path")
    return text


def _host(text: str) -> str:
    if not re.fullmatch(r"\*|[A-Za-z0-9_]([A-Za-z0-9_.-]*[A-Za-z0-9_])?", text):
        raise ValueError(f"{text!r} is no host name; write example.org, with no scheme and no port")
    return text.lower()


def _root_path(text: str) -> str:
    text = text.rstrip("/")
    if text and not re.fullmatch(r"(/(?!\.{1,2}(/|$))[\w.~-]+)+", text):
        raise ValueError(f"{text!r} is no path to stand below; write /wf")
    return text


def _network(text: str) -> str:
    return str(ip_network(text, strict=False))


def _node_host(text: str) -> str:
    name = text.removeprefix("*.")
    if name == "*":
        raise ValueError(f"{text!r} would let pages call every server; write *.nodes.example.org")
    return text.removesuffix(name) + _host(name)


class Auth(BaseModel):
    """How callers are authenticated. If nothing is set, every caller may do everything."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    keys_file: Path | None = Field(
        default=None, description="TOML file of API keys; `wayfarer keys new` makes entries"
    )
    jwt_keys: str = Field(
        default="", description="JWKS of the issuer of JWTs: a file or an https:// URL"
    )
    jwt_issuer: str = Field(default="", description="required `iss` of a JWT")
    jwt_audience: str = Field(default="wayfarer", description="required `aud` of a JWT")
    jwt_algorithms: Annotated[
        Texts, AfterValidator(lambda found: tuple(_signature(name) for name in found))
    ] = Field(default=("ES256", "RS256"), min_length=1, description="accepted signature algorithms")
    jwt_leeway_s: float = Field(
        default=30.0, ge=0, le=300, description="accepted difference of clocks in seconds"
    )
    certificate_scopes: Texts = Field(
        default=("read", "control"),
        description="scopes of callers with only a client certificate",
    )

    @model_validator(mode="after")
    def _whole(self) -> "Auth":
        if bool(self.jwt_keys) != bool(self.jwt_issuer):
            raise ValueError("jwt_keys and jwt_issuer belong together: set both, or neither")
        if self.jwt_keys and "://" in self.jwt_keys and not self.jwt_keys.startswith("https://"):
            raise ValueError("jwt_keys is a file or an https:// URL")
        if unknown := set(self.certificate_scopes) - {"read", "control", "admin"}:
            raise ValueError(
                f"certificate_scopes: {', '.join(sorted(unknown))} is no scope; "
                "there are read, control, admin"
            )
        return self


def _signature(name: str) -> str:
    """Allows public-key signatures only: with HS256, the verifier could also sign."""
    if name not in SIGNATURES:
        raise ValueError(f"{name!r} is not allowed; allowed are {', '.join(SIGNATURES)}")
    return name


class PeerTls(BaseModel):
    """Certificates that the nodes and entries of a cluster show each other."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    cert: Path | None = Field(
        default=None,
        description="PEM file of the certificate that Ray shows other machines of a cluster",
    )
    key: Path | None = Field(default=None, description="PEM file of its private key")
    ca: Path | None = Field(
        default=None,
        description="PEM file of the authority of the cluster's own, whose certificates are "
        "accepted",
    )

    @model_validator(mode="after")
    def _whole(self) -> "PeerTls":
        if len({bool(one) for one in (self.cert, self.key, self.ca)}) > 1:
            raise ValueError("cert, key and ca belong together: set all, or none")
        return self


class Settings(BaseSettings):
    """Everything that can be set."""

    model_config = SettingsConfigDict(
        frozen=True, extra="forbid", env_prefix=PREFIX, env_nested_delimiter="__"
    )

    host: str = Field(default="127.0.0.1", description="address to listen on")
    http_port: int = Field(
        default=8080, ge=0, le=65535, description="port of HTTP and WebSocket; 0: any free port"
    )
    grpc_port: int = Field(
        default=50051, ge=0, le=65535, description="port of gRPC; 0: any free port"
    )
    model: str = Field(
        default="gamma-anny52",
        description="motion model: a shipped name, a name in models_dir, or a path with a /",
    )
    models_dir: Path | None = Field(
        default=None, description="folder of further model folders, for AdminService.LoadModel"
    )
    smplx_dir: Path | None = Field(
        default=None,
        description="folder of your own SMPLX_MALE.npz and SMPLX_FEMALE.npz, for models of SMPL-X",
    )
    state_dir: Path | None = Field(
        default=None, description="folder of the journal, from which sessions survive a restart"
    )
    keep_compiled: bool = Field(
        default=True,
        description="keep the networks that openvino compiles in state_dir, for a quicker start",
    )
    engine: EngineKind = Field(
        default="auto",
        description="engine: onnxruntime; openvino (`pip install wayfarer[openvino]`); "
        "auto: the faster of these two; torch (`pip install wayfarer[gpu]`): on a GPU",
    )
    threads: int = Field(
        default=0,
        ge=0,
        le=256,
        description="threads of the engine; 0: all cores that affinity and CPU quota "
        "(cgroup) allow, shared among the nodes",
    )
    workers: int = Field(
        default=1,
        ge=1,
        le=64,
        description="processes (nodes) that share the sessions; 1: the server itself",
    )
    pin_workers: bool = Field(default=False, description="bind each node to its share of the cores")
    candidates: int = Field(
        default=1,
        ge=1,
        le=256,
        description="candidate primitives tried per step; 1: the policy's own draw, as people move",
    )
    admission: bool = Field(
        default=True,
        description="refuse new agents when the measured load is too high; false: only by `limits`",
    )
    most_load: float = Field(
        default=0.75,
        gt=0,
        le=1,
        description="largest share of the time that steps may take before agents are refused",
    )
    limits: Limits = Limits()
    auth: Auth = Auth()
    connections: int = Field(
        default=1024, ge=8, description="most open connections, of HTTP and of gRPC each"
    )
    insecure_no_auth: bool = Field(
        default=False, description="accept calls from other machines without authentication"
    )
    tls_cert: Path | None = Field(
        default=None, description="PEM file of the certificate chain; with it, both ports speak TLS"
    )
    tls_key: Path | None = Field(
        default=None, description="PEM file of the private key of tls_cert"
    )
    tls_client_ca: Path | None = Field(
        default=None, description="PEM file of the authority whose client certificates are accepted"
    )
    peer_tls: PeerTls = PeerTls()
    insecure_peers: bool = Field(
        default=False,
        description="let nodes on several machines talk to each other without encryption",
    )
    cors_origins: Annotated[
        Texts, AfterValidator(lambda found: tuple(_origin(text) for text in found))
    ] = Field(
        default=(), description="origins of web pages that may call, e.g. https://example.org"
    )
    allowed_hosts: Annotated[
        Texts, AfterValidator(lambda found: tuple(_host(text) for text in found))
    ] = Field(
        default=(),
        description="further host names of the server, e.g. wayfarer.example.org; *: any; checked "
        "only on servers without credentials",
    )
    root_path: Annotated[str, AfterValidator(_root_path)] = Field(
        default="",
        max_length=200,
        description="path of a proxy below which the server stands, e.g. /wf; the proxy may leave "
        "it on or take it off",
    )
    trusted_proxies: Annotated[
        Texts, AfterValidator(lambda found: tuple(_network(text) for text in found))
    ] = Field(
        default=("127.0.0.0/8", "::1/128"),
        description="addresses or networks of proxies whose X-Forwarded-Prefix counts as root_path",
    )
    node_hosts: Annotated[
        Texts, AfterValidator(lambda found: tuple(_node_host(text) for text in found))
    ] = Field(
        default=(),
        description="hosts of later nodes, which open viewers may call, e.g. "
        "*.nodes.example.org; a cluster's machines need not be listed",
    )
    metrics: Literal["guarded", "open", "off"] = Field(
        default="guarded", description="/metrics is guarded (readable with scope read), open or off"
    )
    otlp_endpoint: str = Field(
        default="",
        description="OTLP/gRPC collector for traces, as http://host:4317; empty: no traces",
    )
    drain_s: float = Field(
        default=2.0,
        ge=0,
        le=600,
        description="seconds that streams and calls get to end at shutdown",
    )
    log_level: Literal["debug", "info", "warning", "error"] = Field(
        default="info", description="lowest level that is logged: debug, info, warning, error"
    )
    log_format: Literal["auto", "text", "json"] = Field(
        default="auto", description="text, json, or auto: text on a terminal, otherwise JSON"
    )
    access_log: bool = Field(default=False, description="log a line for every call")

    @model_validator(mode="after")
    def _consistent(self) -> "Settings":
        if bool(self.tls_cert) != bool(self.tls_key):
            raise ValueError("tls_cert and tls_key belong together: set both, or neither")
        if self.tls_client_ca and not self.tls_cert:
            raise ValueError(
                "tls_client_ca needs tls_cert and tls_key: client certificates are TLS"
            )
        if self.workers > 1:
            self._check_ports()
        if not (self.is_loopback or self.has_auth or self.insecure_no_auth):
            raise ValueError(
                f"host {self.host} lets other machines in, and nothing says who may call; either "
                "set auth.keys_file, auth.jwt_keys or tls_client_ca (docs/operations.md), or, "
                "where something else guards the ports, give --insecure-no-auth"
            )
        return self

    def _check_ports(self) -> None:
        """The nodes' ports follow the server's own."""
        for name, port in (("grpc_port", self.grpc_port), ("http_port", self.http_port)):
            if port + self.workers > 65535:
                raise ValueError(
                    f"{name} {port} leaves no room for the ports of {self.workers} workers after "
                    f"it; {65535 - self.workers} at most"
                )
        apart = abs(self.grpc_port - self.http_port)
        if self.grpc_port and self.http_port and apart <= self.workers:
            raise ValueError(
                f"grpc_port {self.grpc_port} and http_port {self.http_port} are {apart} apart; "
                f"{self.workers} workers take as many ports after each: {self.workers + 1} at least"
            )

    @property
    def has_auth(self) -> bool:
        """Whether callers must authenticate."""
        return bool(self.auth.keys_file or self.auth.jwt_keys or self.tls_client_ca)

    @property
    def is_loopback(self) -> bool:
        """Whether only this machine can reach the server."""
        try:
            return ip_address(self.host).is_loopback
        except ValueError:
            return self.host == "localhost"

    @classmethod
    def settings_customise_sources(
        cls,
        settings_cls: type[BaseSettings],
        init_settings: PydanticBaseSettingsSource,
        env_settings: PydanticBaseSettingsSource,
        dotenv_settings: PydanticBaseSettingsSource,
        file_secret_settings: PydanticBaseSettingsSource,
    ) -> tuple[PydanticBaseSettingsSource, ...]:
        """Uses only the given values: sources.py reads the sources."""
        return (init_settings,)
