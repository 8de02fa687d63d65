"""Scenes in the viewer: a real browser against the real service (see test_viewer.py)."""

import base64
import io
import time
from collections.abc import Callable

import numpy as np
import pytest
import trimesh

from tests.navigation.meshes.glb_files import LEVELS, Packer
from tests.viewer.chromium import CONNECTION, Page, needs_chromium
from tests.viewer.stage import PEOPLE, look_down, on_screen, press
from wayfarer.navigation.examples import EXAMPLES

Image = pytest.importorskip("PIL.Image", reason="pillow is missing: make lab")

pytestmark = needs_chromium
SIZE = (1280, 860)


@pytest.fixture
def visit(page: Page) -> Callable[[str], Page]:
    def visit(scene: str) -> Page:
        page.call("Page.navigate", url=f"{page.url}/?detail=low&scene={scene}&people=0")
        there = "globalThis.wayfarer?.book.version >= 0 && wayfarer.stage.renderer"
        page.wait_for(f"{there} && {CONNECTION} === 'open'", 60)
        return page

    return visit


def colours(page: Page) -> float:
    """How much the middle of the page differs in colour."""
    seen = Image.open(io.BytesIO(page.screenshot())).convert("RGB").crop((320, 100, 1000, 560))
    return float(np.asarray(seen).reshape(-1, 3).std(0).min())


def gap(point: np.ndarray, way: np.ndarray) -> float:
    """Metres from a point [2] to a polyline [P, 2], seen from above."""
    start, step = way[:-1], np.diff(way, axis=0)
    along = ((point - start) * step).sum(1) / np.maximum((step**2).sum(1), 1e-9)
    nearest = start + np.clip(along, 0, 1)[:, None] * step
    return float(np.hypot(*(nearest - point).T).min())


@pytest.mark.parametrize("scene", EXAMPLES)
def test_an_example_scene_is_drawn_as_it_is(visit, scene: str):
    page = visit(scene)
    solids, low, high = page.evaluate(
        "[wayfarer.level.solids.length, wayfarer.level.extent.low, wayfarer.level.extent.high]"
    )
    assert solids == len(EXAMPLES[scene]().solids)
    assert (high > low + 1) == (scene in ("slope_with_steps", "two_storeys"))
    assert "m²" in page.wait_for("document.querySelector('#scene-facts').textContent")
    assert page.evaluate("document.querySelector('#scene').value") == scene
    end = time.monotonic() + 60  # a first picture without a graphics card takes a while
    while (spread := colours(page)) < 8 and time.monotonic() < end:
        time.sleep(0.5)
    assert spread >= 8  # not one colour: ground, solids, shadows
    assert page.evaluate("wayfarer.stage.renderer.info.render.calls") < 20
    assert page.problems == []


def test_a_crate_dropped_in_the_way_is_walked_around(visit):
    page = visit("town_square")
    page.evaluate("document.querySelector('#add-one').click()")
    page.wait_for(f"{PEOPLE}.length === 1 && {PEOPLE}[0].shown", 60)
    start = page.evaluate(f"(({{ x, y, z }}) => ({{ x, y, z }}))({PEOPLE}[0])")
    out = np.array([start["x"], start["z"]]) / np.hypot(start["x"], start["z"])
    across = np.array([-out[1], out[0]])
    # past the fountain's rim, and before the stalls: a goal under one is moved by up to 0.7 m
    goal = 5.0 * out + 4.5 * across
    page.evaluate("document.querySelector('#speed').value = '0.4'")  # time to put the crate there
    look_down(page, *(5.0 * out + 2.5 * across), 22.0)
    page.click(*on_screen(page, goal[0], 0.0, goal[1]))
    page.wait_for(f"{PEOPLE}[0].way !== null", 20)
    ways = f"(({{ way }}) => [...way.geometry.attributes.position.array])({PEOPLE}[0])"

    def way() -> np.ndarray:
        return np.reshape(page.evaluate(ways), (-1, 3))[:, [0, 2]]

    before = way()
    reached = page.evaluate(f"(({{ ahead }}) => ahead[0])({PEOPLE}[0])")
    crate = 0.25 * before[0] + 0.75 * before[-1]
    assert gap(crate, before) < 1.0
    page.evaluate("document.querySelector('[data-tool=crate]').click()")
    page.click(*on_screen(page, crate[0], 0.0, crate[1]))
    page.wait_for("wayfarer.book.version >= 1 && wayfarer.level.obstacles.size === 1", 20)
    (top,) = page.evaluate("[...wayfarer.level.obstacles.values()].map(({ top }) => top)")
    middle = np.mean([[corner["x"], corner["z"]] for corner in top], axis=0)
    assert np.hypot(*(middle - crate)) < 0.3
    end = time.monotonic() + 20
    while gap(middle, way()) < 0.7 and time.monotonic() < end:  # half a crate, half an agent
        time.sleep(0.2)
    assert gap(middle, way()) >= 0.7
    closest, end = np.inf, time.monotonic() + 90
    where = f"(({{ x, z, ahead }}) => [x, z, ahead.length])({PEOPLE}[0])"
    while (now := page.evaluate(where))[2] and time.monotonic() < end:
        closest = min(closest, float(np.hypot(*(middle - now[:2]))))
    assert now[2] == 0, f"still on the way, {np.hypot(*(goal - now[:2])):.1f} m to go"
    arrived = f"Math.hypot(x - {reached['x']}, z - {reached['z']}) < 0.6"
    page.wait_for(f"(({{ x, z }}) => {arrived})({PEOPLE}[0])", 20)  # the picture is older
    assert closest > 0.5
    assert page.problems == []


def test_a_crate_is_dragged_and_deleted(visit):
    page = visit("town_square")
    page.wait_for("wayfarer.level.obstacles.size === 1")  # the former scene is back
    page.evaluate("document.querySelector('[data-tool=crate]').click()")
    middle = (
        "(([{ top }]) => ['x', 'z'].map((axis) => top.reduce((sum, p) => sum + p[axis], 0) / 4))"
        "([...wayfarer.level.obstacles.values()])"
    )
    x, z = page.evaluate(middle)
    look_down(page, x, z, 20.0)
    version = page.evaluate("wayfarer.book.version")
    camera = page.evaluate("wayfarer.stage.camera.position.toArray()")
    page.drag(on_screen(page, x, 0.9, z), on_screen(page, x + 1.5, 0.9, z))
    page.wait_for(f"wayfarer.book.version > {version}", 20)
    moved = page.evaluate(middle)
    assert np.allclose(moved, (x + 1.5, z), atol=0.15)
    assert np.allclose(page.evaluate("wayfarer.stage.camera.position.toArray()"), camera, atol=0.01)
    press(page, "Delete")
    page.wait_for("wayfarer.level.obstacles.size === 0", 20)
    assert page.problems == []


def test_people_populate_a_scene_follow_and_are_followed(visit):
    page = visit("town_square")
    page.wait_for("!document.querySelector('#populate').disabled")
    page.evaluate(
        "(() => { const count = document.querySelector('#count'); count.value = 10;"
        " count.dispatchEvent(new Event('input')); })()"
    )
    assert page.evaluate("document.querySelector('#count-shown').textContent") == "10"
    page.evaluate("document.querySelector('#populate').click()")
    page.wait_for(f"{PEOPLE}.filter((person) => person.shown).length === 10", 60)
    assert page.evaluate("wayfarer.stage.renderer.info.render.calls") < 24  # many in one mesh
    page.evaluate("document.querySelector('input[value=all]').click()")
    page.evaluate("document.querySelector('[data-tool=follow]').click()")
    page.evaluate(f"wayfarer.tools.follow({PEOPLE}[0])")
    page.wait_for("document.querySelector('#news').textContent.includes('9 people follow')", 20)
    page.wait_for("wayfarer.tools.name === 'send'")
    page.evaluate(
        "(() => { const list = document.querySelector('#selected'); list.selectedIndex = 1;"
        " list.dispatchEvent(new Event('change'));"
        " document.querySelector('#follow').click(); })()"
    )
    gap_to_eye = (
        f"(({{ x, z }}) => Math.hypot(wayfarer.stage.camera.position.x - x,"
        f" wayfarer.stage.camera.position.z - z))({PEOPLE}[0])"
    )
    page.wait_for(f"{gap_to_eye} < 6", 30)  # the camera has come from afar, to walk behind
    press(page, "Escape")
    assert page.evaluate("document.querySelector('#follow').checked") is False
    assert page.evaluate("wayfarer.stage.controls.enabled") is True
    press(page, "Escape")
    assert page.evaluate("document.querySelector('#selected').value") == ""
    page.evaluate("document.querySelector('#stop').click()")  # standing people leave when they may
    page.evaluate(
        "document.querySelector('#count').value = 0; document.querySelector('#populate').click()"
    )
    page.wait_for(f"{PEOPLE}.length < 10", 60)
    assert page.problems == []


def test_the_change_of_another_client_is_shown(visit):
    page = visit("corridor")
    door = "{ cylinder: { position: { x: -3, y: 0, z: 0 }, radius: 0.3, height: 1 } }"
    page.evaluate(f"wayfarer.api.putObstacle(wayfarer.book.id, 'post', {door})")
    page.wait_for("wayfarer.level.obstacles.has('post')", 20)
    page.evaluate("wayfarer.api.removeObstacle(wayfarer.book.id, 'post')")
    page.wait_for("!wayfarer.level.obstacles.has('post')", 20)


def test_a_file_that_is_no_level_is_refused_in_words(visit):
    page = visit("corridor")
    drop = (
        "(() => {{ const data = new DataTransfer(); data.items.add(new File(['{text}'], '{name}'));"
        " dispatchEvent(new DragEvent('drop', {{ dataTransfer: data }})); }})()"
    )
    said = "document.querySelector('#messages').textContent"
    page.evaluate(drop.format(text="x", name="level.txt"))
    page.wait_for(f"{said}.includes('GLB, OBJ or PLY')", 10)
    page.evaluate(drop.format(text="not a mesh", name="level.glb"))
    page.wait_for(f"{said}.includes('data')", 60)  # the first bake starts a process
    assert page.evaluate("document.querySelector('#scene').value") == "corridor"
    floor = "v 0 0 0\\nv 0 0 8\\nv 8 0 8\\nv 8 0 0\\nf 1 2 3 4\\n"
    page.evaluate(drop.format(text=floor, name="yard.obj"))
    page.wait_for("wayfarer.level.extent?.size > 7 && wayfarer.level.extent.size < 8", 30)
    chosen = "document.querySelector('#scene').selectedOptions[0].textContent"
    assert page.evaluate(chosen) == "yard.obj"
    page.problems.clear()  # the browser logs the refusal itself


def test_a_level_is_what_was_chosen_as_one_and_its_notes_are_shown(visit):
    """A file with a skin that is chosen as a level is one; notes for its author are shown."""
    page = visit("corridor")
    choose = (
        "(() => {{ const data = new DataTransfer(); data.items.add(new File([Uint8Array.from("
        "atob('{text}'), (c) => c.charCodeAt(0))], '{name}')); "
        "const input = document.querySelector('#level-file'); input.files = data.files;"
        " input.dispatchEvent(new Event('change')); }})()"
    )
    chosen = "document.querySelector('#scene').selectedOptions[0].textContent"
    dome = base64.b64encode((LEVELS / "sky_dome.glb").read_bytes()).decode()
    page.evaluate(choose.format(text=dome, name="dome.glb"))
    facts = "document.querySelector('#scene-facts').textContent"
    page.wait_for(f"{chosen} === 'dome.glb' && {facts}.includes('like a sky')", 60)
    stage = trimesh.creation.box((8, 8, 0.2))
    vertices, faces = stage.vertices.astype("<f4"), stage.faces.astype("<u2").reshape(-1)
    packer = Packer()
    packer.accessor(vertices, min=vertices.min(0).tolist(), max=vertices.max(0).tolist())
    packer.accessor(faces.astype(np.uint16))
    packer.accessor(np.zeros((len(vertices), 4), np.uint8))
    packer.accessor(np.tile(np.array([[1, 0, 0, 0]], np.float32), (len(vertices), 1)))
    # level in glTF's axes: the box's flat side is up
    turn = {"rotation": [-0.70710678, 0, 0, 0.70710678]}
    attributes = {"POSITION": 0, "JOINTS_0": 2, "WEIGHTS_0": 3}
    skinned = packer.file(
        scene=0,
        scenes=[{"nodes": [0, 1]}],
        meshes=[{"primitives": [{"attributes": attributes, "indices": 1}]}],
        nodes=[{"mesh": 0, "skin": 0}, turn],
        skins=[{"joints": [1]}],
    )
    page.evaluate(choose.format(text=base64.b64encode(skinned).decode(), name="stage.glb"))
    page.wait_for(f"{chosen} === 'stage.glb'", 60)
    page.wait_for("wayfarer.level.extent?.size > 7 && wayfarer.level.extent.size < 8", 30)
