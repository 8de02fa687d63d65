"""Sessions that cannot be restored, or end the server as it starts: the others start."""

import asyncio
import json
import sqlite3
import zlib
from contextlib import closing
from dataclasses import replace

import pytest

from tests.runtime.kept_worlds import STICK, fake_worlds
from tests.runtime.running import until
from tests.world.fakes import people
from tests.world.scenes.grounds import FIELD
from wayfarer.errors import InvalidArgument
from wayfarer.navigation.scene_spec import SceneSpec
from wayfarer.runtime.faults import FaultLog
from wayfarer.runtime.motion_service import MotionService
from wayfarer.runtime.persistence.crash_loop import NAME as STARTS
from wayfarer.runtime.persistence.crash_loop import STARTS as EARLY
from wayfarer.runtime.persistence.crash_loop import CrashLoopGuard
from wayfarer.runtime.persistence.journal import Journal
from wayfarer.runtime.persistence.journal_file import NAME, EntryKind
from wayfarer.transport.edge.metrics import Metrics
from wayfarer.world.agents.agent import SessionSpec
from wayfarer.world.agents.population import Population
from wayfarer.world.scenes.messages import SceneSource
from wayfarer.world.scenes.scene_registry import SceneRegistry
from wayfarer.world.stepping.scheduler import Scheduler


class Server:
    """A service with a state folder, started again and again."""

    def __init__(self, folder):
        self.folder = folder / "state"
        self.metrics = Metrics()
        self.ended = 0  # loops, since the last start

    async def __aenter__(self):
        self.ended = 0
        journal = Journal(self.folder, STICK, self.metrics)
        worlds = replace(fake_worlds(journal), report=FaultLog(self.metrics))
        self.service = MotionService(worlds, meter=self.metrics, ended=self._end)
        self.service.start()
        await until(lambda: self.service.ready or self.ended, 20)
        return self.service

    async def __aexit__(self, *_):
        await self.service.stop()

    def _end(self):
        self.ended += 1

    def set_aside(self, why):
        return self.metrics.registry.get_sample_value("wayfarer_set_aside_total", {"why": why})

    def folders(self):
        aside = self.folder / "set-aside"
        return sorted(aside.iterdir()) if aside.exists() else []


@pytest.fixture
async def server(tmp_path):
    """With the sessions `a`, `b` and `c` of two agents each on its disk; `b` is in a scene."""
    made = Server(tmp_path)
    async with made as service:
        scene = await service.scenes.create(SceneSource(SceneSpec((FIELD,))))
        for name in "abc":
            spec = SessionSpec(name, scene=scene.scene_id if name == "b" else "")
            await service.create_session(spec)
            specs = [replace(one, position=(2.0 + n, 2.0)) for n, one in enumerate(people(2))]
            await service.create_agents(name, specs)
    return made


async def names(service):
    return [session.session_id for session in await service.list_sessions()]


def failing_for(monkeypatch, owner, method, name, error=RuntimeError):
    real = getattr(owner, method)

    def wrapped(self, session, *rest):
        if session.session_id == name:
            raise error("injected")
        return real(self, session, *rest)

    monkeypatch.setattr(owner, method, wrapped)


async def test_a_session_whose_restoring_fails_is_moved_to_a_folder_of_its_own(server, monkeypatch):
    failing_for(monkeypatch, Population, "put", "b")
    async with server as service:
        assert await names(service) == ["a", "c"]
        assert not service._world.registry.session("a").frozen
        assert len(service._world.registry.by_slot) == 4, "nothing of it is left in the world"
        assert int(service._world.slots.active.sum()) == 4
        assert server.set_aside("restore") == 1
        for scene in service.scenes.registry.infos():
            await service.scenes.change(SceneRegistry.delete, scene.scene_id)  # it is in none
    [folder] = server.folders()
    assert folder.name.startswith("b-")
    monkeypatch.undo()
    async with server as service:
        assert await names(service) == ["a", "c"], "nor does it come again"
    alone = Server(folder.parent)
    alone.folder = folder
    async with alone as service:  # its scene is there, too
        assert await names(service) == ["b"]
        assert len(await service.list_agents("b")) == 2
        assert (await service.get_session("b")).spec.scene


async def test_a_session_that_does_not_fit_stays_where_it_is(server, monkeypatch):
    failing_for(monkeypatch, Population, "put", "b", InvalidArgument)
    async with server as service:
        assert await names(service) == ["a", "c"]
    monkeypatch.undo()
    assert not server.folders()
    async with server as service:
        assert await names(service) == ["a", "b", "c"]


async def test_an_unsound_session_is_set_aside_with_its_agents(server):
    with closing(sqlite3.connect(server.folder / NAME)) as file, file:
        body = b'{"nonsense": true}'
        file.execute(
            "UPDATE entries SET body = ?, crc = ? WHERE kind = ? AND id = 'c'",
            (body, zlib.crc32(body), int(EntryKind.SESSION)),
        )
    async with server as service:
        assert await names(service) == ["a", "b"]
        assert server.set_aside("unsound") == 1
    [folder] = server.folders()
    with closing(sqlite3.connect(folder / NAME)) as file:
        kinds = [kind for (kind,) in file.execute("SELECT kind FROM entries ORDER BY kind")]
    assert kinds.count(EntryKind.AGENT) == 2 and kinds.count(EntryKind.SESSION) == 1
    with closing(sqlite3.connect(server.folder / NAME)) as file:
        assert file.execute("SELECT count(*) FROM entries WHERE id = 'c'").fetchone() == (0,)


async def test_a_scene_whose_restoring_fails_keeps_no_others_away(server, monkeypatch):
    def fail(*_, **__):
        raise RuntimeError("injected")

    monkeypatch.setattr(SceneRegistry, "restore", fail)
    async with server as service:
        assert await names(service) == ["a", "c"]
    monkeypatch.undo()
    async with server as service:  # the session waits for it in the journal
        assert await names(service) == ["a", "b", "c"]


async def test_an_import_that_fails_leaves_nothing_behind(server, monkeypatch):
    async with server as service:
        snapshot = await service.export_session("a")
        await service.delete_session("a")
        failing_for(monkeypatch, Population, "put", "a")
        with pytest.raises(RuntimeError, match="injected"):
            await service.import_session(snapshot)
        assert await names(service) == ["b", "c"] and service.ready
        monkeypatch.undo()
        assert (await service.import_session(snapshot)).session_id == "a"
        assert int(service._world.slots.active.sum()) == 6


async def test_a_session_that_ends_the_loop_at_every_start_is_found(server, monkeypatch):
    """By an error without a known culprit: here the schedule of all fails."""
    real = Scheduler.begin

    def begin(self, *args):
        if any(a.session_id == "b" for a in self._faults._registry.agents.values()):
            raise RuntimeError("injected")
        return real(self, *args)

    monkeypatch.setattr(Scheduler, "begin", begin)
    for _ in range(EARLY):
        async with server:
            await until(lambda: server.ended, 20)
        assert not server.folders()
    async with server as service:
        assert await names(service) == ["a", "c"]
        await asyncio.sleep(0.5)
        assert service.ready and not server.ended
        assert server.set_aside("trial") == 1
    assert [folder.name[:2] for folder in server.folders()] == ["b-"]
    assert not (server.folder / STARTS).exists(), "it stopped in good order"


def test_a_session_during_whose_trials_the_process_ends_is_set_aside(tmp_path):
    class Killed(BaseException):
        """The end of the process."""

    def die():
        raise Killed

    for _ in range(EARLY):
        assert not CrashLoopGuard(tmp_path).begin()
    for _ in range(2):
        trial = CrashLoopGuard(tmp_path)
        assert trial.begin() and trial.passes("a", lambda: None)
        kept = (tmp_path / STARTS).read_text()
        try:
            trial.passes("b", lambda: (kept_ends(tmp_path), die()))
        except Killed:  # a real end runs no `finally`
            (tmp_path / STARTS).write_text(ends_of[-1])
        assert json.loads(kept)["ended"].get("a") is None
    trial = CrashLoopGuard(tmp_path)
    assert trial.begin() and trial.passes("a", lambda: None)
    assert not trial.passes("b", die), "it is not even tried"
    trial.end()
    assert not CrashLoopGuard(tmp_path).begin()


ends_of = []


def kept_ends(folder):
    ends_of.append((folder / STARTS).read_text())


def test_a_count_that_cannot_be_read_is_begun_again(tmp_path):
    (tmp_path / STARTS).write_text("{")
    assert not CrashLoopGuard(tmp_path).begin()
    assert json.loads((tmp_path / STARTS).read_text())["starts"] == 1


def test_without_a_folder_nothing_is_counted():
    assert not CrashLoopGuard(None).begin()
    CrashLoopGuard(None).end()


async def test_a_scene_that_ends_the_process_as_it_is_restored_is_left_out(server):
    """With its session. The next start tries both again."""
    async with server as service:
        [scene] = service.scenes.registry.infos()
    kept = {"starts": EARLY, "ended": {scene.scene_id: 2}}
    (server.folder / STARTS).write_text(json.dumps(kept))
    async with server as service:
        assert await names(service) == ["a", "c"] and not server.folders()
    async with server as service:
        assert await names(service) == ["a", "b", "c"]
