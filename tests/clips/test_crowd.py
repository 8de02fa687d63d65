"""Several people in one file, without a server."""

import numpy as np
import pytest

from tests.world.scenes.grounds import BOX, field, world_in
from wayfarer.clips.crowd import crowd_clips, scene_of
from wayfarer.clips.generate import generate
from wayfarer.errors import InvalidArgument
from wayfarer.navigation.examples import EXAMPLES
from wayfarer.world.scenes.messages import Crowd


def test_all_walk_about_from_the_beginning_to_the_end():
    world, _, scene_id = world_in(field(BOX))
    people = crowd_clips(world, scene_id, Crowd(6, seed=3), 5.0)
    assert len(people) == 6 and len({person.name for person in people}) == 6
    for person in people:
        assert person.start + person.clip.seconds == pytest.approx(5.0, abs=0.03)
        way = np.diff(person.clip.translation[:, :2], axis=0)
        assert np.linalg.norm(way, axis=1).sum() > 0.2
    assert min(person.start for person in people) == 0.0
    assert [info.session_id for info in world.list_sessions()] == ["s"]


def test_a_scene_is_an_example_a_file_or_a_field(tmp_path):
    assert scene_of("town_square").content_hash == EXAMPLES["town_square"]().content_hash
    assert not scene_of("").solids
    level = tmp_path / "level.OBJ"
    level.write_bytes(b"v 0 0 0")
    mesh = scene_of(str(level)).mesh
    assert mesh and mesh.format == "obj" and mesh.data == b"v 0 0 0"
    with pytest.raises(InvalidArgument, match="no scene square: give cubes_field, town_square"):
        scene_of("square")


def test_what_is_for_one_person_is_refused_for_several(tmp_path):
    with pytest.raises(InvalidArgument, match="--goal is for one person without a --scene"):
        generate(tmp_path / "walk.glb", goal=["1,2"], people=3)
    with pytest.raises(InvalidArgument, match="--outfit is for one person"):
        generate(tmp_path / "walk.glb", outfit="suit", scene="corridor")
