"""The composition root of the service: settings → models → motion loop → gRPC and HTTP.

One process: an asyncio event loop for both transports, a thread for the motion loop.
"""

import asyncio
import signal
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Final

import structlog
import typer
from rich.console import Console

from wayfarer import __version__, config
from wayfarer.artifacts import ModelFolder, sha256_of
from wayfarer.body.library import body_file, load_body
from wayfarer.config import Settings
from wayfarer.config_page import as_toml
from wayfarer.logs import configure_logging
from wayfarer.runtime.engines.model_store import ModelStore
from wayfarer.runtime.engines.models import Models
from wayfarer.runtime.engines.onnx_engine import OnnxEngine
from wayfarer.runtime.loop import LoopSettings, steady_clock
from wayfarer.runtime.meter import Meter
from wayfarer.runtime.runtime import Runtime
from wayfarer.runtime.settings import BATCH_SIZES, AdmissionRules, Limits, WorldSettings
from wayfarer.runtime.state.journal import Journal
from wayfarer.runtime.state.snapshot import BodyStamp
from wayfarer.runtime.stepping.budget import BudgetRules, rungs
from wayfarer.runtime.world.spawn import load_start_poses
from wayfarer.runtime.world.steering import Steering
from wayfarer.runtime.world.world import World
from wayfarer.runtime.worlds import Worlds
from wayfarer.spec import GENDERS
from wayfarer.stage import BODY, DEFAULT_MODEL, START_POSES, load_models
from wayfarer.transport.bodies import BodyLibrary
from wayfarer.transport.gateway import Gateway
from wayfarer.transport.operation import Operation
from wayfarer.transport.server import Server

log = structlog.get_logger(__name__)

MEASURES: Final = 3
"""Calls of each size that are measured once all is warm; agents are admitted by the shortest."""

SIGNALS: Final = (signal.SIGINT, signal.SIGTERM)


async def serve(settings: Settings) -> None:
    """Run until SIGINT, SIGTERM or AdminService.Drain."""
    stop = asyncio.Event()
    loop = asyncio.get_running_loop()
    for sign in SIGNALS:
        loop.add_signal_handler(sign, stop.set)
    if not (settings.is_loopback or settings.has_auth):
        log.warning("reachable from other machines without authentication", host=settings.host)

    clock = steady_clock()
    operation = Operation.from_settings(settings)
    if hasattr(signal, "SIGHUP"):
        loop.add_signal_handler(signal.SIGHUP, operation.guard.authenticator.reload)
    folder = model_folder(settings)
    motion = runtime(settings, folder, clock, operation.metrics)
    gateway = Gateway(motion, BodyLibrary(BODY), settings.limits, clock, stop.set)
    server = Server(gateway, settings.host, settings.http_port, settings.grpc_port, operation)
    motion.start()
    try:
        await server.start()
        await server.until_ready()
        announce(server, folder)
        await stop.wait()
        for sign in SIGNALS:
            loop.remove_signal_handler(sign)  # one more ends the process at once
        log.info("draining", streams=gateway.streams)
        await server.stop()
    finally:
        await motion.stop()
    log.info("stopped")


def model_store(settings: Settings) -> ModelStore:
    """The models that can be loaded by name: those shipped, then those of `models_dir`."""
    shipped = DEFAULT_MODEL.parent
    return ModelStore(
        (shipped,) if settings.models_dir is None else (shipped, settings.models_dir),
        load_models,
        settings.threads,
        [size for size in BATCH_SIZES if size <= settings.limits.agents],
        rungs(settings.candidates),
    )


def model_folder(settings: Settings) -> ModelFolder:
    """The model to start with. Raises InvalidArgument, NotFound, ArtifactError."""
    name = settings.model
    return load_models(Path(name) if "/" in name else model_store(settings).find(name))


def runtime(
    settings: Settings, folder: ModelFolder, clock: Callable[[], float], meter: Meter | None = None
) -> Runtime:
    """The runtime over the models; not yet started. Raises ArtifactError."""
    limits = Limits(
        agents=settings.limits.agents,
        agents_per_session=settings.limits.agents_per_session,
        sessions=settings.limits.sessions,
        goal_distance=settings.limits.goal_distance_m,
        path_goals=settings.limits.path_goals,
    )
    world_settings = WorldSettings(
        limits=limits,
        steering=Steering().with_search(candidates=settings.candidates),
        budget=BudgetRules(),
        admission=AdmissionRules(settings.most_load, refuse=settings.admission),
    )
    body = BodyStamp(BODY, {gender: sha256_of(body_file(BODY, gender)) for gender in GENDERS})
    engine = OnnxEngine(folder, settings.threads)
    sizes = [size for size in world_settings.batch_sizes if size <= limits.agents]

    def warm_up(world: World) -> None:
        engine.warm_up(sizes, rungs(settings.candidates))
        for _ in range(MEASURES):
            engine.warm_up(sizes, (1, settings.candidates), world.measured)

    worlds = Worlds(
        models=Models(engine),
        body=body,
        bodies={gender: load_body(BODY, gender, "low") for gender in GENDERS},
        start_poses=load_start_poses(START_POSES),
        settings=world_settings,
        journal=Journal(settings.state_dir, body, meter) if settings.state_dir else None,
        log_entries=settings.limits.log_entries,
    )
    queues = LoopSettings(
        queue_s=settings.limits.queue_s,
        resume_s=settings.limits.resume_s,
        lead_s=settings.limits.lead_s,
    )
    store = model_store(settings)
    return Runtime(
        worlds, settings.limits.clips, warm_up, queues, clock, meter, open_model=store.open
    )


def announce(server: Server, folder: ModelFolder) -> None:
    """Say where the service is: to a person on a terminal, else to the log."""
    if not sys.stdout.isatty():
        log.info("ready", http=server.http_url, grpc=server.grpc_address, model=folder.name)
        return
    console = Console(highlight=False)
    console.print(f"[bold]Wayfarer {__version__}[/bold] is ready (model {folder.name})")
    console.print(f"  viewer  [link={server.http_url}]{server.http_url}/[/link]")
    console.print(f"  HTTP    {server.http_url}/docs")
    console.print(f"  gRPC    {server.grpc_address}")
    console.print("Ctrl-C stops it.")


def serve_command(
    host: Annotated[
        str | None,
        typer.Option(help="Address to listen on; 0.0.0.0 lets other machines in. [127.0.0.1]"),
    ] = None,
    http_port: Annotated[int | None, typer.Option(help="HTTP; 0: any free port. [8080]")] = None,
    grpc_port: Annotated[int | None, typer.Option(help="gRPC; 0: any free port. [50051]")] = None,
    model: Annotated[
        str | None, typer.Option(help="A shipped model's name, or a folder. [gamma-anny52]")
    ] = None,
    threads: Annotated[
        int | None, typer.Option(help="Threads of the engine; 0: all cores. [0]")
    ] = None,
    candidates: Annotated[
        int | None, typer.Option(help="Candidate primitives tried per step. [4]")
    ] = None,
    state_dir: Annotated[
        Path | None, typer.Option(help="Folder in which sessions outlive a crash. [none]")
    ] = None,
    models_dir: Annotated[
        Path | None, typer.Option(help="Folder of models that may be loaded while it runs. [none]")
    ] = None,
    keys_file: Annotated[
        Path | None, typer.Option(help="TOML file of API keys; `wayfarer keys new` makes entries.")
    ] = None,
    insecure_no_auth: Annotated[
        bool | None,
        typer.Option("--insecure-no-auth", help="Ask nobody who they are, beyond loopback too."),
    ] = None,
    tls_cert: Annotated[
        Path | None, typer.Option(help="PEM file of the certificate chain: both ports speak TLS.")
    ] = None,
    tls_key: Annotated[Path | None, typer.Option(help="PEM file of its private key.")] = None,
    tls_client_ca: Annotated[
        Path | None, typer.Option(help="PEM file of the authority of client certificates.")
    ] = None,
    log_level: Annotated[
        str | None, typer.Option(help="debug, info, warning, error. [info]")
    ] = None,
    log_format: Annotated[str | None, typer.Option(help="auto, text, json. [auto]")] = None,
    file: Annotated[
        Path | None, typer.Option("--config", help="TOML file with any of the settings.")
    ] = None,
    check_config: Annotated[
        bool,
        typer.Option(
            "--check-config",
            help="Print the settings and where each comes from, check their files, and end.",
        ),
    ] = False,
) -> None:
    """Start the service: gRPC and HTTP. All settings: docs/operations.md."""
    given = {k: v for k, v in locals().items() if v is not None}
    file, check_config = given.pop("file", None), given.pop("check_config")
    if "keys_file" in given:
        given["auth"] = {"keys_file": given.pop("keys_file")}
    settings = config.load(given, file)
    configure_logging(settings.log_level, settings.log_format)
    if check_config:
        typer.echo(as_toml(settings, config.origins(given, file)))
        Operation.from_settings(settings)
        model_folder(settings)
        return
    try:
        import uvloop
    except ImportError:  # Windows has none
        factory = None
    else:
        factory = uvloop.new_event_loop
    with asyncio.Runner(loop_factory=factory) as runner:
        runner.run(serve(settings))
