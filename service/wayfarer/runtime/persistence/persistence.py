"""The journal in the runtime: read at the start, fed while it runs, waited for by callers."""

import asyncio
import math
from collections.abc import Awaitable, Callable, Sequence
from functools import partial
from typing import Final, TypeVar

import structlog

from wayfarer.config.limits import Limits
from wayfarer.errors import ArtifactError, Unavailable, WayfarerError
from wayfarer.runtime.metrics_sink import MetricsSink
from wayfarer.runtime.persistence.crash_loop import CALM_SECONDS, CrashLoopGuard
from wayfarer.runtime.persistence.journal import Journal
from wayfarer.world.agents.faults import Stage
from wayfarer.world.agents.records import SessionRecord
from wayfarer.world.scenes.scene_registry import SceneRecord, SceneRegistry

log = structlog.get_logger(__name__)

T = TypeVar("T")

SAVE_SECONDS: Final = 0.1
SAVE_PARTS: Final = 4
"""Every `SAVE_SECONDS` one agent in `SAVE_PARTS` is copied for the journal: each every 0.4 s."""


class Persistence:
    """Looks after a journal, if there is one."""

    def __init__(
        self, journal: Journal | None, limits: Limits, meter: MetricsSink | None = None
    ) -> None:
        """Reads it. Raises ArtifactError when it holds more than the limits allow."""
        self._journal = journal
        self._meter = meter or MetricsSink()
        self._guard = CrashLoopGuard(None if journal is None else journal.folder)
        self._saving: asyncio.Task[None] | None = None
        self._are_tried = False  # sessions and scenes, before they are resumed
        self._records = journal.restore(limits) if journal is not None else []
        self._scenes = journal.restore_scenes() if journal is not None else []
        for lock_step in (False, True):
            _check_room([r for r in self._records if r.spec.lock_step is lock_step], limits)

    @property
    def failing(self) -> bool:
        """Present changes would not survive the process, though they should."""
        return self._journal is not None and self._journal.failing

    def start(self, save: Callable[[], Awaitable[None]]) -> None:
        """Writes from now on; `save()` lets the motion thread hand over where agents stand."""
        if self._journal is not None:
            self._journal.start()
            self._saving = asyncio.create_task(self._save(save))

    def restore_scenes(self, registry: SceneRegistry) -> None:
        """Let every scene that was read be there again; bakes them, which takes time.

        To be called before `restore`. Scenes that cannot be restored stay in the journal.
        """
        self._are_tried = self._guard.begin()
        for record in self._scenes:
            put = partial(_restore_scene, registry, record)
            if self._are_tried:
                self._guard.passes(record.scene_id, put)
            else:
                put()
        self._scenes = []

    def restore(
        self,
        put: Callable[[SessionRecord], object],
        try_out: Callable[[SessionRecord], object],
    ) -> None:
        """Resumes every session that was read, by `put`; sessions without room stay on disk.

        A session that fails is set aside. When the server keeps ending during its start, `try_out`
        first steps each session in a separate world.
        """
        for record in self._records:
            run = partial(try_out, record)
            if self._are_tried and not self._guard.passes(record.session_id, run):
                self._set_aside(record, "trial")
                continue
            try:
                put(record)
            except WayfarerError as error:
                if self._journal is not None:
                    self._journal.leave(record)
                log.error(
                    "a session of the journal does not fit in here; it is left in the journal",
                    session=record.session_id,
                    why=str(error),
                )
            except Exception as error:
                log.error(
                    "a session of the journal cannot be restored",
                    session=record.session_id,
                    exc_info=error,
                )
                self._meter.fault(Stage.RESTORE)
                self._set_aside(record, "restore")
        if self._records:
            agents = sum(len(record.agents) for record in self._records)
            log.info("the journal was read", sessions=len(self._records), agents=agents)
        self._records = []

    def _set_aside(self, record: SessionRecord, why: str) -> None:
        self._meter.set_aside(why)
        names = [agent.agent_id for agent in record.agents]
        self.set_aside(record.session_id, names, record.spec.scene)

    def set_aside(self, session_id: str, agent_ids: Sequence[str], scene_id: str) -> None:
        """Keeps the journal's entries of a session that is taken out, in a separate folder."""
        if self._journal is not None:
            self._journal.set_aside(session_id, agent_ids, scene_id)

    async def durable(self, result: T) -> T:
        """Hand on what a change returned, once it cannot be lost any more."""
        if self._journal is not None:
            await self._journal.durable()
        return result

    def pause(self) -> None:
        """Asks for no more saves."""
        if self._saving is not None:
            self._saving.cancel()

    async def stop(self, in_good_order: bool) -> None:
        """Writes what waits, and gives the folder back. Not `in_good_order`: the loop failed."""
        if self._journal is not None:
            await asyncio.to_thread(self._journal.stop)
        if in_good_order:
            self._guard.end()

    async def _save(self, save: Callable[[], Awaitable[None]]) -> None:
        """Saves again and again. When that has worked for a while the start has succeeded."""
        failing, loop, began = False, asyncio.get_running_loop(), None
        while True:
            await asyncio.sleep(SAVE_SECONDS)
            try:
                await save()
            except Unavailable:
                continue  # it is warming up, or flooded: the next time will do
            except Exception:
                if not failing:
                    log.exception("where agents stand could not be saved")
                failing = True
                continue
            failing = False
            if began is None:
                began = loop.time()
            elif began + CALM_SECONDS < loop.time():
                self._guard.end()
                began = math.inf


def _restore_scene(registry: SceneRegistry, record: SceneRecord) -> None:
    try:
        registry.restore(record)
    except Exception as error:
        log.error(
            "a scene of the journal cannot be here; it is left in the journal",
            scene=record.scene_id,
            why=str(error),
            exc_info=None if isinstance(error, WayfarerError) else error,
        )


def _check_room(records: list[SessionRecord], limits: Limits) -> None:
    agents = sum(len(record.agents) for record in records)
    if len(records) > limits.sessions or agents > limits.agents:
        raise ArtifactError(
            f"the journal holds {len(records)} sessions with {agents} agents; limits.sessions is "
            f"{limits.sessions} and limits.agents {limits.agents}: raise them, or take another "
            "state_dir"
        )
