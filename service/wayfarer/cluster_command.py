"""`wayfarer cluster`: nodes on Ray with a directory and an entry, or one more entry."""

import asyncio
import contextlib
import os
import secrets
import threading
from collections.abc import AsyncIterator, Callable
from concurrent.futures import Future
from ipaddress import ip_address
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, TypeVar

import structlog
import typer

from wayfarer import config_sources
from wayfarer.assembly import model_folder, with_engine
from wayfarer.cluster.directory import LeaseRules
from wayfarer.cluster.directory_service import DirectoryClient, DirectoryLink
from wayfarer.cluster.entry import Entry
from wayfarer.cluster.messages import NodePlan
from wayfarer.config import PeerTls, Settings
from wayfarer.errors import InvalidArgument, Unavailable
from wayfarer.logs import configure_logging
from wayfarer.processor import cores
from wayfarer.serve import SIGNALS, given_options, run, warn_if_open, with_options
from wayfarer.transport.tls import peer_tls

if TYPE_CHECKING:  # Ray takes seconds to import
    from wayfarer.cluster.ray_actors import RayCluster

log = structlog.get_logger(__name__)

T = TypeVar("T")

SECRET: Final = "WF_CLUSTER_SECRET"
"""Environment variable, without the prefix of settings."""

SECRET_LENGTH: Final = 16
LOOK_S: Final = 2.0
"""Seconds between checks for new machines of Ray, and of its head."""

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
    nodes: Annotated[
        int, typer.Option(min=1, max=64, help="Nodes on this machine; without --address.")
    ] = 3,
    address: Annotated[
        str,
        typer.Option(
            help="Ray cluster, as `auto` or host:6379: a node on each of its machines. "
            "[its own Ray on this machine]"
        ),
    ] = "",
    lease: Annotated[
        float,
        typer.Option(
            min=1, max=60, help="Seconds after which a silent node has lost what it owns."
        ),
    ] = 3.0,
    config: Config = None,
    **options: Any,
) -> None:
    """Start nodes with their directory, and an entry at --host, --http-port and --grpc-port.

    The options below are the nodes' settings, too; their ports are free ones. Without --address
    Ctrl-C ends all; with it the entry only.
    """
    settings = _settings(config, options)
    secret = _secret(bool(address))
    model_folder(settings)
    settings = with_engine(settings)
    from wayfarer.cluster.ray_actors import RayCluster

    ray = RayCluster(secret, address)
    try:
        link = ray.directory(LeaseRules(lease))
        if address:
            run(_enter(settings, link, secret, ray, _covered(ray, settings, secret)))
        else:
            each = {"threads": settings.threads or max(1, cores() // nodes)}
            for number in range(nodes):
                ray.keep(_plan(f"node{number}", number, settings, each, secret))
            run(_enter(settings, link, secret, ray))
    finally:
        ray.close()
    log.info("stopped; the nodes go on" if address else "stopped")


@app.command("entry")
@with_options
def entry_command(
    *,
    address: Annotated[str, typer.Option(help="The cluster's Ray, as `auto` or host:6379.")],
    config: Config = None,
    **options: Any,
) -> None:
    """One more entry of a cluster that runs."""
    settings = _settings(config, options)
    secret = _secret(True)
    from wayfarer.cluster.ray_actors import RayCluster

    ray = RayCluster(secret, address)
    try:
        for host in ray.machines().values():
            _check_links(settings, host)
        run(_enter(settings, ray.find_directory(), secret, ray))
    finally:
        ray.close()
    log.info("stopped; the nodes go on")


async def _enter(
    settings: Settings,
    link: DirectoryLink,
    secret: str,
    ray: "RayCluster",
    beside: contextlib.AbstractAsyncContextManager[None] | None = None,
) -> None:
    """Run an entry until a signal comes."""
    stop = asyncio.Event()
    for sign in SIGNALS:
        asyncio.get_running_loop().add_signal_handler(sign, stop.set)
    warn_if_open(settings)
    entry = Entry(settings, DirectoryClient(link), secret, stop.set)
    await entry.start()
    watching = asyncio.create_task(_watch_head(ray, entry), name="head")
    async with beside or contextlib.nullcontext():
        while not (entry.finder.ready or stop.is_set()):
            await asyncio.sleep(0.1)
        if not stop.is_set():
            log.info("ready", http=entry.http_url, grpc=entry.grpc_address)
        await stop.wait()
        log.info("draining")
    watching.cancel()
    await entry.stop()


async def _watch_head(ray: "RayCluster", entry: Entry) -> None:
    """Run until cancelled: report to the entry whether Ray's head answers."""
    while True:
        answers = await _on_daemon(ray.head_answers)
        if answers == (entry.finder.head is False):  # it was otherwise
            log.warning("Ray's head answers again" if answers else "Ray's head is away")
        entry.finder.head = answers
        await asyncio.sleep(LOOK_S)


@contextlib.asynccontextmanager
async def _covered(ray: "RayCluster", settings: Settings, secret: str) -> AsyncIterator[None]:
    """Keep a node on each of Ray's machines, also on new ones."""
    told = ""  # the last round's error

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
            plan = _plan(f"node-{machine[:12]}", number, settings, {}, secret)
            if not settings.is_loopback:
                plan = plan.model_copy(update={"host": host})
            ray.keep(plan, machine)

    async def look() -> None:
        nonlocal told
        try:
            await _on_daemon(cover)
        except Exception as error:  # also of Ray; later machines get their nodes
            if str(error) != told:
                log.warning("machines without a node", reason=str(error))
            told = str(error)
        else:
            told = ""

    async def covering() -> None:
        while True:
            await asyncio.sleep(LOOK_S)
            await look()

    with contextlib.suppress(Unavailable):  # the next check reports it
        await _on_daemon(cover)
    task = asyncio.create_task(covering(), name="machines")
    try:
        yield
    finally:
        task.cancel()
        await asyncio.wait([task])


async def _on_daemon(work: Callable[[], T]) -> T:
    """Run on a thread whose end the process does not wait for: Ray may never answer it."""
    done = Future[T]()
    done.set_running_or_notify_cancel()  # a call that cannot be stopped must not be cancelled

    def run_it() -> None:
        try:
            done.set_result(work())
        except Exception as error:
            done.set_exception(error)

    threading.Thread(target=run_it, name="machines", daemon=True).start()
    return await asyncio.wrap_future(done)


def _plan(
    name: str, number: int, settings: Settings, more: dict[str, Any], secret: str
) -> NodePlan:
    own = settings.model_copy(update={"http_port": 0, "grpc_port": 0, **more})
    return NodePlan(name=name, number=number, host="", secret=secret, settings=own)


def _check_links(settings: Settings, host: str) -> None:
    """Refuse plain text over a network. Raises InvalidArgument."""
    if not (settings.peer_tls.cert or settings.insecure_peers or ip_address(host).is_loopback):
        raise InvalidArgument(
            f"nodes on {host} would get people and the cluster's secret over the network as plain "
            "text; set peer_tls.cert, peer_tls.key and peer_tls.ca (docs/cluster.md), or, where "
            "something else protects the network between the machines, insecure_peers",
            "peer_tls",
        )


def _encrypt_ray(tls: PeerTls) -> None:
    """Encrypt Ray's links, the directory's too, with the same files; before Ray is imported."""
    if tls.cert:
        os.environ.setdefault("RAY_USE_TLS", "1")
        os.environ.setdefault("RAY_TLS_SERVER_CERT", str(tls.cert))
        os.environ.setdefault("RAY_TLS_SERVER_KEY", str(tls.key))
        os.environ.setdefault("RAY_TLS_CA_CERT", str(tls.ca))


def _settings(config: Path | None, options: dict[str, Any]) -> Settings:
    settings = config_sources.load(given_options(options), config)
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
    _encrypt_ray(settings.peer_tls)
    return settings


def _secret(shared: bool) -> str:
    """The secret that nodes show each other. Raises InvalidArgument if it is missing."""
    given = os.environ.get(SECRET, "")
    if given and len(given) < SECRET_LENGTH:
        raise InvalidArgument(f"{SECRET} has {len(given)} characters; {SECRET_LENGTH} at least")
    if shared and not given:
        raise InvalidArgument(
            f"on a Ray cluster of others, set {SECRET} to a text that only its nodes know, as of "
            "`openssl rand -hex 32`"
        )
    return given or secrets.token_hex(32)
