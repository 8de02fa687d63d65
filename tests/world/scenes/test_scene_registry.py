import queue
import threading

import numpy as np
import pytest

from tests.world.scenes.grounds import BOX, FIELD, WALL, field
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
from wayfarer.world.scenes.scene_registry import SceneRegistry

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
    book = SceneRegistry(bake=counted)
    first = book.create(SOURCE, 1.0)
    book.put(first.scene_id, "crate", BOX)
    second = book.create(SOURCE, 2.0)
    assert counted.bakes == 1
    assert first.scene_id != second.scene_id and first.content_hash == second.content_hash
    assert second.version == 0 and not second.obstacles
    book.create(SceneSource(SceneSpec((FIELD,), (BOX,))), 3.0)
    assert counted.bakes == 2
    assert [info.created_at for info in book.infos()] == [1.0, 2.0, 3.0]


def test_tells_what_a_scene_is():
    info = SceneRegistry().create(SOURCE, 1.0)
    assert (info.name, info.version, info.islands, info.sessions) == ("field", 0, 1, 0)
    assert info.bounds == (0.0, 0.0, 12.0, 12.0)
    assert info.area == pytest.approx(11.4**2, rel=0.01)
    assert info.attributes == {"owner": "me"}


def test_ids_say_in_which_slot_a_scene_lives():
    book = SceneRegistry(new_group=lambda: "0123456789ab")
    assert group_of(book.add(field()).scene_id) == "0123456789ab"


def test_a_change_makes_a_version_and_readers_keep_theirs():
    book = SceneRegistry()
    scene_id = book.add(field()).scene_id
    before = book.scene(scene_id)
    assert book.put(scene_id, "crate", BOX).obstacles == {"crate": BOX}
    assert book.scene(scene_id).version == 1 and not before.obstacles
    assert book.remove(scene_id, "crate").version == 2
    with pytest.raises(NotFound, match="crate"):
        book.remove(scene_id, "crate")
    assert book.info(scene_id).version == 2


def test_a_scene_with_sessions_stays():
    book = SceneRegistry()
    scene_id = book.add(field()).scene_id
    for session_id in "abcde":
        book.enter(scene_id, session_id)
    assert book.info(scene_id).sessions == 5
    with pytest.raises(FailedPrecondition, match=r"sessions first: 'a', 'b', 'c' and 2 more$"):
        book.delete(scene_id)
    for session_id in "abce":
        book.leave(scene_id, session_id)
    with pytest.raises(FailedPrecondition, match=r"sessions first: 'd'$"):
        book.delete(scene_id)
    book.leave(scene_id, "d")
    book.delete(scene_id)
    for ask in (book.info, book.scene, book.delete, lambda gone: book.enter(gone, "f")):
        with pytest.raises(NotFound, match=scene_id):
            ask(scene_id)


def test_refuses_more_scenes_than_there_is_room_for():
    book = SceneRegistry(Limits(scenes=2))
    book.create(SOURCE, 0.0)
    book.create(SOURCE, 0.0)
    with pytest.raises(ResourceExhausted, match="all 2 scenes"):
        book.create(SOURCE, 0.0)


def test_refuses_bakes_that_would_have_to_wait_long(monkeypatch):
    monkeypatch.setattr(scene_registry, "MAX_BAKES", 2)
    counted = Counted()
    counted.leave.clear()
    book = SceneRegistry(bake=counted)
    refused = queue.Queue()

    def create(*solids):
        try:
            book.create(SceneSource(SceneSpec((FIELD,), solids)), 0.0)
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
    assert refused.empty() and len(book.infos()) == 2
    create(WALL)
    assert refused.empty()


def test_a_bake_that_fails_leaves_nothing_behind():
    book = SceneRegistry()
    for _ in range(4):
        with pytest.raises(InvalidArgument):
            book.create(SceneSource(SceneSpec()), 0.0)
    assert book.infos() == []
    book.create(SOURCE, 0.0)


@pytest.mark.parametrize("name", ["", "x" * 65, "two\nlines"])
def test_obstacles_have_names(name):
    book = SceneRegistry()
    scene_id = book.add(field()).scene_id
    with pytest.raises(InvalidArgument, match="name must be 1 to 64") as refused:
        book.put(scene_id, name, BOX)
    assert refused.value.field == "name"


def test_restores_a_scene_as_it_was():
    book = SceneRegistry()
    book.restore("scene-1", SOURCE, 5.0, 7, {"crate": BOX})
    info = book.info("scene-1")
    assert (info.version, info.created_at, info.obstacles) == (7, 5.0, {"crate": BOX})
    assert book.scene("scene-1").distance(np.array(BOX.center)) < 0
    with pytest.raises(AlreadyExists):
        book.restore("scene-1", SOURCE, 5.0, 0, {})


def test_what_is_prepared_is_baked_once_and_is_not_there_before_it_comes():
    counted = Counted()
    book = SceneRegistry(Limits(scenes=1), bake=counted)
    book.prepare(SOURCE.spec)
    book.prepare(SOURCE.spec)
    assert book.infos() == [] and counted.bakes == 1
    book.restore("scene-1", SOURCE, 5.0, 0, {}, reported=False)
    assert counted.bakes == 1
    book.prepare(SceneSpec((FIELD,), (BOX,)))
    book.delete("scene-1")
    book.prepare(SOURCE.spec)
    assert counted.bakes == 3, "only so many are kept as there may be scenes"
