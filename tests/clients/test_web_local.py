"""Local mode of the web client: people walk in a page, or in Node, as the server lets them walk.

The server draws a trace with the same seeds and one candidate. The port must follow it frame by
frame, with its clean-up rules (foot lock, postures) and without. In Chromium ten people walk to
goals with the web server shut down.
"""

import json
import logging
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from tests.clients.local_traces import PEOPLE, SECONDS, traced
from tests.clients.web_scripts import FOLDER, node
from tests.programs import run_program
from tests.viewer.characters import MANNEQUIN
from tests.viewer.chromium import Page, needs_chromium
from tests.viewer.threads import main_thread, worker_threads
from tests.web_host import Files, web_host
from wayfarer.navigation.examples import rectangle
from wayfarer.navigation.scene_spec import Box, Floor, SceneSpec
from wayfarer.spec import STEP_SECONDS
from wayfarer.world.agents.agent import AgentSpec
from wayfarer_lab.engine_export.scene import write_scene

LOG = logging.getLogger(__name__)
RUNTIME = FOLDER / "node_modules" / "onnxruntime-web" / "dist"
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not shutil.which("node"), reason="needs node: apt-get install nodejs"),
    pytest.mark.skipif(
        not RUNTIME.is_dir(), reason="needs onnxruntime-web: cd clients/web && npm ci"
    ),
]


@pytest.fixture(scope="module")
def demo(tmp_path_factory):
    """The output of `make demo`, with onnx and without torch."""
    pytest.importorskip("onnx", reason="needs onnx: pip install './lab[engines]'")
    out = tmp_path_factory.mktemp("demo")
    command = (
        "import runpy, sys; sys.modules['torch'] = None; sys.argv = ['demo', sys.argv[1]]; "
        "runpy.run_module('wayfarer_lab.demo', run_name='__main__')"
    )
    subprocess.run([sys.executable, "-c", command, out], check=True, timeout=300)
    return out


@pytest.fixture(scope="module")
def exported(demo):
    """The motion model as `wayfarer export --for web` writes it, packed with gzip."""
    size = sum(file.stat().st_size for file in demo.rglob("*") if file.is_file())
    assert size < 15.5e6, f"the demo has {size / 1e6:.1f} MB"
    return demo / "people"


def test_frames_are_the_servers(exported, drawn, tmp_path):
    trace = tmp_path / "trace.json"
    trace.write_text(json.dumps(drawn))
    found = json.loads(node("local_trace.js", exported, trace))
    assert len(found["people"]) == 2 * len(PEOPLE)
    for person in found["people"]:
        assert person["chunks"][0] == person["chunks"][1] >= (SECONDS - 1) / STEP_SECONDS
        LOG.info("hips %.4f mm, turns %.1e", 1000 * person["hips"], person["turns"])
        # A last digit differs between runtimes; it grows, for each step starts from the last one. A
        # turn of .005 moves a hand, .2 m from its joint, by 1 mm.
        assert person["early"] < 1e-3 and person["hips"] < 1e-3 and person["turns"] < 5e-3
        assert person["otherStates"] == person["otherNotes"] == person["resets"] == 0
        assert person["otherContacts"] <= 1  # by thresholds that the last digit may cross
    each = found["milliseconds"] / found["rows"]
    LOG.info("%d steps of people in %d calls: %.1f ms each", found["rows"], found["calls"], each)


def test_a_model_that_fails_is_told(exported):
    """When people can no longer be moved, that is reported."""
    said = json.loads(node("local_failure.js", exported))
    assert said == [{"kind": "failed", "reason": "the graph cannot be run"}]


def test_people_find_their_ways_and_avoid_each_other_as_on_the_server(exported, tmp_path):
    """Two people meet between boxes, one crosses and walks around a standing one, one shares
    another's goal. There are few people, since each decision may depend on a last digit.
    """
    places = [((-4, 0.2), 0.0), ((4, 0), 3.1), ((3, -4), 1.6), ((-3, 5), 0.0), ((2.1, -1.4), 1.0)]
    specs = [
        AgentSpec(("female", "male")[k % 2], position=place, heading=heading, noise_seed=70 + k)
        for k, (place, heading) in enumerate(places)
    ]
    commands = [
        (0.5, 0, [{"x": 4, "y": 0.5}]),
        (0.5, 1, [{"x": -2, "y": 0, "stop": False}, {"x": -4, "y": -3, "speed": 1.3}]),
        (0.5, 2, [{"x": 0.5, "y": 4}]),
        (0.5, 3, [{"x": 0.5, "y": 4}]),
    ]
    solids = (Box((0.0, 1.2), (2.0, 0.6), 2.0, 0.4), Box((-1.5, -1.2), (0.8, 1.6), 1.0))
    scene = write_scene(SceneSpec((Floor(rectangle(-7, -7, 7, 7)),), solids), tmp_path / "scene")
    trace = tmp_path / "trace.json"
    told = traced(specs, commands, scene, seconds=20.0)  # they may wait for each other
    trace.write_text(json.dumps(told))
    found = json.loads(node("local_trace.js", exported, trace, tmp_path / "scene"))
    assert found["calls"] == told["calls"]  # each sees the others at the same moments
    off = max(person["hips"] for person in found["people"])
    LOG.info("hips %.4f mm, met %s", 1000 * off, found["met"])
    for person, chunks in zip(found["people"], told["chunks"], strict=True):
        assert person["chunks"][0] == person["chunks"][1] == len(chunks) > 0
        assert person["hips"] < 1e-3 and person["otherStates"] == 0
    for chunks, (_, who, goals) in zip(told["chunks"][:-1], commands, strict=True):
        end = np.array(chunks[-1]["translation"][-3:-1])  # they have arrived, not only agreed
        off = np.hypot(*(end - [goals[-1]["x"], goals[-1]["y"]]))
        assert off < (1.0 if who > 1 else 0.5)  # two of them share a goal


def test_people_in_the_way_step_aside_as_on_the_server(exported, tmp_path):
    """Three close a corridor; one lets a walker pass, and returns. Two stand in each other:
    one leaves its place.
    """
    places = [(0, -3), (-0.6, 0), (0, 0), (0.6, 0), (0, -6.5), (0, -6.2)]
    specs = [AgentSpec(position=place, noise_seed=80 + k) for k, place in enumerate(places)]
    commands = [(0.5, 0, [{"x": 0, "y": 3}])]
    scene = write_scene(SceneSpec((Floor(rectangle(-1, -8, 1, 5)),)), tmp_path / "scene")
    told = traced(specs, commands, scene, seconds=12.0)
    (trace := tmp_path / "trace.json").write_text(json.dumps(told))
    found = json.loads(node("local_trace.js", exported, trace, tmp_path / "scene"))
    assert max(person["hips"] for person in found["people"]) < 1e-3
    ways = [np.array([c["translation"][-3:-1] for c in chunks]) for chunks in told["chunks"]]
    off = np.linalg.norm(ways[2], axis=-1)
    assert ways[0][-1, 1] > 2.5 and off.max() > 0.6 and off[-1] < 0.4
    assert np.linalg.norm(ways[5][-1] - ways[4][-1]) > 0.5


class _Files(Files):
    """Serves the page, the client, the runtime of the npm package and the export."""

    def translate_path(self, path: str) -> str:
        folders = {
            "/client/": FOLDER / "src",
            "/onnxruntime/": RUNTIME,
            "/model/": Path(self.directory),
            "/": FOLDER / "test",
        }
        path = path.partition("?")[0]
        prefix = next(name for name in folders if path.startswith(name))
        return str(folders[prefix] / path.removeprefix(prefix))


@needs_chromium
def test_ten_people_walk_to_goals_with_no_server(exported, tmp_path):
    with Page(tmp_path / "profile") as page:
        with web_host(exported, _Files) as url:  # afterwards nothing can be loaded
            page.call("Page.navigate", url=f"{url}/local_page.html")
            page.wait_for("globalThis.log?.ready || globalThis.log?.failed.length", 120)
            assert page.evaluate("log.failed") == []
            assert len(worker_threads(main_thread(page))) == 2  # one for each gender
        before = page.evaluate("performance.getEntriesByType('resource').length")
        page.evaluate(CREATE)
        page.wait_for("log.events.filter(({ kind }) => kind === 'path_done').length === 10", 120)
        time.sleep(0.5)
        figures = page.evaluate("session.figures()")
        places = page.evaluate(PLACES)
        assert page.evaluate("performance.getEntriesByType('resource').length") == before
        assert page.evaluate("log.failed") == [] and not page.problems
        ready, loaded = page.evaluate("log.ready"), page.evaluate("log.loaded")
        underruns = page.evaluate("session.underruns")
    assert len(places) == 10
    for (x, y, z), goal in zip(places, range(10), strict=True):
        assert np.hypot(x - (goal - 4.5), z - 3) < 0.5 and 0.6 < y < 1.2
    each = (figures["graphMs"] + figures["otherMs"]) / figures["rows"]
    LOG.info(
        "%.1f MB, ready in %.1f s; %.2f ms of JS and WASM per person's step, %.2f of it JS: "
        "%.0f people per core; %d underruns, waited %.1f s",
        loaded / 1e6,
        ready / 1e3,
        each,
        figures["otherMs"] / figures["rows"],
        1000 * STEP_SECONDS / each,
        underruns,
        figures["waited"],
    )


CREATE = """(async () => {
  const line = (z) => Array.from({ length: 10 }, (_, k) => ({ x: k - 4.5, z }));
  const made = await session.createAgents(line(0).map((position, k) => (
    { name: `P${k}`, gender: k % 2 ? "male" : "female", position, seed: k })));
  const goals = line(3);
  await Promise.all(made.map(({ agent_id }, k) => session.api.setPath(agent_id, [goals[k]])));
  const picture = () => { session.update(); requestAnimationFrame(picture); };
  picture();
  return made.length;
})()"""
PLACES = "[...session.agents.values()].map(({ frame }) => [...frame.subarray(0, 3)])"


@needs_chromium
def test_the_demo_needs_nothing_but_a_web_host(demo, tmp_path):
    """Up to 50 people and a dropped character wander; a click sends the nearest one, which arrives
    even with the host shut down.
    """
    with Page(tmp_path / "profile") as page:
        with web_host(demo) as url:
            page.call("Page.navigate", url=f"{url}/")
            page.wait_for(
                "globalThis.demo?.people.size === 10"
                " && [...demo.people.values()].every(({ played, body }) => played.shown && body)",
                120,
            )
            page.wait_for(
                "(demo.people.size === 50 || document.querySelector('#more').click())"
                " && [...demo.people.values()].every(({ body }) => body)",
                120,
            )
            # a click has no effect while the previous one is running
            page.wait_for("demo.people.size < 50 || document.querySelector('#fewer').click()", 60)
            page.drop(MANNEQUIN, 500, 400)
            state = "document.querySelector('#state').textContent"
            page.wait_for(f"{state}.includes(' walks, and')", 60)
            dropped = "[...demo.people.values()].find(({ body }) => body?.object)"
            start = page.evaluate(f"[...{dropped}.played.frame]")
            page.wait_for(
                f"(([x, , z]) => Math.hypot(x - {start[0]}, z - {start[2]}) > 0.3)"
                f"({dropped}.played.frame)",
                120,
            )
        page.click(500, 400)
        page.wait_for(f"{state}.endsWith('goes there')")
        sent = page.evaluate("demo.send({ x: 1, z: 5 }).then(({ alias }) => alias)")
        place = f"(() => {{ const [x, y, z] = demo.people.get({sent}).played.frame; "
        page.wait_for(place + "return Math.hypot(x - 1, z - 5) < 0.5; })()", 120)
        assert not page.problems


def test_a_demo_replaces_nobodys_files(tmp_path):
    (tmp_path / "thesis.txt").write_text("mine")
    done = run_program(sys.executable, "-m", "wayfarer_lab.demo", tmp_path, code=1)
    assert "holds other files; name another folder" in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.txt"]


@needs_chromium
def test_a_page_hears_what_is_wrong(tmp_path):
    nothing = tmp_path / "none"
    nothing.mkdir()
    with web_host(nothing, _Files) as url, Page(tmp_path / "profile") as page:
        page.call("Page.navigate", url=f"{url}/local_page.html")
        page.wait_for("globalThis.log?.failed.length", 30)
        (said,) = page.evaluate("log.failed")
        assert "/model/wayfarer.json: HTTP 404" in said
