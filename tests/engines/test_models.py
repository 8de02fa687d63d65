"""Several models: the agents that each moves, and loading and unloading while others serve."""

import asyncio
import gc
import threading
from itertools import pairwise

import pytest

from tests.world.fakes import BODIES, FakeEngine, people, start_poses, taken
from wayfarer.engines.model_store import ModelLoader
from wayfarer.engines.models import MOST, LoadedModels
from wayfarer.errors import (
    AlreadyExists,
    ArtifactError,
    FailedPrecondition,
    NotFound,
    ResourceExhausted,
)
from wayfarer.world.agents.agent import SessionSpec
from wayfarer.world.agents.goal import Goal
from wayfarer.world.world import World


def named(name: str) -> FakeEngine:
    engine = FakeEngine()
    engine.name, engine.graphs = name, (f"{name} male", f"{name} female")
    return engine


@pytest.fixture
def old():
    return named("old")


@pytest.fixture
def new():
    return named("new")


@pytest.fixture
def models(old, new):
    models = LoadedModels(old)
    models.add(new)
    return models


def make_world(models: LoadedModels, count: int = 0) -> World:
    world = World(models, BODIES, start_poses())
    world.create_session(SessionSpec("s"), 0.0)
    world.create_agents("s", people(count), 0.0)
    return world


def moved_by(world: World) -> list[str]:
    return [agent.model for agent in world.list_agents("s")]


def rows(engine: FakeEngine) -> int:
    return sum(call[1] for call in engine.calls)


def test_agents_from_elsewhere_are_moved_by_the_model_that_moved_them_there(models, new):
    world = make_world(models, 2)
    models.use("new")
    world.create_agents("s", people(1), 0.0)
    record = taken(world)
    assert [agent.model.partition("@")[0] for agent in record.agents] == ["old", "old", "new"]

    def there(found: LoadedModels) -> list[str]:
        other = World(found, BODIES, start_poses())
        other.members.put_session(record, 0.0)
        return moved_by(other)

    assert there(models) == ["old", "old", "new"]
    changed = named("old")
    changed.graphs = ("better male", "better female")
    retrained = LoadedModels(new)
    retrained.add(changed)
    assert there(retrained) == ["old", "old", "new"], "of the same name, if not the same"
    assert there(LoadedModels(new)) == ["new", "new", "new"], "the one in use, if there is no other"


def test_who_has_come_from_elsewhere_is_counted(models):
    world = make_world(models, 2)
    record = taken(world)
    world.delete_session("s")
    models.use("new")
    world.members.put_session(record, 0.0)
    with pytest.raises(FailedPrecondition, match="moves 2 agents"):
        models.remove("old")


def test_new_agents_are_moved_by_the_model_in_use(models, old, new):
    world = make_world(models, 2)
    models.use("new")
    world.create_agents("s", people(1), 0.0)
    assert moved_by(world) == ["old", "old", "new"]
    list(world.advance(1.0))
    assert rows(old) and rows(new)
    assert [(m.name, m.in_use) for m in models.infos()] == [("old", False), ("new", True)]


def test_an_agent_is_moved_by_the_model_that_it_names(models):
    world = make_world(models, 1)
    world.create_agents("s", people(1, model="new"), 0.0)
    with pytest.raises(NotFound, match="'old', 'new'"):
        world.create_agents("s", people(2, model="newer"), 0.0)
    assert moved_by(world) == ["old", "new"]


def test_agents_go_on_with_another_model_at_their_next_primitive(models, old, new):
    world = make_world(models, 3)
    agents = world.list_agents("s")
    for agent in agents:
        world.give(agent.agent_id, Goal((20.0, 30.0, 0.0)), 0.0)
    before = [c for c in world.advance(1.0) if c.alias == 1]
    steps = rows(old)
    assert [agent.agent_id for agent in world.use_model("new")] == [a.agent_id for a in agents]
    after = [c for c in world.advance(2.0) if c.alias == 1]
    assert rows(old) == steps and rows(new)
    assert moved_by(world) == ["new"] * 3
    assert [c.seq for c in before + after] == list(range(len(before + after)))
    frames = [c.translation[i, 1] for c in before + after for i in range(8)]
    way = [b - a for a, b in pairwise(frames)]
    way = way[next(i for i, metres in enumerate(way) if metres) :]  # agents set off one by one
    assert max(way) < 1.3 * sum(way) / len(way)  # it walks through the seam
    assert world.use_model("new") == []


def test_batches_are_of_one_model(models, old, new):
    world = make_world(models, 4)
    models.use("new")
    world.create_agents("s", people(4), 0.0)
    list(world.advance(1.0))
    assert {call[0] for call in old.calls} == {call[0] for call in new.calls} == {"female", "male"}


def test_what_moves_somebody_cannot_be_unloaded(models):
    world = make_world(models, 2)
    with pytest.raises(FailedPrecondition, match="in use"):
        models.remove("old")
    models.use("new")
    with pytest.raises(FailedPrecondition, match="moves 2 agents"):
        models.remove("old")
    world.delete_agent(world.list_agents("s")[0].agent_id)
    with pytest.raises(FailedPrecondition, match="moves 1 agents"):
        models.remove("old")
    world.use_model("new")
    models.remove("old")
    assert [m.name for m in models.infos()] == ["new"]
    with pytest.raises(NotFound, match="no model 'old' is loaded; loaded are 'new'"):
        models.use("old")
    list(world.advance(1.0))


def test_a_world_that_is_gone_holds_no_model(models):
    make_world(models, 2)
    gc.collect()
    models.use("new")
    models.remove("old")


def test_a_copy_keeps_what_is_unloaded(models, old):
    models.use("new")
    kept = models.copy()
    models.remove("old")
    world = make_world(kept, 1)
    assert world.use_model("old")[0].model == "old"
    list(world.advance(0.5))
    assert rows(old)


def test_stamps_tell_models_apart_by_what_they_run(models, old):
    other = named("old")
    other.graphs = ("another", "graph")
    stamp = models.stamps[0]
    assert models.stamped(stamp).engine is old
    with pytest.raises(FailedPrecondition, match=r"no model old@\w+ is loaded; loaded are old@"):
        LoadedModels(other).stamped(stamp)


async def test_the_desk_loads_in_a_thread_of_its_own(old):
    models, threads = LoadedModels(old), []

    def open_engine(name: str) -> FakeEngine:
        threads.append(threading.current_thread())
        return named(name)

    desk = ModelLoader(models, open_engine)
    await desk.load("new")
    assert [m.name for m in models.infos()] == ["old", "new"]
    assert threads[0] is not threading.current_thread()
    with pytest.raises(AlreadyExists, match="'new' is loaded already"):
        await desk.load("new")
    for number in range(2, MOST):
        await desk.load(f"m{number}")
    with pytest.raises(ResourceExhausted, match="no more can be"):
        await desk.load("one-more")


async def test_one_model_at_a_time_is_loaded_even_if_nobody_waits_any_more(old):
    models, go_on = LoadedModels(old), threading.Event()

    def open_engine(name: str) -> FakeEngine:
        go_on.wait(5)
        return named(name)

    desk = ModelLoader(models, open_engine)
    loading = asyncio.create_task(desk.load("new"))
    await asyncio.sleep(0)
    loading.cancel()
    with pytest.raises(asyncio.CancelledError):
        await loading
    with pytest.raises(ResourceExhausted, match="model 'new' is being loaded"):
        await desk.load("other")
    go_on.set()
    for _ in range(500):
        await asyncio.sleep(0.01)
        try:
            await desk.load("other")
        except ResourceExhausted:
            continue
        break
    assert [m.name for m in models.infos()] == ["old", "other"]


async def test_a_model_that_cannot_be_opened_leaves_all_as_it_was(old):
    models = LoadedModels(old)

    def open_engine(name: str) -> FakeEngine:
        raise ArtifactError(f"{name}: sha256: found 'a', expected 'b'")

    desk = ModelLoader(models, open_engine)
    for _ in range(2):
        with pytest.raises(ArtifactError, match="sha256"):
            await desk.load("new")
    assert [m.name for m in models.infos()] == ["old"]
