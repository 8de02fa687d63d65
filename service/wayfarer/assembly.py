"""The runtime of a server, put together from its settings: models, engine, worlds, journal."""

import hashlib
import os
import signal
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Final

from wayfarer.body.library import SMPLX_FOLDER, body_file
from wayfarer.cluster.plans import threads_of
from wayfarer.config.settings import Settings
from wayfarer.engines.choice import open_engine
from wayfarer.engines.model_store import ModelStore
from wayfarer.engines.models import LoadedModels
from wayfarer.models.artifacts import ModelFolder, sha256_of
from wayfarer.models.bundle import DEFAULT_MODEL, START_POSES, load_bodies, load_models
from wayfarer.ownership import Ownership, SingleNode
from wayfarer.process.logs import configure_logging
from wayfarer.process.processor import cores
from wayfarer.runtime.faults import FaultLog
from wayfarer.runtime.metrics_sink import MetricsSink
from wayfarer.runtime.motion_service import MotionService
from wayfarer.runtime.persistence.container import BETWEEN_SERVERS
from wayfarer.runtime.persistence.journal import Journal
from wayfarer.runtime.persistence.snapshot import BodyStamp
from wayfarer.runtime.world_factory import WorldFactory
from wayfarer.spec import GENDERS, STEP_SECONDS
from wayfarer.world.agents.spawn import load_start_poses
from wayfarer.world.goals.steering import Steering
from wayfarer.world.scenes.bake_queue import BakeQueue
from wayfarer.world.stepping.budget import BudgetRules, candidate_counts
from wayfarer.world.stepping.settings import AdmissionRules, WorldSettings
from wayfarer.world.world import World

MEASURES: Final = 2
"""Number of measured calls of each size; agents are admitted by the shortest."""

MEASURE_EVERY: Final = 3
"""Every third batch size is measured, from the largest down; costs between are interpolated."""

COMPILED: Final = "compiled"
"""Folder in `state_dir`."""

LOOKAHEAD: Final = STEP_SECONDS
"""A batch is filled with the next agents, at most a whole step ahead: large batches cost less per
agent, and an agent with a new goal is not stepped alone."""


def model_store(settings: Settings, body: str = "") -> ModelStore:
    """The models that can be loaded by name: those shipped, then those of `models_dir`.

    `body`: the one they must be made for; empty: any.
    """
    shipped = DEFAULT_MODEL.parent
    return ModelStore(
        (shipped,) if settings.models_dir is None else (shipped, settings.models_dir),
        partial(load_models, body=body),
        partial(
            open_engine,
            kind=settings.engine,
            threads=settings.threads,
            candidates=settings.candidates,
        ),
        settings.limits.agents,
        candidate_counts(settings.candidates),
    )


def compiled_folder(settings: Settings) -> Path | None:
    """Where the engine at the start keeps its networks. An engine that is loaded while agents walk
    keeps none: OpenVINO holds Python's lock while it exports a network.
    """
    if settings.state_dir is None or not settings.keep_compiled:
        return None
    return settings.state_dir / COMPILED


def model_folder(settings: Settings) -> ModelFolder:
    """The model to start with. Raises InvalidArgument, NotFound, ArtifactError.

    From now on this process and its children find the user's own bodies.
    """
    if settings.smplx_dir is not None:
        os.environ[SMPLX_FOLDER] = str(settings.smplx_dir)
    name = settings.model
    return load_models(Path(name) if "/" in name else model_store(settings).find(name))


def fingerprint(folder: ModelFolder) -> str:
    """A hash over the model's files, the bodies, and the format of sessions: sessions move only
    between servers with equal hashes.
    """
    files = [*sorted(folder.path.iterdir()), *(body_file(folder.body, g) for g in GENDERS)]
    hashes = "".join(sha256_of(file) for file in files if file.is_file())
    return hashlib.sha256(f"{hashes} {BETWEEN_SERVERS}".encode()).hexdigest()[:16]


def runtime(
    settings: Settings,
    folder: ModelFolder,
    clock: Callable[[], float],
    meter: MetricsSink | None = None,
    ownership: Ownership = SingleNode(),
    ended: Callable[[], None] = lambda: None,
) -> MotionService:
    """The runtime over the models; not yet started. Raises ArtifactError.

    `ended`: see `MotionService`.
    """
    engine = open_engine(
        folder,
        settings.engine,
        settings.threads,
        settings.candidates,
        compiled_folder(settings),
    )
    # models that are loaded later run on the same engine
    settings = settings.model_copy(update={"engine": engine.setting})
    sizes = engine.sizes_for(settings.limits.agents)
    world_settings = WorldSettings(
        limits=settings.limits,
        batch_sizes=sizes,
        batch_lookahead_s=LOOKAHEAD,
        cores=settings.threads or cores(),
        batch_multiple=engine.full,
        steering=Steering().with_search(candidates=settings.candidates),
        budget=BudgetRules(),
        admission=AdmissionRules(settings.most_load, refuse=settings.admission),
        new_group=ownership.new_group,
    )
    body = BodyStamp(
        folder.body, {gender: sha256_of(body_file(folder.body, gender)) for gender in GENDERS}
    )

    def warm_up(world: World) -> None:
        tried = candidate_counts(settings.candidates)
        measured = (tried[0], tried[-1])
        # memory is allocated for the largest batch; larger ones are never asked for
        compiled = [size for size in engine.to_compile if size <= sizes[-1]]
        engine.warm_up((*compiled, sizes[-1]), set(tried) - set(measured))
        spread_out = (*compiled, *sizes[::-MEASURE_EVERY])
        for _ in range(MEASURES):
            engine.warm_up(spread_out, measured, world.load.admission.measured)

    worlds = WorldFactory(
        models=LoadedModels(engine),
        body=body,
        bodies=load_bodies(folder.body),
        start_poses=load_start_poses(START_POSES),
        settings=world_settings,
        journal=Journal(settings.state_dir, body, meter) if settings.state_dir else None,
        bake_queue=BakeQueue(settings.limits),
        report=FaultLog(meter or MetricsSink()),
    )
    return MotionService(
        worlds,
        warm_up,
        clock,
        meter,
        open_model=model_store(settings, folder.body).open,
        may_step=ownership.may_step,
        ended=ended,
    )


def with_engine(settings: Settings) -> Settings:
    """The engine, chosen once for all nodes: a log must replay alike on each of them."""
    if settings.engine != "auto":
        return settings
    # in its own process, whose memory ends with it; a terminal's Ctrl-C is for this one
    ctrl_c = signal.signal(signal.SIGINT, signal.SIG_IGN)
    with ProcessPoolExecutor(1, get_context("spawn")) as apart:
        chosen = apart.submit(_engine_kind, settings.model_dump_json())
        signal.signal(signal.SIGINT, ctrl_c)
        kind = chosen.result()
    return settings.model_copy(update={"engine": kind})


def _engine_kind(settings: str) -> str:
    """The value of `engine` that is faster with a node's threads."""
    read = Settings.model_validate_json(settings)
    configure_logging(read.log_level, read.log_format)
    compiled = compiled_folder(read)
    return open_engine(
        model_folder(read), "auto", threads_of(read), read.candidates, compiled
    ).setting
