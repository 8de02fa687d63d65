import threading
from collections import Counter

import pytest

from wayfarer.errors import InvalidArgument
from wayfarer.navigation import library
from wayfarer.navigation.examples import cubes_field
from wayfarer.navigation.library import SceneLibrary
from wayfarer.navigation.scene import Scene, bake
from wayfarer.navigation.spec import SceneSpec


@pytest.fixture
def bakes(monkeypatch: pytest.MonkeyPatch) -> Counter[str]:
    counted: Counter[str] = Counter()

    def counting(spec: SceneSpec) -> Scene:
        counted[spec.content_hash] += 1
        return bake(spec)

    monkeypatch.setattr(library, "bake", counting)
    return counted


def test_equal_content_is_baked_once_for_all_who_ask(bakes: Counter[str]) -> None:
    scenes, kept = list[Scene](), SceneLibrary()
    askers = [
        threading.Thread(target=lambda: scenes.append(kept.get(cubes_field(3)))) for _ in range(8)
    ]
    for asker in askers:
        asker.start()
    for asker in askers:
        asker.join()
    assert len(scenes) == 8 and len({id(scene) for scene in scenes}) == 1
    assert list(bakes.values()) == [1]


def test_the_least_asked_for_goes_first(bakes: Counter[str]) -> None:
    kept = SceneLibrary(kept=2)
    one, two, three = (cubes_field(seed, boxes=2) for seed in range(3))
    for spec in (one, two, one, three, one):
        kept.get(spec)
    assert len(kept) == 2 and bakes[one.content_hash] == 1
    kept.get(two)
    assert bakes[two.content_hash] == 2


def test_a_scene_that_fails_is_not_kept() -> None:
    kept = SceneLibrary()
    for _ in range(2):
        with pytest.raises(InvalidArgument):
            kept.get(SceneSpec())
    assert len(kept) == 0
