"""The composition root of the service: settings → models → motion loop → gRPC and HTTP.

One process: an asyncio event loop for both transports, a thread for the motion loop.
"""

import asyncio
import ctypes
import gc
import inspect
import os
import signal
import sys
import threading
import webbrowser
from collections.abc import Callable
from contextlib import AbstractAsyncContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import structlog
import typer
from rich.console import Console

from wayfarer import __version__
from wayfarer.assembly import fingerprint, model_folder, runtime, with_engine
from wayfarer.cluster.node_agent import lease_of
from wayfarer.cluster.plans import check_state, node_plans
from wayfarer.cluster.ray_environment import encrypt_ray, guard_own_ray
from wayfarer.config import sources
from wayfarer.config.page import as_toml
from wayfarer.config.settings import Settings
from wayfarer.errors import Unavailable
from wayfarer.ownership import Ownership, SingleNode
from wayfarer.process.event_loop import run
from wayfarer.process.logs import configure_logging
from wayfarer.process.processor import cores
from wayfarer.runtime.live import steady_clock
from wayfarer.transport.conversion.bodies import BodyLibrary
from wayfarer.transport.gateway import Gateway
from wayfarer.transport.server import Server
from wayfarer.transport.server_options import ServerOptions

if TYPE_CHECKING:  # Ray takes seconds to import
    from wayfarer.cluster.actors import NodeActor

log = structlog.get_logger(__name__)

SWITCH_SECONDS: Final = 2e-4
"""GIL switch interval, seconds: longest wait for the GIL of a thread that returns from the engine.
A call passes through three threads; with the usual 5 ms, handing over would take longer than
computing."""

M_ARENA_MAX, M_TRIM_THRESHOLD, M_MMAP_THRESHOLD = -8, -1, -3
"""Constants of glibc's malloc.h."""

KEPT_FREE: Final = 16 << 20
"""Bytes of freed memory that each heap keeps."""

LARGE: Final = 1 << 20
"""Bytes from which an array lies outside the heaps, and its memory is free when it is."""

SIGNALS: Final = (signal.SIGINT, signal.SIGTERM)

NODE: Final = "wayfarer.commands.serve:serve_node"

OPTIONS: Final = (
    *("host", "http_port", "grpc_port", "root_path", "model", "engine", "threads", "workers"),
    "pin_workers",
    *("candidates", "state_dir", "models_dir", "auth.keys_file", "insecure_no_auth", "tls_cert"),
    *("tls_key", "tls_client_ca", "log_level", "log_format"),
)
"""Settings that are also options of the command line."""


async def serve(
    settings: Settings, node: "NodeActor | None" = None, shows_page: bool = False
) -> None:
    """Runs until SIGINT, SIGTERM or AdminService.Drain.

    As a `node` of several, or as the whole server. Raises Unavailable when the motion loop has
    failed for good, so that a supervisor restarts the process.
    """
    sys.setswitchinterval(SWITCH_SECONDS)
    share_heaps()
    stop, failed = asyncio.Event(), asyncio.Event()
    loop = asyncio.get_running_loop()
    clock = steady_clock()
    operation = ServerOptions.from_settings(settings)
    reload = operation.guard.authenticator.reload
    if node:
        node.listen(stop.set, reload)
    else:
        for sign in SIGNALS:
            loop.add_signal_handler(sign, stop.set)
        if hasattr(signal, "SIGHUP"):
            loop.add_signal_handler(signal.SIGHUP, reload)
        warn_if_open(settings)
    folder = model_folder(settings)
    lease = lease_of(node.plan, fingerprint(folder)) if node else None
    ownership: Ownership = lease or SingleNode()

    def ended() -> None:
        for event in (failed, stop):
            loop.call_soon_threadsafe(event.set)

    motion = runtime(settings, folder, clock, operation.metrics, ownership, ended)
    gateway = Gateway(motion, BodyLibrary(folder.body), settings.limits, clock, stop.set, ownership)
    server = Server(gateway, settings.host, settings.http_port, settings.grpc_port, operation)
    motion.start()
    try:
        await server.start()
        background: AbstractAsyncContextManager[None] = nullcontext()
        if node and lease:
            background = node.joined(lease, gateway, server.ports, stop.set)
        async with background:
            if shows_page:  # the page says that the server is starting, and continues by itself
                open_page(server.http_url)
            await server.until_ready()
            settle()
            if node:
                log.info("node ready", http=server.http_url, grpc=server.grpc_address)
                node.ready()
            else:
                announce(settings, server.http_url, server.grpc_address)
            await stop.wait()
            if node is None:
                for sign in SIGNALS:
                    loop.remove_signal_handler(sign)  # one more ends the process at once
            log.info("draining", streams=gateway.streams)
            await server.stop()
    finally:
        await motion.stop()
    if failed.is_set():
        raise Unavailable("the motion loop has failed, and the server ends; its log tells why")
    log.info("stopped")


def serve_node(node: "NodeActor") -> None:
    """Runs as one node of a cluster."""
    run(serve(node.plan.settings, node))


def warn_if_open(settings: Settings) -> None:
    """Warns when other machines may call without authentication."""
    if not (settings.is_loopback or settings.has_auth):
        log.warning("reachable from other machines without authentication", host=settings.host)


def share_heaps() -> None:
    """Lets threads share one heap per core, and sets limits that the start's arrays have raised.

    glibc makes up to eight heaps: 45 MB more with OpenVINO on two cores.
    """
    if any(name.startswith("MALLOC_") for name in os.environ):
        return  # the environment sets it
    if sys.platform == "linux" and hasattr(libc := ctypes.CDLL(None), "mallopt"):
        libc.mallopt(M_ARENA_MAX, cores())
        libc.mallopt(M_TRIM_THRESHOLD, KEPT_FREE)
        libc.mallopt(M_MMAP_THRESHOLD, LARGE)


def settle() -> None:
    """Excludes everything loaded so far from garbage collection, and frees what is garbage now.

    It lives as long as the process, and each pass over it stops all threads for 0.1 s.
    """
    gc.collect()
    gc.freeze()
    if sys.platform == "linux" and hasattr(libc := ctypes.CDLL(None), "malloc_trim"):  # 20 MB
        libc.malloc_trim(0)


def announce(settings: Settings, http_url: str, grpc_address: str) -> None:
    """Reports the addresses of the service, to a person on a terminal or to the log."""
    model = Path(settings.model).name
    if not sys.stdout.isatty():
        log.info("ready", http=http_url, grpc=grpc_address, model=model, workers=settings.workers)
        return
    console = Console(highlight=False)
    console.print(f"[bold]Wayfarer {__version__}[/bold] is ready (model {model})")
    console.print(f"  viewer  [link={http_url}]{http_url}/[/link]")
    console.print(f"  HTTP    {http_url}/docs")
    console.print(f"  gRPC    {grpc_address}")
    if settings.workers > 1:
        console.print(f"  workers {settings.workers}, on their own ports")
    console.print("Ctrl-C stops it.")


def open_page(http_url: str) -> None:
    """Opens the viewer in the user's browser; logs it if there is none."""

    def show() -> None:
        if not webbrowser.open(page):
            log.warning("there is no browser to open; open the page by hand", page=page)

    page = f"{http_url}/"
    # in a thread: a browser in a terminal returns when it is closed
    threading.Thread(target=show, daemon=True).start()


def with_options(command: Callable[..., None]) -> Callable[..., None]:
    """Gives a command the settings of `OPTIONS` as options; their help is the settings' own."""
    own = inspect.signature(command)
    options = []
    for key in OPTIONS:
        field, name = sources.fields()[key], key.rpartition(".")[2]
        default = "none" if field.default is None else field.default
        is_flag = field.annotation is bool
        text = str(field.description)
        help_text = f"{text[0].upper()}{text[1:]}." + ("" if is_flag else f" [{default}]")
        # a literal is checked with all other settings, so that one error names every wrong one
        kind: Any = field.annotation if field.annotation in (bool, int) else str
        kind = Path if "Path" in str(field.annotation) else kind
        flags = [f"--{name.replace('_', '-')}"] if is_flag else []
        annotation = Annotated[kind | None, typer.Option(*flags, help=help_text)]
        keyword = inspect.Parameter.KEYWORD_ONLY
        options.append(inspect.Parameter(name, keyword, default=None, annotation=annotation))
    named = [one for one in own.parameters.values() if one.kind is one.KEYWORD_ONLY]
    command.__signature__ = own.replace(parameters=[*options, *named])  # type: ignore[attr-defined]
    return command


def given_options(options: dict[str, Any]) -> dict[str, Any]:
    """The settings given as options."""
    given = {name: value for name, value in options.items() if value is not None}
    if "keys_file" in given:
        given["auth"] = {"keys_file": given.pop("keys_file")}
    return given


@with_options
def serve_command(
    *,
    config: Annotated[Path | None, typer.Option(help="TOML file with settings.")] = None,
    check_config: Annotated[
        bool,
        typer.Option(
            "--check-config",
            help="Print all settings with their sources, check their files, and exit.",
        ),
    ] = False,
    shows_page: Annotated[
        bool, typer.Option("--open", help="Open the viewer in a browser.")
    ] = False,
    **options: Any,
) -> None:
    """Start the server: gRPC, HTTP and the viewer.

    Each option is a setting. docs/operations.md lists all settings; those without an option here go
    into the file or the environment. Ctrl-C drains and ends the server.
    """
    file, given = config, given_options(options)
    settings = sources.load(given, file)
    configure_logging(settings.log_level, settings.log_format)
    if check_config:
        typer.echo(as_toml(settings, sources.origins(given, file)))
        ServerOptions.from_settings(settings)
        model_folder(settings)
        check_state(settings)
        return
    check_state(settings)
    if settings.workers == 1:
        run(serve(settings, shows_page=shows_page))
        return
    model_folder(settings)
    warn_if_open(settings)
    settings = with_engine(settings)
    plans = node_plans(settings)
    guard_own_ray()
    encrypt_ray(settings.peer_tls)
    from wayfarer.cluster.entry_process import on_ray, run_workers

    def ready(http_url: str, grpc_address: str) -> None:
        announce(settings, http_url, grpc_address)
        if shows_page:
            open_page(http_url)

    with on_ray() as ray:
        run(run_workers(ray, settings, plans, NODE, ready))
    log.info("stopped")
