"""Local mode of the web client: people walk in a page, or in Node, as the server lets them walk.

The server draws a trace with the same seeds and one candidate; the port is held to it frame by
frame, with its clean-up rules (foot lock, postures) and without. In Chromium ten people walk to
goals with the web server shut down.
"""

import functools
import json
import logging
import shutil
import subprocess
import sys
import threading
import time
from dataclasses import fields, replace
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import numpy as np
import pytest

from tests.viewer.chromium import Page, find_chromium, needs_chromium
from wayfarer.body.rotation import quaternion_from_rotvec
from wayfarer.engines.onnx_engine import OnnxEngine
from wayfarer.model_bundle import DEFAULT_MODEL, START_POSES, load_bodies, load_models
from wayfarer.spec import NEW_FRAMES, POSED_JOINTS, SEED_FRAMES, STEP_SECONDS
from wayfarer.world.agents.agent import AgentSpec, SessionSpec
from wayfarer.world.agents.goal import Goal, GoalColumns
from wayfarer.world.agents.heading import facing_at, facing_of
from wayfarer.world.agents.slots import Gait, Mode, Motion, Seeds
from wayfarer.world.agents.spawn import Spawner, load_start_poses
from wayfarer.world.agents.style import draws, manner, sets_off, stride
from wayfarer.world.goals.commands import Path as GoalPath
from wayfarer.world.goals.commands import Stop
from wayfarer.world.goals.steering import Steering
from wayfarer.world.output.legs import KNEES, Legs, measure_legs, pose_legs
from wayfarer.world.output.quaternion import multiply
from wayfarer.world.output.twobone import MOVED, move_feet
from wayfarer.world.stepping.guards import fallen, got_up, smoothed
from wayfarer.world.stepping.mirror import is_mirrored
from wayfarer.world.stepping.settings import WorldSettings
from wayfarer.world.world import World

LOG = logging.getLogger(__name__)
FOLDER = Path(__file__).parents[2] / "clients" / "web"
RUNTIME = FOLDER / "node_modules" / "onnxruntime-web" / "dist"
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not shutil.which("node"), reason="needs node: apt-get install nodejs"),
    pytest.mark.skipif(
        not RUNTIME.is_dir(), reason="needs onnxruntime-web: cd clients/web && npm ci"
    ),
]

SECONDS = 30.0
PEOPLE = (
    AgentSpec("female", heading=0.3, noise_seed=3),
    AgentSpec("male", tuple(np.linspace(-1, 1, 10).tolist()), (2, 1), -1.0, 12345678901234567),
    AgentSpec("female", (0.5,) * 10, (-3, 0), 2.0, 7),
)
COMMANDS = (  # seconds, person, goals; none: stop
    (0.5, 0, [{"x": 3, "y": 4}]),
    (0.5, 1, [{"x": 0, "y": -2, "stop": False},
              {"x": -3, "y": -3, "speed": 1.0, "heading": 1.0, "dwell": 1.0}, {"x": 0, "y": 3}]),
    (1.03, 2, [{"x": -6, "y": 2, "speed": 1.5}]),
    (7.0, 0, [{"x": -2, "y": 1, "heading": 0.5}]),
    (9.5, 2, [{"x": -5, "y": 1, "strafe": True, "heading": 0.0, "speed": 0.5}]),
    (16.0, 0, [{"x": 8, "y": 1, "speed": 1.4}]),
    (18.31, 0, []),
    (20.0, 2, [{"x": 5, "y": 5, "speed": 1.3}]),
    (21.0, 1, [{"x": 1, "y": 1}]),
)  # fmt: skip


@pytest.fixture(scope="module")
def demo(tmp_path_factory):
    """What `make demo` writes, where onnx is installed and torch is not."""
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
    """The motion model as `wayfarer export --for web` writes it."""
    size = sum(file.stat().st_size for file in (demo / "people").iterdir())
    assert size < 25e6, f"{size / 1e6:.1f} MB to download for both genders"
    return demo / "people"


def traced() -> dict:
    """What a world of the server sends to these people with these commands, one candidate.

    Everybody is there twice: with foot lock and postures, and as the model moves them.
    """
    settings = WorldSettings(steering=Steering().with_search(candidates=1), phases=1)
    engine = OnnxEngine(load_models(DEFAULT_MODEL), 1)
    world = World(engine, load_bodies("anny52"), load_start_poses(START_POSES), settings)
    session = world.create_session(SessionSpec(lock_step=True), now=0.0).session_id
    specs = [*PEOPLE, *(replace(spec, foot_lock=False) for spec in PEOPLE)]
    commands = [(at, who + twin, goals) for at, who, goals in COMMANDS for twin in (0, len(PEOPLE))]
    agents = world.create_agents(session, specs, now=0.0)
    numbers = {agent.agent_id: number for number, agent in enumerate(agents)}
    sent: list[list[dict]] = [[] for _ in agents]

    def run(until: float) -> None:
        for chunk in world.advance(until):
            sent[numbers[chunk.agent_id]].append(
                {
                    "seq": chunk.seq,
                    "flags": int(chunk.flags),
                    "state": str(chunk.state),
                    "waypoint": chunk.waypoint,
                    "translation": chunk.translation.ravel().tolist(),
                    "rotations": chunk.rotations.ravel().tolist(),
                    "contacts": chunk.contacts.astype(int).ravel().tolist(),
                }
            )

    for at, who, goals in commands:
        run(at)
        places = [
            Goal((g["x"], g["y"], 0.0), **{k: g[k] for k in g if k not in "xy"}) for g in goals
        ]
        world.give(agents[who].agent_id, GoalPath(tuple(places)) if places else Stop(), now=at)
    run(SECONDS)
    return {
        "seconds": SECONDS,
        "people": [
            {
                "gender": spec.gender,
                "betas": spec.betas,
                "x": spec.position[0],
                "y": spec.position[1],
                "heading": spec.heading,
                "seed": str(spec.noise_seed),
                "footLock": spec.foot_lock,
            }
            for spec in specs
        ],
        "commands": [{"at": at, "who": who, "goals": goals} for at, who, goals in commands],
        "chunks": sent,
    }


def node(script: str, *words: object) -> str:
    command = ["node", FOLDER / "test" / script, *words]
    done = subprocess.run(
        list(map(str, command)), cwd=FOLDER, capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_frames_are_the_servers(exported, tmp_path):
    trace = tmp_path / "trace.json"
    trace.write_text(json.dumps(traced()))
    found = json.loads(node("local_trace.js", exported, trace))
    assert len(found["people"]) == 2 * len(PEOPLE)
    for person in found["people"]:
        assert person["chunks"][0] == person["chunks"][1] >= (SECONDS - 1) / STEP_SECONDS
        LOG.info("hips %.4f mm, turns %.1e", 1000 * person["hips"], person["turns"])
        assert person["hips"] < 1e-3 and person["turns"] < 1e-3
        assert person["otherStates"] == person["otherNotes"] == person["resets"] == 0
        assert person["otherContacts"] <= 1  # by thresholds that the last digit may cross
    each = found["milliseconds"] / found["rows"]
    LOG.info("%d steps of people in %d calls: %.1f ms each", found["rows"], found["calls"], each)


def test_people_are_drawn_from_their_seeds_as_on_the_server(tmp_path):
    seeds = np.random.default_rng(0).integers(0, 2**64, 200, np.uint64)
    seeds[:4] = 0, 1, 2, 2**64 - 1
    file = tmp_path / "seeds.json"
    file.write_text(json.dumps([str(seed) for seed in seeds]))
    found = json.loads(node("local_random.js", file))
    np.testing.assert_allclose(
        [one["manner"] for one in found], manner(seeds), rtol=1e-6, atol=1e-7
    )
    assert [one["mirrored"] for one in found] == is_mirrored(seeds).tolist()
    habits = np.array([one["habits"] for one in found], np.float32)
    np.testing.assert_array_equal(habits, np.stack(draws(seeds, 12), -1))
    slow = np.zeros(len(seeds))
    low, high = -0.05, 0.11
    np.testing.assert_allclose(
        [low + (high - low) * one["stride"] for one in found], stride(seeds, slow), atol=1e-7
    )
    chunk = np.full(len(seeds), 4)
    ready = [(4 + one["reaction"]) % 3 == 0 for one in found]
    assert ready == sets_off(seeds, chunk, 3).tolist()


def test_guards_repair_as_the_servers_do(tmp_path):
    """Steps that no body takes: joints that jump, twisted knees, signs that flip, falls."""
    rng = np.random.default_rng(3)
    bodies, poses = load_bodies("anny52"), load_start_poses(START_POSES)
    stands = [Spawner(bodies, poses).stand(AgentSpec(noise_seed=k)) for k in range(12)]
    seeds = Motion.join([stands[k] for k in rng.permutation(12)]).seed
    legs = Legs.join([measure_legs(bodies["female"], np.zeros(10))] * 12)
    turns = np.repeat(seeds.rotations[:, -1:], 8, axis=1)
    turns += rng.normal(size=turns.shape).astype(np.float32) * np.linspace(0, 1.2, 12)[
        :, None, None, None
    ].astype(np.float32)
    turns /= np.linalg.norm(turns, axis=-1, keepdims=True)
    bend = np.float32([[-np.sin(np.radians(4))], [0], [0], [np.cos(np.radians(4))]])
    turns[0, 3:, KNEES[0]] = multiply(bend, turns[0, 3:, KNEES[0]].T).T  # by 8 degrees at once
    turns[[0, 3], 4:] *= -1  # the same turns
    hips = np.repeat(seeds.translation[:, -1:], 8, axis=1)
    hips[5, -1, 2] = 0.4
    target = Motion.join(stands)
    fell = fallen(hips, turns, legs)
    repaired = smoothed(seeds, turns, legs)
    steps = [
        {
            "seed": {"translation": seeds.translation[k], "rotations": seeds.rotations[k]},
            "stand": {
                "translation": target.seed.translation[k].copy(),
                "rotations": target.seed.rotations[k].copy(),
            },
            "translation": hips[k],
            "rotations": turns[k],
        }
        for k in range(12)
    ]
    file = tmp_path / "steps.json"
    heel = float(legs.sole_of_ankle[0, :, 0, 2].mean())
    down = float((legs.hip + legs.knee + legs.ankle)[0, :, 2].mean())
    measured = {"ankle": legs.ankle[0].ravel(), "standing": -down - heel}
    file.write_text(json.dumps({"legs": measured, "steps": steps}, default=_flat))
    found = json.loads(node("local_guards.js", file))
    up = got_up(seeds, target)  # changes the stands' arms
    assert fell.any() and not fell.all()
    assert np.flatnonzero((repaired != turns)[0].any((0, 2))).tolist() == [KNEES[0]]
    for k, one in enumerate(found):
        assert one["fallen"] == fell[k]
        for name, wanted in (
            ("smoothed", repaired[k]),
            ("upTranslation", up[0][k]),
            ("upRotations", up[1][k]),
            ("stand", target.seed.rotations[k]),
        ):
            np.testing.assert_allclose(one[name], wanted.ravel(), atol=2e-4, err_msg=name)


def random_gaits(count: int) -> tuple[Gait, Seeds, GoalColumns, np.ndarray]:
    """People who do anything near a goal of any kind, a tenth without one; and who is ready."""
    rng = np.random.default_rng(6)

    def some(share: float) -> np.ndarray:
        return rng.random(count) < share

    def headings() -> np.ndarray:
        return np.stack([facing_at(a) for a in rng.uniform(-np.pi, np.pi, count)])

    gait, seed, goals = Gait.empty(count), Seeds.empty(count), GoalColumns.empty(count)
    gait.mode[:] = rng.integers(0, len(Mode), count)
    gait.speed[:] = rng.choice([0.1, 0.5, 1.5], count) * rng.random(count)
    gait.slow_seconds[:] = 0.2 * rng.integers(0, 4, count)
    gait.arrived[:], gait.planted[:] = some(0.5), some(0.5)
    gait.stop_place[:], gait.stop_facing[:] = rng.normal(size=(count, 2)), headings()
    seed.translation[:] = 0.3 * rng.normal(size=(count, SEED_FRAMES, 3))
    half = rng.uniform(-np.pi, np.pi, count) / 2
    root = np.stack([0 * half, 0 * half, np.sin(half), np.cos(half)], -1)
    seed.rotations[:, :, 0] = root[:, None]
    goals.given[:], goals.strafe[:], goals.through[:] = True, some(0.3), some(0.2)
    goals.position[:, :2] = 0.5 * rng.normal(size=(count, 2))
    goals.radius[:], goals.speed[:] = rng.uniform(0.1, 0.6, count), rng.uniform(0.2, 2, count)
    goals.heading[:] = headings() * some(0.5)[:, None]
    goals.strafe &= goals.heading.any(-1)
    goals.put(np.arange(count // 10), GoalColumns.empty(count // 10))
    return gait, seed, goals, some(0.7)


def test_people_decide_and_feet_are_moved_as_on_the_server(tmp_path):
    count, steering = 3000, Steering()
    gait, seed, goals, ready = random_gaits(count)
    facing = facing_of(seed.rotations[:, -1, 0])
    rows = [
        {
            "gait": {
                "mode": int(gait.mode[k]), "speed": float(gait.speed[k]),
                "slowSeconds": float(gait.slow_seconds[k]), "arrived": bool(gait.arrived[k]),
                "planted": bool(gait.planted[k]), "stopPlace": gait.stop_place[k],
                "stopFacing": gait.stop_facing[k],
            },
            "start": {
                "hips": seed.translation[k, -1, :2], "first": seed.translation[k, 0, :2],
                "facing": facing[k],
            },
            "goal": {
                "given": bool(goals.given[k]), "place": goals.position[k, :2],
                "radius": float(goals.radius[k]), "speed": float(goals.speed[k]),
                "heading": goals.heading[k] if goals.heading[k].any() else None,
                "strafe": bool(goals.strafe[k]), "through": bool(goals.through[k]),
            },
            "ready": bool(ready[k]),
        }
        for k in range(count)
    ]  # fmt: skip
    people, rng = 60, np.random.default_rng(7)
    bends = rng.normal(size=(people, 1, POSED_JOINTS, 3)) * np.radians(20)
    bends[:, :, KNEES, 0] -= rng.uniform(-0.6, 1.5, (people, 1, 2))  # some beyond straight
    turns = quaternion_from_rotvec(bends + rng.normal(0, 0.03, (people, NEW_FRAMES, 1, 3)))
    turns = turns.astype(np.float32)
    hips = rng.normal([0, 0, 0.9], 0.05, (people, NEW_FRAMES, 3)).astype(np.float32)
    shift = rng.normal(0, 0.05, (people, NEW_FRAMES, 2, 3)).astype(np.float32)
    turn = rng.normal(0, 0.2, (people, NEW_FRAMES, 2)).astype(np.float32)
    legs = measure_legs(load_bodies("anny52")["female"], np.zeros(10))
    names = {
        "sole_of_ankle": "soleOfAnkle",
        "sole_of_ball": "soleOfBall",
        "ball_share": "ballShare",
    }
    given = {
        "constants": {
            f.name: {"value": getattr(steering, f.name)}
            for f in fields(steering)
            if f.name != "searches"
        },
        "gaits": rows,
        "legs": {
            names.get(name, name): getattr(legs, name)[0]
            for name in ("hip", "knee", "ankle", "ball", *names)
        },
        "poses": [
            {"translation": hips[k], "rotations": turns[k], "shift": shift[k], "turn": turn[k]}
            for k in range(people)
        ],
    }
    file = tmp_path / "rows.json"
    file.write_text(json.dumps(given, default=_flat))
    found = json.loads(node("local_rules.js", file))

    after = steering.decide(gait, seed, goals, ready)
    never = replace(steering, pausing=0).decide(gait, seed, goals, ready)
    assert (after.mode != never.mode).sum() > 5, "somebody pauses"
    assert len(set(after.mode)) == len(Mode)
    assert [one["mode"] for one in found["gaits"]] == after.mode.tolist()
    assert [one["planted"] for one in found["gaits"]] == after.planted.tolist()
    numbers = np.column_stack([after.slow_seconds, after.stop_place, after.stop_facing])
    np.testing.assert_allclose([one["numbers"] for one in found["gaits"]], numbers, atol=1e-5)

    moved, legs = turns.copy(), legs.take(np.zeros(people, int))
    moved[:, :, MOVED] = move_feet(pose_legs(legs, hips, turns), hips, shift.T, turn.T)
    off = np.abs(np.array(found["poses"]) - moved.reshape(people, -1)).max()
    LOG.info("feet: off by %.1e", off)
    assert off < 1e-3


def _flat(values: object) -> list[float]:
    return np.asarray(values).ravel().tolist()


def test_a_model_that_fails_is_told(exported):
    """People who are not moved any more do not stand there as if nothing had happened."""
    said = json.loads(node("local_failure.js", exported))
    assert said == [{"kind": "failed", "reason": "the graph cannot be run"}]


class _Quiet(SimpleHTTPRequestHandler):
    def log_message(self, *_: object) -> None:
        pass


class _Files(_Quiet):
    """Serves the page, the client, the runtime of the npm package and the export."""

    def __init__(self, exported: Path, *args: object) -> None:
        self.folders = {
            "/client/": FOLDER / "src",
            "/onnxruntime/": RUNTIME,
            "/model/": exported,
            "/": FOLDER / "test",
        }
        super().__init__(*args)  # type: ignore[arg-type]

    def translate_path(self, path: str) -> str:
        path = path.partition("?")[0]
        prefix = next(name for name in self.folders if path.startswith(name))
        return str(self.folders[prefix] / path.removeprefix(prefix))


@needs_chromium
def test_ten_people_walk_to_goals_with_no_server(exported, tmp_path):
    server = ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(_Files, exported))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    address = f"http://127.0.0.1:{server.server_address[1]}/local_page.html"
    with Page(find_chromium(), tmp_path / "profile") as page:
        page.call("Page.navigate", url=address)
        page.wait_for("globalThis.log?.ready || globalThis.log?.failed.length", 120)
        assert page.evaluate("log.failed") == []
        server.shutdown()
        server.server_close()  # from here on nothing can be loaded
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
    """People wander; a click sends the nearest one, who gets there; nothing more is loaded."""
    files = functools.partial(_Quiet, directory=str(demo))
    server = ThreadingHTTPServer(("127.0.0.1", 0), files)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    with Page(find_chromium(), tmp_path / "profile") as page:
        page.call("Page.navigate", url=f"http://127.0.0.1:{server.server_address[1]}/")
        page.wait_for(
            "globalThis.demo?.people.size === 10"
            " && [...demo.people.values()].every(({ played, body }) => played.shown && body)",
            120,
        )
        server.shutdown()
        server.server_close()
        page.click(500, 400)
        page.wait_for("document.querySelector('#state').textContent.endsWith('goes there')")
        sent = page.evaluate("demo.send({ x: 1, z: 2 }).alias")
        place = f"(() => {{ const [x, y, z] = demo.people.get({sent}).played.frame; "
        page.wait_for(place + "return Math.hypot(x - 1, z - 2) < 0.5; })()", 120)
        assert not page.problems


def test_a_demo_replaces_nobodys_files(tmp_path):
    (tmp_path / "thesis.txt").write_text("mine")
    words = [sys.executable, "-m", "wayfarer_lab.demo", str(tmp_path)]
    done = subprocess.run(words, capture_output=True, text=True, timeout=60)
    assert done.returncode == 1
    assert "holds other files; name another folder" in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.txt"]


@needs_chromium
def test_a_page_hears_what_is_wrong(tmp_path):
    nothing = tmp_path / "none"
    nothing.mkdir()
    server = ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(_Files, nothing))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    with Page(find_chromium(), tmp_path / "profile") as page:
        url = f"http://127.0.0.1:{server.server_address[1]}/local_page.html"
        page.call("Page.navigate", url=url)
        page.wait_for("globalThis.log?.failed.length", 30)
        (said,) = page.evaluate("log.failed")
        assert "/model/wayfarer.json: HTTP 404" in said
    server.shutdown()
    server.server_close()
