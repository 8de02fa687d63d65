from dataclasses import replace

from wayfarer.navigation.examples import EXAMPLES, cubes_field
from wayfarer.navigation.scene_spec import (
    Box,
    Cylinder,
    Floor,
    MeshFile,
    Prism,
    SceneSpec,
    Walkable,
)

SQUARE = ((0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0))


def test_equal_content_has_an_equal_hash_and_whole_numbers_are_no_other_content() -> None:
    one = SceneSpec((Floor(SQUARE),), (Box((1.0, 2.0), (1.0, 1.0), 2.0),))
    same = SceneSpec((Floor(((0, 0), (4, 0), (4, 4), (0, 4))),), (Box((1, 2), (1, 1), 2),))
    assert one.content_hash == same.content_hash


def test_whatever_a_bake_depends_on_changes_the_hash() -> None:
    base = SceneSpec((Floor(SQUARE),), (Box((1.0, 2.0), (1.0, 1.0), 2.0),))
    others = [
        replace(base, walkable=Walkable(radius=0.4)),
        replace(base, entries=((1.0, 1.0, 0.0),)),
        replace(base, solids=()),
        replace(base, solids=(Cylinder((1.0, 2.0), 1.0, 1.0, 2.0),)),
        replace(base, solids=(Prism(SQUARE, 2.0),)),
        replace(base, floors=(Floor(SQUARE), Floor(SQUARE))),
        replace(base, floors=(Floor(SQUARE, (SQUARE,)),)),
        replace(base, mesh=MeshFile(b"", "glb")),
        replace(base, mesh=MeshFile(b"", "obj")),
    ]
    assert len({spec.content_hash for spec in [base, *others]}) == len(others) + 1


def test_examples_are_the_same_every_time_and_seeds_differ() -> None:
    for make in EXAMPLES.values():
        assert make().content_hash == make().content_hash
    assert cubes_field(1).content_hash != cubes_field(2).content_hash
