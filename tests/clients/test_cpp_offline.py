"""clients/cpp/examples/offline: a person walks without a server, in C++, as on the server.

Held to two references. *The same rules*: the server's own steering and engine, step by step,
without what the example leaves out; the trace is the same to 0.1 mm. *The whole server*: a
lock-step world with the same start pose and goal. What that adds shows as a difference of paths
(`pytest --log-cli-level=INFO` tells it, 2 to 24 cm):

    manner     people move in a way of their own (here without: noise 0)
    planting   feet that stand are kept in place, which moves and turns the body by a little
    strides    steps are shorter or longer by up to a tenth
    trim       the speed that is asked for follows the speed that was walked
    mirror     half of all people are the mirror image of what the model does
    reactions  people set off up to 0.6 s after they were asked to
    output     foot lock and postures change what is sent, not where people go
"""

import csv
import io
import logging
import os
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import onnxruntime
import pytest

from wayfarer.engines.onnx_engine import OnnxEngine
from wayfarer.model_bundle import DEFAULT_MODEL, START_POSES, load_bodies, load_models
from wayfarer.spec import FPS, NEW_FRAMES, SEED_FRAMES, STEP_SECONDS
from wayfarer.world.agents.agent import AgentSpec, SessionSpec
from wayfarer.world.agents.goal import Goal, goal_columns
from wayfarer.world.agents.heading import heading_of
from wayfarer.world.agents.slots import Mode, Seeds
from wayfarer.world.agents.spawn import Spawner, load_start_poses
from wayfarer.world.goals.steering import Steering, default_searches, observe
from wayfarer.world.stepping.batch import assemble
from wayfarer.world.stepping.settings import WorldSettings
from wayfarer.world.world import World

LOG = logging.getLogger(__name__)
FOLDER = Path(__file__).parents[2] / "clients" / "cpp" / "examples"
INCLUDE = next(
    (
        folder
        for name in (os.environ.get("ONNXRUNTIME_INCLUDE"), "/usr/include/onnxruntime")
        if name and (folder := Path(name), folder / "onnxruntime_c_api.h")[1].exists()
    ),
    None,
)
LIBRARY = next(Path(onnxruntime.__file__).parent.glob("capi/libonnxruntime.so.*"), None)

missing = [tool for tool in ("cmake", "ninja", "g++") if not shutil.which(tool)]
if not Path("/usr/include/nlohmann/json.hpp").exists():
    missing.append("nlohmann-json3-dev")
if INCLUDE is None:
    missing.append("ONNXRUNTIME_INCLUDE (tests/clients/get_onnxruntime.sh FOLDER, or Debian 13's "
                   "libonnxruntime-dev)")  # fmt: skip
if LIBRARY is None:
    missing.append("a pip package of onnxruntime with its library")
pytestmark = pytest.mark.skipif(bool(missing), reason=f"needs {', '.join(missing)}")

GENDER, SECONDS = "female", 7.0
WALKS = {  # pose, heading, goal, speed
    "ahead": (0, 0.0, (0.0, 4.0), 1.2),
    "behind": (7, 0.4, (1.0, -3.0), 1.0),
    "aside": (20, -1.0, (2.0, 1.0), 1.2),  # slows by itself, and stops there: `pausing`
}


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    pytest.importorskip("onnx", reason="needs onnx: pip install './lab[engines]'")
    out = tmp_path_factory.mktemp("engines")
    command = "import sys; sys.modules['torch'] = None; from wayfarer.cli import main; main()"
    words = ["export", "--for", "engines", "--out", out]
    subprocess.run([sys.executable, "-c", command, *words], check=True, timeout=300)
    return out


@pytest.fixture(scope="module")
def program(tmp_path_factory):
    """Built as its CMakeLists.txt tells, with the library of the pip package."""
    folder = tmp_path_factory.mktemp("build")
    (folder / "libonnxruntime.so.1").symlink_to(LIBRARY)  # the name that it is linked by
    said = [
        f"-DONNXRUNTIME_INCLUDE={INCLUDE}",
        f"-DONNXRUNTIME_LIBRARY={folder}/libonnxruntime.so.1",
    ]
    flags = "-DCMAKE_CXX_FLAGS=-Wall -Wextra -Wpedantic -Werror"
    commands = (["-S", FOLDER, "-B", folder, "-G", "Ninja", flags, *said], ["--build", folder])
    for words in commands:
        done = subprocess.run(["cmake", *map(str, words)], capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr
    return folder / "offline"


def walked(program: Path, exported: Path, walk: str) -> list[dict[str, str]]:
    pose, heading, (x, y), speed = WALKS[walk]
    options = ["--pose", pose, "--heading", heading, "--goal", f"{x},{y}", "--speed", speed]
    words = [program, exported, "--seconds", SECONDS, *options]
    done = subprocess.run([str(word) for word in words], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    return list(csv.DictReader(io.StringIO(done.stdout)))


def places(rows: list[dict[str, str]]) -> np.ndarray:
    return np.array([[float(row[axis]) for axis in "xyz"] for row in rows])


def without_manner() -> Steering:
    searches = {m: replace(s, candidates=1, manner=0.0) for m, s in default_searches().items()}
    return Steering(searches=searches)


def by_the_servers_steering(walk: str) -> tuple[np.ndarray, list[str], np.ndarray]:
    """Places [F, 3], modes and headings [F]: the server's functions without its corrections."""
    pose, heading, (x, y), speed = WALKS[walk]
    steering, engine = without_manner(), OnnxEngine(load_models(DEFAULT_MODEL), 1)
    spawner = Spawner(load_bodies("anny52"), load_start_poses(START_POSES))
    motion = spawner.stand(AgentSpec(GENDER, heading=heading, noise_seed=pose))
    seed, gait = motion.seed, motion.gait
    goals = goal_columns([Goal((x, y, 0.0), speed=speed)], (0.0, 0.0))
    gait.mode[:] = Mode.WALKING
    gait.planted[:] = False  # nobody waits
    still = np.zeros((1, 1, 128), np.float32)
    shown, modes, headings = [], [], []
    for _ in range(round(SECONDS / STEP_SECONDS)):
        gait = steering.decide(gait, seed, goals)
        if gait.mode[0] == Mode.STANDING and gait.arrived[0]:
            frames = np.repeat(seed.translation[:, -1:], NEW_FRAMES, 1)
            turns = np.repeat(seed.rotations[:, -1:], NEW_FRAMES, 1)
            gait.speed[:] = 0
        else:
            betas, none = np.zeros((1, 10), np.float32), np.zeros(1, np.uint64)
            out = engine.step(GENDER, assemble(seed, betas, gait, goals, still, none, steering))
            frames, turns = out.translation, out.rotations
            gait = replace(
                observe(gait, seed.translation[:, -1], frames, goals), trim=gait.trim * 0
            )
            seed = Seeds(out.next_seed_markers, frames[:, -SEED_FRAMES:], turns[:, -SEED_FRAMES:])
        shown.append(frames[0])
        modes += [Mode(gait.mode[0]).name] * NEW_FRAMES
        headings += [heading_of(turn) for turn in turns[0, :, 0]]
    return np.concatenate(shown), modes, np.array(headings)


def by_the_server(walk: str) -> np.ndarray:
    """Places [F, 3] that a world of the server sends, from the start pose of the same number."""
    pose, heading, (x, y), speed = WALKS[walk]
    settings = WorldSettings(steering=Steering().with_search(candidates=1))
    engine = OnnxEngine(load_models(DEFAULT_MODEL), 1)
    world = World(engine, load_bodies("anny52"), load_start_poses(START_POSES), settings)
    session = world.create_session(SessionSpec(lock_step=True), now=0.0).session_id
    spec = AgentSpec(GENDER, heading=heading, noise_seed=pose)
    (agent,) = world.create_agents(session, [spec], now=0.0)
    world.give(agent.agent_id, Goal((x, y, 0.0), speed=speed), now=0.0)
    chunks = list(world.advance(SECONDS + 1.0))
    return np.concatenate([chunk.translation for chunk in chunks])


@pytest.mark.parametrize("walk", WALKS)
def test_its_trace_is_the_servers_rules(program, exported, walk):
    rows = walked(program, exported, walk)
    shown, modes, headings = by_the_servers_steering(walk)
    assert len(rows) == len(shown) == round(SECONDS * FPS)
    assert [row["mode"] for row in rows] == modes
    off = np.abs(places(rows) - shown).max()
    turned = np.abs(np.unwrap([float(row["heading"]) for row in rows]) - np.unwrap(headings)).max()
    LOG.info("%s: off by %.4f mm, %.4f degrees", walk, 1000 * off, np.degrees(turned))
    assert off < 1e-4 and turned < 1e-3
    assert modes[-1] == "STANDING" and rows[-1]["arrived"] == "1"


@pytest.mark.parametrize("walk", WALKS)
def test_it_goes_where_the_server_goes(program, exported, walk):
    own, server = places(walked(program, exported, walk)), by_the_server(walk)
    goal = np.array(WALKS[walk][2])

    def arrival(path: np.ndarray) -> float:
        near = np.linalg.norm(path[:, :2] - goal, axis=1) <= Goal((0, 0, 0)).radius
        assert near.any()
        return float(near.argmax()) / FPS

    # from each frame of the example to the nearest place of the server's path
    aside = np.linalg.norm(own[:, None, :2] - server[None, :, :2], axis=-1).min(1).max()
    ends = np.linalg.norm(own[-1, :2] - server[-1, :2])
    later = arrival(server) - arrival(own)
    figures = walk, 100 * aside, 100 * ends, later
    LOG.info("%s: paths %.0f cm apart, ends %.0f cm; server arrives %.2f s later", *figures)
    assert aside < 0.5 and ends < 0.3 and abs(later) < 2.0


def test_it_says_what_is_wrong(program, exported, tmp_path):
    def refused(*words: object) -> str:
        done = subprocess.run([str(w) for w in (program, *words)], capture_output=True, text=True)
        assert done.returncode == 1 and not done.stdout
        return done.stderr

    assert "usage: offline FOLDER" in refused()
    assert "holds no wayfarer.json" in refused(tmp_path)
    assert "--goal 3: not X,Y" in refused(exported, "--goal", "3")
    assert "--speed fast: no number" in refused(exported, "--speed", "fast")
    assert "there are 26 start poses" in refused(exported, "--pose", "26")
    for file in exported.iterdir():
        (tmp_path / file.name).write_bytes(file.read_bytes()[:9000])
    (tmp_path / "wayfarer.json").write_bytes((exported / "wayfarer.json").read_bytes())
    assert "body_female.bin: is cut short" in refused(tmp_path)
    (tmp_path / "body_female.bin").write_bytes((exported / "body_female.bin").read_bytes())
    assert "onnxruntime: " in refused(tmp_path)
