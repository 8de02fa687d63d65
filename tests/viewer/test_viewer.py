"""The viewer in a real browser against the real service.

Needs Chromium (apt-get install chromium). VIEWER_URL names a server that runs already; otherwise
`wayfarer serve` is started on free ports.
"""

import io
import json
import os
import subprocess
import sys
from collections.abc import Iterator

import numpy as np
import pytest

from tests.viewer.chromium import Page, find_chromium

Image = pytest.importorskip("PIL.Image", reason="pillow is missing: pip install 'wayfarer[train]'")

pytestmark = pytest.mark.skipif(
    find_chromium() is None, reason="no Chromium on this machine: apt-get install chromium"
)

CROWD = "globalThis.wayfarer.crowd"
CONNECTION = "document.querySelector('#connection').dataset.state"


class Service:
    """`wayfarer serve` on free ports."""

    def __init__(self) -> None:
        command = [sys.executable, "-m", "wayfarer.cli", "serve", "--log-format", "json"]
        self.process = subprocess.Popen(
            [*command, "--http-port", "0", "--grpc-port", "0", "--candidates", "2"],
            stderr=subprocess.PIPE,
            text=True,
        )
        assert self.process.stderr is not None
        said = []
        for line in self.process.stderr:
            said.append(line)
            if line.startswith("{") and json.loads(line).get("event") == "ready":
                self.url = json.loads(line)["http"]
                return
        raise RuntimeError("the service did not start:\n" + "".join(said[-20:]))

    def stop(self) -> None:
        self.process.terminate()
        try:
            self.process.communicate(timeout=20)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.communicate()


@pytest.fixture(scope="module")
def service() -> Iterator[Service]:
    started = Service()
    yield started
    started.stop()


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory, request: pytest.FixtureRequest):
    url = os.environ.get("VIEWER_URL") or request.getfixturevalue("service").url
    executable = find_chromium()
    assert executable
    with Page(executable, tmp_path_factory.mktemp("profile"), (900, 600)) as opened:
        opened.call("Page.navigate", url=f"{url}/?detail=low")
        opened.wait_for(f"globalThis.wayfarer && {CONNECTION} === 'open'", 60)
        yield opened


def press(page: Page, key: str) -> None:
    for kind in ("keyDown", "keyUp"):
        page.call("Input.dispatchKeyEvent", type=kind, key=key)


def hips(page: Page) -> np.ndarray:
    """Places of all people on the floor [people, 2]."""
    return np.array(page.evaluate(f"{CROWD}.people.map(({{ x, z }}) => [x, z])"))


def picture(page: Page) -> np.ndarray:
    """The page as it is seen [H, W, 3]."""
    return np.asarray(Image.open(io.BytesIO(page.screenshot())).convert("RGB")).astype(int)


def test_sixteen_people_of_differing_shape_appear(page: Page):
    empty = picture(page)
    page.evaluate("document.querySelector('#add-many').click()")
    seen = f"{CROWD}.people.filter((person) => person.body?.visible).length"
    page.wait_for(f"{seen} === 16", 90)
    heights = np.array(page.evaluate(f"{CROWD}.people.map(({{ height }}) => height)"))
    assert ((heights > 1.3) & (heights < 2.3)).all()
    assert np.ptp(heights) > 0.02
    page.wait_for("document.querySelector('#figure-people').textContent === '16'")
    assert page.evaluate("document.querySelector('#selected').options.length") == 17
    # people differ from the empty floor on a good part of the picture, in many colours
    changed = (np.abs(picture(page) - empty).max(-1) > 40)[:, 320:]
    assert changed.mean() > 0.01
    assert page.problems == []


def test_a_click_on_the_ground_sends_everybody(page: Page):
    start = hips(page)
    page.evaluate("document.querySelector('input[value=all]').click()")
    page.click(620, 420)
    page.wait_for(f"{CROWD}.people.filter((person) => person.ahead.length === 1).length === 16")
    moved = (
        f"{CROWD}.people.filter((person, k) => "
        f"Math.hypot(person.x - {json.dumps(start.tolist())}[k][0],"
        f" person.z - {json.dumps(start.tolist())}[k][1]) > 0.5).length"
    )
    page.wait_for(f"{moved} >= 10", 60)
    assert page.problems == []


def test_shift_adds_waypoints_and_a_drag_the_heading(page: Page):
    ahead = f"{CROWD}.people.map((person) => person.ahead)"
    page.evaluate(
        "(() => { const speed = document.querySelector('#speed');"
        " speed.value = '0.6'; speed.dispatchEvent(new Event('input')); })()"
    )
    assert page.evaluate("document.querySelector('#speed-shown').textContent") == "0.6 m/s"
    camera = page.evaluate("globalThis.wayfarer.stage.camera.position.toArray()")
    page.drag((620, 420), (620, 420), shift=True)
    page.drag((700, 400), (780, 400), shift=True)
    # whoever stands near the first may have passed it before the second is there
    page.wait_for(f"{ahead}.every((goals) => goals.at(-1)?.heading !== undefined)")
    page.wait_for(f"{ahead}.some((goals) => goals.length >= 2)")
    for *before, last in page.evaluate(ahead):
        assert all(goal["stop"] is False for goal in before)
        assert "stop" not in last and last["speed"] == 0.6
        assert abs(last["heading"]) < 3.2
    assert page.evaluate("globalThis.wayfarer.stage.camera.position.toArray()") == camera
    page.wait_for(f"{CROWD}.people.every((person) => Number.isFinite(person.revision))")
    assert page.problems == []


def test_people_are_selected_followed_and_removed_with_the_keyboard(page: Page):
    page.evaluate(
        "(() => { const list = document.querySelector('#selected');"
        " list.selectedIndex = 3; list.dispatchEvent(new Event('change')); })()"
    )
    assert page.evaluate(f"{CROWD}.people.filter((p) => p.marker.visible).length") == 1
    press(page, "f")
    assert page.evaluate("document.querySelector('#follow').checked") is True
    press(page, "Delete")
    page.wait_for(f"{CROWD}.members.size === 15")
    assert page.evaluate("document.querySelector('#remove').disabled") is True
    assert page.problems == []


def test_figures_are_shown(page: Page):
    for figure in ("step", "late", "delay", "buffer", "fps"):
        page.wait_for(f"/\\d/.test(document.querySelector('#figure-{figure}').textContent)", 10)


def test_a_refusal_is_shown_to_the_user(page: Page):
    page.evaluate(
        f"{CROWD}.people.forEach((person) => {{ person.agent.id = 'nobody'; }});"
        "document.querySelector('#stop').click()"
    )
    page.wait_for("document.querySelector('#messages').textContent.includes('nobody')", 10)
    page.problems.clear()  # the browser logs the 404 itself


@pytest.mark.skipif("VIEWER_URL" in os.environ, reason="the server is not ours to stop")
def test_a_lost_connection_is_shown(page: Page, service: Service):
    service.stop()
    page.wait_for(f"{CONNECTION} === 'lost'", 20)
    assert "lost" in str(page.evaluate("document.querySelector('#connection').textContent"))
