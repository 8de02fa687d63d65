"""A character of the user's, dropped on the viewer: a real browser against the real service."""

import base64
import math
from pathlib import Path

import numpy as np
import pytest

from tests.viewer.characters import MANNEQUIN, makehuman, names_of
from tests.viewer.chromium import CONNECTION, Page, needs_chromium

pytestmark = needs_chromium
SIZE = (560, 480)

STATUS = "document.querySelector('#bones-found').textContent"
MESSAGES = "document.querySelector('#messages').textContent"
SAMPLES = 40
FOOT = 0.02
"""Maximum metres between a standing foot's lowest skin point and the agent's sole, and between that
and the ground."""
HIPS = 0.02
"""Maximum relative error of the thigh joints' height against the agent's, scaled."""
TURNED = math.radians(35)
"""Maximum angle between a limb and the agent's: legs bend by IK, and T-poses differ a little."""

WATCH = Path(__file__).with_name("watch_character.js").read_text()


@pytest.fixture
def visit(page: Page) -> Page:
    page.call("Page.navigate", url=f"{page.url}/?detail=low&scene=")
    page.wait_for(f"globalThis.wayfarer?.wardrobe && {CONNECTION} === 'open'", 60)
    return page


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("files")
    written = {"mannequin": MANNEQUIN}
    unnamed = {name: f"node {k}" for k, name in enumerate(names_of("mixamo"))}
    for name, data in {
        "rigify": makehuman("rigify"),
        "unnamed": makehuman("mixamo", unnamed),
        "stick": makehuman("mixamo", unnamed, most=3),
    }.items():
        written[name] = folder / f"{name}.glb"
        written[name].write_bytes(data)
    return written


def measured(page: Page) -> dict[str, float]:
    """Extremes over the frames shown while it walked; for feet, over nine in ten, since a foot
    already moves where a contact begins or ends.
    """
    page.wait_for(f"globalThis.seen?.length >= {SAMPLES}", 90)
    seen = page.evaluate("seen")
    stance = [gap for sample in seen for gap in sample["stance"]]
    assert len(stance) >= SAMPLES / 2
    return {
        "ground": np.quantile([abs(sample["ground"]) for sample in seen], 0.9),
        "low": np.quantile(stance, 0.05),
        "high": np.quantile(stance, 0.95),
        "hips": max(abs(sample["hips"]) for sample in seen),
        "turned": max(sample["turned"] for sample in seen),
        "upright": min(sample["upright"] for sample in seen),
    }


@pytest.mark.parametrize("name", ("mannequin", "rigify", "unnamed"))
def test_a_character_that_is_dropped_walks(visit: Page, files: dict[str, Path], name: str):
    page = visit
    page.drop(files[name], 280, 240)
    found = page.wait_for(STATUS, 30)
    by = "by its shape" if name == "unnamed" else "by their names"
    assert found == f"22 of 22 bones found {by}"
    walks = "wayfarer.crowd.people.some(({ shown, played }) => shown && played.state === 'walking')"
    page.wait_for(walks, 60)
    assert all(count > 10 for count in page.evaluate(WATCH))
    extremes = measured(page)
    assert extremes["low"] > -FOOT and extremes["high"] < FOOT > extremes["ground"], extremes
    assert extremes["hips"] < HIPS and extremes["turned"] < TURNED, extremes
    assert extremes["upright"] > 0.3
    assert page.problems == []
    # only joints and a name were sent
    assert page.evaluate(
        "document.querySelector('#selected').selectedOptions[0].textContent"
    ).startswith(name)


def test_its_bones_are_corrected_and_kept(visit: Page, files: dict[str, Path]):
    page = visit
    page.choose("#character-file", files["mannequin"])
    page.wait_for("wayfarer.crowd.people.some(({ body }) => body?.character)", 60)
    chest = "document.querySelector('[data-bone=spine2]')"
    assert page.evaluate(f"{chest}.value") == "chest"
    choose = f"((list) => {{ list.value = ''; list.onchange(); }})({chest})"
    page.evaluate(choose)
    assert page.evaluate(STATUS) == "21 of 22 bones found as you chose; without spine 2"
    worn = "wayfarer.crowd.people.find(({ body }) => body?.character).body.character.map.missing"
    assert page.evaluate(worn) == ["spine2"]
    knee = "document.querySelector('[data-bone=left_knee]')"
    page.evaluate(f"((list) => {{ list.value = ''; list.onchange(); }})({knee})")
    assert "no node was found for left_knee" in page.evaluate(STATUS)
    assert "calf" in page.evaluate(STATUS)  # an allowed name
    assert page.evaluate(worn) == ["spine2"]  # it continues as it was
    page.call("Page.reload")
    page.wait_for(f"globalThis.wayfarer?.wardrobe && {CONNECTION} === 'open'", 60)
    page.choose("#character-file", files["mannequin"])
    assert "as you chose; without spine 2" in page.wait_for(STATUS, 30)
    page.evaluate("document.querySelector('#bones-reset').click()")
    assert page.evaluate(STATUS) == "22 of 22 bones found by their names"
    assert page.problems == []


def test_what_cannot_walk_is_refused_in_words(visit: Page, files: dict[str, Path], tmp_path: Path):
    page = visit
    page.drop(files["stick"], 280, 240)
    found = page.wait_for(STATUS, 30)
    assert "no node was found for pelvis, left_hip" in found and "thigh" in found
    assert page.evaluate("document.querySelector('#bones').open")
    assert page.evaluate("wayfarer.crowd.people.length") == 0
    for name, content, said in (
        ("broken.vrm", b"VRM", "broken.vrm is no GLB or VRM file"),
        ("me.fbx", b"Kaydara", "save it as GLB"),
    ):
        file = tmp_path / name
        file.write_bytes(content)
        page.drop(file, 280, 240)
        page.wait_for(f"{MESSAGES}.includes('{said}')", 10)
    assert page.problems == []


CHARACTERS = Path(__file__).parents[1] / "characters"
LEVELS = Path(__file__).parents[1] / "navigation" / "levels"
LOOK = """(async (text) => {
  const { loadGlb } = await import("./packed.js");
  const { Box3 } = await import("./vendor/three.min.js");
  const { scene } = await loadGlb(Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer);
  let triangles = 0;
  scene.traverse((node) => triangles += (node.geometry?.index?.count ?? 0) / 3);
  const { min, max } = new Box3().setFromObject(scene, true);
  return [triangles, ...min, ...max];
})"""


@pytest.mark.parametrize(
    "files",
    [
        [CHARACTERS / "cases" / "long_shoes.glb", *(CHARACTERS / "packed").glob("*.glb")],
        sorted(LEVELS.glob("hill_*.glb")),
    ],
    ids=["characters", "levels"],
)
def test_what_draco_and_meshopt_have_packed_is_drawn(page: Page, files: list[Path]) -> None:
    """The page has its own decoders, since its policy allows no other origin."""
    page.call("Page.navigate", url=f"{page.url}/?detail=low&scene=")
    page.wait_for("Boolean(globalThis.wayfarer)", 60)
    texts = [base64.b64encode(file.read_bytes()).decode() for file in files]
    plain, *packed = (page.evaluate(f"{LOOK}({text!r})") for text in texts)
    assert plain[0] > 200 and len(packed) >= 2
    for found in packed:
        np.testing.assert_allclose(found, plain, atol=2e-3)
