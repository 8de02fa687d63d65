import queue
import threading

import numpy as np
import pytest

from tests.world.scenes.grounds import BOX, FIELD, WALL
from wayfarer.config.limits import Limits
from wayfarer.errors import (
    AlreadyExists,
    FailedPrecondition,
    InvalidArgument,
    NotFound,
    ResourceExhausted,
)
from wayfarer.ids import group_of
from wayfarer.navigation.scene import bake
from wayfarer.navigation.scene_spec import SceneSpec
from wayfarer.world.scenes import scene_registry
from wayfarer.world.scenes.messages import SceneSource
from wayfarer.world.scenes.scene_registry import SceneRecord, SceneRegistry

SOURCE = SceneSource(SceneSpec((FIELD,)), "field", {"owner": "me"})


class Counted:
    """Counts bakes; on request a bake waits for permission."""

    def __init__(self) -> None:
        self.bakes = 0
        self.begun, self.leave = threading.Event(), threading.Event()
        self.leave.set()

    def __call__(self, spec):
        self.bakes += 1
        self.begun.set()
        assert self.leave.wait(10)
        return bake(spec)


def test_equal_content_is_baked_once_whatever_has_been_put_into_the_first():
    counted = Counted()
    registry = SceneRegistry(bake=counted)
    first = registry.create(SOURCE, 1.0)
    registry.put(first.scene_id, "crate", BOX)
    second = registry.create(SOURCE, 2.0)
    assert counted.bakes == 1
    assert first.scene_id != second.scene_id and first.content_hash == second.content_hash
    assert second.version == 0 and not second.obstacles
    registry.create(SceneSource(SceneSpec((FIELD,), (BOX,))), 3.0)
    assert counted.bakes == 2
    assert [info.created_at for info in registry.infos()] == [1.0, 2.0, 3.0]


def test_tells_what_a_scene_is():
    info = SceneRegistry().create(SOURCE, 1.0)
    assert (info.name, info.version, info.islands, info.sessions) == ("field", 0, 1, 0)
    assert info.bounds == (0.0, 0.0, 12.0, 12.0)
    assert info.area == pytest.approx(11.4**2, rel=0.01)
    assert info.attributes == {"owner": "me"}


def test_ids_say_in_which_slot_a_scene_lives():
    registry = SceneRegistry(new_group=lambda: "0123456789ab")
    assert group_of(registry.create(SOURCE).scene_id) == "0123456789ab"


def test_a_change_makes_a_version_and_readers_keep_theirs():
    registry = SceneRegistry()
    scene_id = registry.create(SOURCE).scene_id
    before = registry.entry(scene_id).scene
    assert registry.put(scene_id, "crate", BOX).obstacles == {"crate": BOX}
    assert registry.entry(scene_id).scene.version == 1 and not before.obstacles
    assert registry.remove(scene_id, "crate").version == 2
    with pytest.raises(NotFound, match="crate"):
        registry.remove(scene_id, "crate")
    assert registry.entry(scene_id).scene.version == 2


def test_a_scene_with_sessions_stays():
    registry = SceneRegistry()
    scene_id = registry.create(SOURCE).scene_id
    for session_id in "abcde":
        registry.enter(scene_id, session_id)
    assert registry.entry(scene_id).info().sessions == 5
    with pytest.raises(FailedPrecondition, match=r"sessions first: 'a', 'b', 'c' and 2 more$"):
        registry.delete(scene_id)
    for session_id in "abce":
        registry.leave(scene_id, session_id)
    with pytest.raises(FailedPrecondition, match=r"sessions first: 'd'$"):
        registry.delete(scene_id)
    registry.leave(scene_id, "d")
    registry.delete(scene_id)
    for ask in (registry.entry, registry.delete, lambda gone: registry.enter(gone, "f")):
        with pytest.raises(NotFound, match=scene_id):
            ask(scene_id)


def test_refuses_more_scenes_than_there_is_room_for():
    registry = SceneRegistry(Limits(scenes=2))
    registry.create(SOURCE, 0.0)
    registry.create(SOURCE, 0.0)
    with pytest.raises(ResourceExhausted, match="all 2 scenes"):
        registry.create(SOURCE, 0.0)


def test_refuses_bakes_that_would_have_to_wait_long(monkeypatch):
    monkeypatch.setattr(scene_registry, "MAX_BAKES", 2)
    counted = Counted()
    counted.leave.clear()
    registry = SceneRegistry(bake=counted)
    refused = queue.Queue()

    def create(*solids):
        try:
            registry.create(SceneSource(SceneSpec((FIELD,), solids)), 0.0)
        except ResourceExhausted as error:
            refused.put(error)

    threads = [threading.Thread(target=create, args=solids) for solids in ((), (BOX,), (WALL,))]
    for thread in threads:
        thread.start()
    error = refused.get(timeout=10)  # one is baked, one waits
    assert "2 scenes are being baked" in str(error) and error.retry_after > 0
    counted.leave.set()
    for thread in threads:
        thread.join(10)
    assert refused.empty() and len(registry.infos()) == 2
    create(WALL)
    assert refused.empty()


def test_a_bake_that_fails_leaves_nothing_behind():
    registry = SceneRegistry()
    for _ in range(4):
        with pytest.raises(InvalidArgument):
            registry.create(SceneSource(SceneSpec()), 0.0)
    assert registry.infos() == []
    registry.create(SOURCE, 0.0)


@pytest.mark.parametrize("name", ["", "x" * 65, "two\nlines"])
def test_obstacles_have_names(name):
    registry = SceneRegistry()
    scene_id = registry.create(SOURCE).scene_id
    with pytest.raises(InvalidArgument, match="name must be 1 to 64") as refused:
        registry.put(scene_id, name, BOX)
    assert refused.value.field == "name"


def test_restores_a_scene_as_it_was():
    registry = SceneRegistry()
    info = registry.restore(SceneRecord("scene-1", SOURCE, 5.0, 7, {"crate": BOX}))
    assert (info.version, info.created_at, info.obstacles) == (7, 5.0, {"crate": BOX})
    assert registry.entry("scene-1").scene.distance(np.array(BOX.center)) < 0
    with pytest.raises(AlreadyExists):
        registry.restore(SceneRecord("scene-1", SOURCE, 5.0, 0, {}))


def test_what_another_server_has_baked_is_not_baked_again():
    counted = Counted()
    registry = SceneRegistry(bake=counted)
    made = bake(SOURCE.spec)
    registry.restore(SceneRecord("scene-1", SOURCE, 5.0, 0, {}, made), reported=False)
    registry.restore(SceneRecord("scene-2", SOURCE, 5.0, 0, {}), reported=False)
    assert counted.bakes == 0
    assert registry.entry("scene-1").scene.mesh is registry.entry("scene-2").scene.mesh is made.mesh
