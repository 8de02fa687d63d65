"""`wayfarer cluster`: nodes on Ray with a directory and an entry, or one more entry."""

import asyncio
import contextlib
from collections.abc import AsyncIterator
from ipaddress import ip_address
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import structlog
import typer

from wayfarer.assembly import model_folder, with_engine
from wayfarer.cluster.directory import LeaseRules
from wayfarer.cluster.messages import NodePlan
from wayfarer.cluster.ray_environment import encrypt_ray
from wayfarer.commands.serve import NODE, given_options, warn_if_open, with_options
from wayfarer.config import sources
from wayfarer.config.settings import Settings
from wayfarer.errors import InvalidArgument, Unavailable
from wayfarer.process.event_loop import run
from wayfarer.process.logs import configure_logging
from wayfarer.transport.edge.tls import peer_tls

if TYPE_CHECKING:  # Ray takes seconds to import
    from wayfarer.cluster.ray_cluster import RayCluster

log = structlog.get_logger(__name__)

POLL_S: Final = 2.0
"""Seconds between checks for new machines of Ray."""

app = typer.Typer(
    help="Run many servers as one service, on Ray (docs/cluster.md).",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)

Config = Annotated[Path | None, typer.Option(help="TOML file with settings.")]


@app.command("start")
@with_options
def start_command(
    *,
    address: Annotated[str, typer.Option(help="The Ray cluster, as `auto` or host:6379.")],
    lease: Annotated[
        float,
        typer.Option(
            min=1, max=60, help="Seconds after which a silent node has lost what it owns."
        ),
    ] = 3.0,
    node_port: Annotated[
        int,
        typer.Option(
            min=0, max=65534, help="HTTP port of each node, its next one for gRPC; 0: free ones."
        ),
    ] = 0,
    config: Config = None,
    **options: Any,
) -> None:
    """Start a node on each machine of a Ray cluster, their directory, and an entry at --host,
    --http-port and --grpc-port.

    The options below are the nodes' settings, too. Ctrl-C ends the entry only. For several nodes on
    one machine: `wayfarer serve --workers`.
    """
    settings = _settings(config, options)
    model_folder(settings)
    _enter(with_engine(settings), address, lease, node_port)


@app.command("entry")
@with_options
def entry_command(
    *,
    address: Annotated[str, typer.Option(help="The cluster's Ray, as `auto` or host:6379.")],
    config: Config = None,
    **options: Any,
) -> None:
    """One more entry of a cluster that runs."""
    _enter(_settings(config, options), address)


def _enter(
    settings: Settings, address: str, lease: float | None = None, node_port: int = 0
) -> None:
    """Runs an entry; with a `lease`, also the cluster's directory and nodes if it has none yet."""
    warn_if_open(settings)
    from wayfarer.cluster.actors import RayLink
    from wayfarer.cluster.entry_process import enter, on_ray

    def announce(http_url: str, grpc_address: str) -> None:
        log.info("ready", http=http_url, grpc=grpc_address)

    background: contextlib.AbstractAsyncContextManager[None] = contextlib.nullcontext()
    with on_ray(address) as ray:
        if lease is None:
            for host in ray.machines().values():
                _check_links(settings, host)
            link = RayLink.find()
        else:
            link = ray.directory(LeaseRules(lease))
            background = _covered(ray, settings, node_port)
        run(enter(settings, link, ray, background, announce))
    log.info("stopped; the nodes continue")


@contextlib.asynccontextmanager
async def _covered(ray: "RayCluster", settings: Settings, node_port: int) -> AsyncIterator[None]:
    """Keeps a node on each of Ray's machines, also on new ones."""
    from wayfarer.cluster.actors import on_daemon

    reported = ""  # the last round's error
    ports = {"http_port": node_port, "grpc_port": node_port and node_port + 1}

    def cover() -> None:
        machines = sorted(ray.machines().items())
        if not machines:
            raise Unavailable("no machine of Ray has a CPU resource; nodes start on later machines")
        for number, (machine, host) in enumerate(machines):
            if settings.is_loopback and not ip_address(host).is_loopback:
                raise InvalidArgument(
                    f"nodes on {host} cannot be reached at {settings.host}; give --host 0.0.0.0"
                )
            _check_links(settings, host)
            plan = NodePlan(
                name=f"node-{machine[:12]}",
                number=number,
                host="" if settings.is_loopback else host,
                settings=settings.model_copy(update=ports),
            )
            ray.keep(plan, NODE, machine)

    async def covering() -> None:
        nonlocal reported
        while True:
            try:
                await on_daemon(cover)
                reported = ""
            except Exception as error:  # also of Ray; later machines get their nodes
                if str(error) != reported:
                    log.warning("machines without a node", reason=str(error))
                reported = str(error)
            await asyncio.sleep(POLL_S)

    task = asyncio.create_task(covering(), name="machines")
    try:
        yield
    finally:
        task.cancel()
        await asyncio.wait([task])


def _check_links(settings: Settings, host: str) -> None:
    """Refuse plain text over a network. Raises InvalidArgument."""
    if not (settings.peer_tls.cert or settings.insecure_peers or ip_address(host).is_loopback):
        raise InvalidArgument(
            f"nodes on {host} would get people over the network as plain "
            "text; set peer_tls.cert, peer_tls.key and peer_tls.ca (docs/cluster-operations.md), "
            "or, where something else protects the network between them, insecure_peers",
            "peer_tls",
        )


def _settings(config: Path | None, options: dict[str, Any]) -> Settings:
    settings = sources.load(given_options(options), config)
    configure_logging(settings.log_level, settings.log_format)
    if settings.workers > 1:
        raise InvalidArgument(
            f"workers is {settings.workers}; a cluster has none: each node is a process",
            "workers",
        )
    if settings.state_dir:
        raise InvalidArgument(
            f"state_dir is {settings.state_dir}; a cluster has none: its nodes copy each other",
            "state_dir",
        )
    peer_tls(settings.peer_tls)  # checked before anything is started
    encrypt_ray(settings.peer_tls)
    return settings
