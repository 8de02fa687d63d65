"""The composition root of the service: settings → models → motion loop → gRPC and HTTP.

One process: an asyncio event loop for both transports, a thread for the motion loop.
"""

import asyncio
import signal
import sys
from pathlib import Path
from typing import Annotated, Any

import structlog
import typer
from rich.console import Console

from wayfarer import __version__, config
from wayfarer.artifacts import ModelFolder, sha256_of
from wayfarer.body.library import load_body
from wayfarer.config import Settings
from wayfarer.logs import configure_logging
from wayfarer.runtime.budget import BudgetRules, rungs
from wayfarer.runtime.loop import MotionLoop, steady_clock
from wayfarer.runtime.onnx_engine import OnnxEngine
from wayfarer.runtime.settings import Limits, WorldSettings
from wayfarer.runtime.spawn import load_start_poses
from wayfarer.runtime.steering import Steering
from wayfarer.runtime.world import World
from wayfarer.spec import GENDERS, PRIMITIVE_FRAMES, SEED_FRAMES
from wayfarer.stage import BODY, DEFAULT_MODEL, START_POSES, load_models
from wayfarer.transport import schema
from wayfarer.transport.bodies import BodyLibrary
from wayfarer.transport.gateway import Gateway
from wayfarer.transport.server import Server

log = structlog.get_logger(__name__)


async def serve(settings: Settings) -> None:
    """Run until SIGINT or SIGTERM."""
    stop = asyncio.Event()
    loop = asyncio.get_running_loop()
    for sign in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(sign, stop.set)
    if not settings.is_loopback:
        log.warning("reachable from other machines without authentication", host=settings.host)

    clock = steady_clock()
    folder = load_models(model_folder(settings.model))
    motion = motion_loop(settings, folder, clock)
    gateway = Gateway(motion, BodyLibrary(BODY), [model_card(folder)], settings.limits, clock)
    server = Server(gateway, settings.host, settings.http_port, settings.grpc_port)
    motion.start()
    try:
        await server.start()
        await server.until_ready()
        announce(server, folder)
        await stop.wait()
        for sign in (signal.SIGINT, signal.SIGTERM):
            loop.remove_signal_handler(sign)  # a second one ends the process at once
        log.info("stopping")
        await server.stop()
    finally:
        await motion.stop()
    log.info("stopped")


def model_folder(name: str) -> Path:
    """Where a shipped model lies, or the folder that a path names."""
    return Path(name) if "/" in name else DEFAULT_MODEL.parent / name


def motion_loop(settings: Settings, folder: ModelFolder, clock: Any) -> MotionLoop:
    """The runtime over the models; not yet started."""
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
    )
    engine = OnnxEngine(folder, settings.threads)
    bodies = {gender: load_body(BODY, gender, "low") for gender in GENDERS}
    world = World(engine, bodies, load_start_poses(START_POSES), world_settings)
    candidates = rungs(settings.candidates)
    sizes = [size for size in world_settings.batch_sizes if size <= limits.agents]
    return MotionLoop(world, lambda: engine.warm_up(sizes, candidates), clock=clock)


def model_card(folder: ModelFolder) -> schema.Model:
    """The catalogue entry of a model folder."""
    return schema.Model(
        name=folder.name,
        genders=tuple(schema.Gender(gender) for gender in GENDERS),
        seed_frames=SEED_FRAMES,
        primitive_frames=PRIMITIVE_FRAMES,
        sha256=tuple(sha256_of(folder.graph("step", gender, SEED_FRAMES)) for gender in GENDERS),
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
        str | None, typer.Option(help="A shipped model's name, or a folder. [default]")
    ] = None,
    threads: Annotated[
        int | None, typer.Option(help="Threads of the engine; 0: all cores. [0]")
    ] = None,
    candidates: Annotated[
        int | None, typer.Option(help="Candidate primitives tried per step. [16]")
    ] = None,
    log_level: Annotated[
        str | None, typer.Option(help="debug, info, warning, error. [info]")
    ] = None,
    log_format: Annotated[str | None, typer.Option(help="auto, text, json. [auto]")] = None,
    file: Annotated[
        Path | None, typer.Option("--config", help="TOML file with any of the settings.")
    ] = None,
) -> None:
    """Start the service: gRPC and HTTP. All settings: docs/api.md."""
    given = dict(locals())
    file = given.pop("file")
    settings = config.load({k: v for k, v in given.items() if v is not None}, file)
    configure_logging(settings.log_level, settings.log_format)
    try:
        import uvloop
    except ImportError:  # Windows has none
        factory = None
    else:
        factory = uvloop.new_event_loop
    with asyncio.Runner(loop_factory=factory) as runner:
        runner.run(serve(settings))
