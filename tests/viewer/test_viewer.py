"""The viewer in a real browser against the real service.

Needs Chromium (apt-get install chromium). VIEWER_URL names a server that runs already; otherwise
`wayfarer serve` is started on free ports.
"""

import io
import json
import time
from urllib.request import Request, urlopen

import numpy as np
import pytest

from tests.viewer.chromium import CONNECTION, Page, needs_chromium
from tests.viewer.stage import press

Image = pytest.importorskip("PIL.Image", reason="pillow is missing: make lab")

pytestmark = needs_chromium

SIZE = (900, 600)
CROWD = "globalThis.wayfarer.crowd"


@pytest.fixture(scope="module", autouse=True)
def opened(page: Page) -> None:
    page.call("Page.navigate", url=f"{page.url}/?detail=low&scene=")
    page.wait_for(f"globalThis.wayfarer?.stage.renderer && {CONNECTION} === 'open'", 60)


def hips(page: Page) -> np.ndarray:
    """Places of all people on the floor [people, 2]."""
    return np.array(page.evaluate(f"{CROWD}.people.map(({{ x, z }}) => [x, z])"))


def picture(page: Page) -> np.ndarray:
    """The page as it is seen [H, W, 3]."""
    return np.asarray(Image.open(io.BytesIO(page.screenshot())).convert("RGB")).astype(int)


def add_sixteen(page: Page) -> None:
    """A busy machine refuses this many for a while, and the page reports that."""
    end = time.monotonic() + 120
    while page.evaluate(f"{CROWD}.members.size") == 0 and time.monotonic() < end:
        page.evaluate("document.querySelector('#add-many').click()")
        time.sleep(2)
    page.problems[:] = [problem for problem in page.problems if "429" not in problem]


# the point of the ground, in CSS pixels, that is farthest from everybody as seen from above
FREE_GROUND = """(() => {
  const { camera, controls } = globalThis.wayfarer.stage;
  controls.target.set(0, 0, 0);
  camera.position.set(0, 14, 8);
  controls.update();
  camera.updateMatrixWorld();
  const eye = camera.position;
  const clearance = ({ x, z }) => Math.min(...globalThis.wayfarer.crowd.people.flatMap((person) =>
    [0, 0.5, 1, 1.5, 2].map((height) => height / eye.y).map((part) => Math.hypot(
      x + (eye.x - x) * part - person.x, z + (eye.z - z) * part - person.z))));
  const places = [];
  for (let x = -6; x <= 6; x += 0.5) {
    for (let z = -6; z <= 6; z += 0.5) {
      const point = eye.clone().set(x, 0, z).project(camera);
      const [u, v] = [(point.x + 1) / 2 * innerWidth, (1 - point.y) / 2 * innerHeight];
      if (document.elementFromPoint(u, v)?.tagName !== "CANVAS") continue;
      places.push({ u, v, clear: clearance({ x, z }) });
    }
  }
  const { u, v } = places.sort((a, b) => b.clear - a.clear)[0];
  return [u, v];
})()"""


def send_everybody(page: Page) -> None:
    """Click on the ground where nobody stands: on a person, a click selects."""
    if page.evaluate("document.querySelector('#follow').checked"):
        press(page, "f")
    page.evaluate("document.querySelector('input[value=all]').click()")
    page.click(*page.evaluate(FREE_GROUND))
    page.wait_for(f"{CROWD}.people.some((person) => person.ahead.length > 0)")


def test_sixteen_people_of_differing_shape_appear(page: Page):
    empty = picture(page)
    add_sixteen(page)
    seen = f"{CROWD}.people.filter((person) => person.shown).length"
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
    send_everybody(page)
    # a person near it may have reached it before the page is asked
    sent = "person.passed + person.ahead.length === 1"
    page.wait_for(f"{CROWD}.people.filter((person) => {sent}).length === 16")
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
    page.drag((500, 260), (580, 260), shift=True)
    # a person near the first goal may have passed it before the second one exists
    page.wait_for(f"{ahead}.every((goals) => goals.at(-1)?.heading !== undefined)")
    page.wait_for(f"{ahead}.some((goals) => goals.length >= 2)")
    for *_, last in page.evaluate(ahead):
        assert "stop" not in last and last["speed"] == 0.6
        assert abs(last["heading"]) < 3.2
    assert page.evaluate("globalThis.wayfarer.stage.camera.position.toArray()") == camera
    page.wait_for(f"{CROWD}.people.every((person) => Number.isFinite(person.revision))")
    assert page.problems == []


def test_wandering_begins_and_ends_with_its_button(page: Page):
    state = "document.querySelector('#wander').getAttribute('aria-pressed')"
    page.evaluate("document.querySelector('#stop').click()")
    page.wait_for(f"{CROWD}.people.every((person) => person.ahead.length === 0)")
    press(page, "w")
    assert page.evaluate(state) == "true"
    page.wait_for(f"{CROWD}.people.every((person) => person.wanders)")
    walking = f"{CROWD}.people.filter((p) => p.played.state === 'walking').length"
    page.wait_for(f"{walking} >= 8", 60)
    press(page, "w")
    assert page.evaluate(state) == "false"
    page.wait_for(f"{walking} === 0", 60)
    assert page.problems == []


def test_a_lost_connection_is_made_again_without_a_gap(page: Page):
    page.evaluate(
        "(() => { const { on } = globalThis.wayfarer.player; globalThis.seqs = {};"
        " const chunk = (globalThis.shows ??= on.chunk); on.chunk = (played, found) => {"
        "  (globalThis.seqs[found.alias] ??= []).push(found.seq); chunk(played, found); }; })()"
    )
    page.wait_for("Object.values(seqs).length === 16 && seqs[1].length > 2")
    page.evaluate("globalThis.first = wayfarer.player.header; wayfarer.stream.reconnect()")
    again = "wayfarer.player.header !== first && wayfarer.player.header.resumed"
    page.wait_for(f"{CONNECTION} === 'open' && {again}", 20)
    before = page.evaluate("Math.max(...Object.values(seqs).map((found) => found.length))")
    page.wait_for(f"Object.values(seqs).every((found) => found.length > {before} + 3)")
    for numbers in page.evaluate("Object.values(seqs)"):
        assert numbers == list(range(numbers[0], numbers[0] + len(numbers)))
    assert page.evaluate(f"{CROWD}.members.size") == 16
    assert page.problems == []


def test_a_page_that_was_frozen_is_at_the_present_again_without_a_fast_forward(page: Page):
    session = page.evaluate("wayfarer.session")
    page.evaluate(
        "{ globalThis.seen = []; (function look() { const { moment } = wayfarer.player;"
        " if (moment > 1e9) seen.push([Date.now() / 1000, moment]);"
        " requestAnimationFrame(look); })() }"
    )
    page.freeze(4)
    page.evaluate("seen.length = 0")  # until the stream is back it shows what was last seen
    page.wait_for("seen.length > 1 && seen.at(-1)[0] - seen[0][0] > 2", 90)
    passed, played = np.diff(page.evaluate("seen"), axis=0).T
    gained = played - passed  # a frame may come some milliseconds late, and the next one early
    jumps = gained > 0.1
    assert jumps.sum() <= 2, jumps  # to the present, and again if the first message came late
    assert gained[~jumps].sum() < 0.06 * passed.sum() + 0.05  # it plays 5 % faster at most
    assert page.evaluate(f"[{CROWD}.members.size, wayfarer.session]") == [16, session]
    assert all("Back-Forward Cache" in problem for problem in page.problems)  # it closed the socket
    page.problems.clear()


def test_people_are_selected_followed_and_removed_with_the_keyboard(page: Page):
    page.evaluate(
        "(() => { const list = document.querySelector('#selected');"
        " list.selectedIndex = 3; list.dispatchEvent(new Event('change')); })()"
    )
    assert page.evaluate(f"{CROWD}.people.filter((p) => p.marker?.visible).length") == 1
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
        f"globalThis.ids = {CROWD}.people.map((person) => person.agent.id);"
        f"{CROWD}.people.forEach((person) => {{ person.agent.id = 'nobody'; }});"
        "document.querySelector('#stop').click()"
    )
    page.wait_for("document.querySelector('#messages').textContent.includes('nobody')")
    page.evaluate(f"{CROWD}.people.forEach((person, k) => {{ person.agent.id = ids[k]; }})")
    page.problems.clear()  # the browser logs the 404 itself


def test_events_are_mentioned(page: Page):
    page.evaluate(
        "(() => { const list = document.querySelector('#selected'); list.selectedIndex = 1;"
        " list.dispatchEvent(new Event('change'));"
        f" const {{ x, z }} = {CROWD}.people[0];"
        " wayfarer.tools.send({ x: x + 1, y: 0, z }); })()"
    )
    page.wait_for("document.querySelector('#news').textContent.includes('has reached')", 60)
    assert page.evaluate("document.querySelector('#news').children.length") <= 4
    page.wait_for(
        "/^(connected|busy)$/.test(document.querySelector('#connection').textContent)", 10
    )


def call(method: str, url: str, body: object = None) -> dict:
    headers = {"content-type": "application/json"}
    request = Request(url, json.dumps(body).encode(), headers, method=method)
    with urlopen(request) as answer:
        return json.load(answer)


def test_a_session_of_a_program_is_shown_and_outlives_the_page(page: Page):
    url = page.evaluate("location.origin")
    page.call("Page.navigate", url="about:blank")  # its people make room
    api = f"{url}/v1/sessions"
    session = call("POST", api, {"lease_s": 120})["session_id"]
    (ada,) = call("POST", f"{api}/{session}/agents", {"agents": [{"name": "Ada"}]})["agents"]
    page.call("Page.navigate", url=f"{url}/?detail=low&scene=&session={session}")
    page.wait_for(f"globalThis.wayfarer && {CONNECTION} === 'open'", 60)
    page.wait_for(f"{CROWD}.people.filter((person) => person.shown).length === 1", 60)
    assert page.evaluate(f"[{CROWD}.people[0].agent.name, globalThis.wayfarer.session]") == [
        "Ada",
        session,
    ]
    page.call("Page.navigate", url=f"{url}/?detail=low&scene=&session=session-nobody")
    page.wait_for("document.querySelector('#messages')?.textContent.includes('nobody')", 60)
    page.wait_for(f"globalThis.wayfarer && {CONNECTION} === 'open'", 60)  # a new session
    assert call("GET", f"{api}/{session}")["agent_ids"] == [ada["agent_id"]]
    page.problems.clear()  # the browser logs the 404 itself
