"""Compiled rules: where their code is kept, and that another text of a rule is other code."""

import importlib.util
import os
import subprocess
import sys
import threading
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from wayfarer.process import compiled
from wayfarer.world.goals.steering import Steering, observe
from wayfarer.world.output.footlock import Planted, lock_feet
from wayfarer.world.stepping.guards import bend_rows
from wayfarer.world.stepping.noise import latents
from wayfarer.world.stepping.righting import Step, right_rows

TEXT = (
    "from wayfarer.process.compiled import compiled\n@compiled\ndef rule(x):\n    return x + {}\n"
)


USING = "@compiled\ndef using(x):\n    return rule(x) + FAR\n"


def loaded(file: Path, more: int):
    file.write_text(TEXT.format(more))
    return executed(file).rule


def executed(file: Path):
    spec = importlib.util.spec_from_file_location("kept_rule", file)
    module = importlib.util.module_from_spec(spec)
    # texts of one size and one second are the same file to Python's own cache
    Path(importlib.util.cache_from_source(str(file))).unlink(missing_ok=True)
    sys.modules["kept_rule"] = module
    spec.loader.exec_module(module)
    return module


def test_code_is_kept_where_the_environment_says_and_for_one_text(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "kept"))
    assert loaded(tmp_path / "rule.py", 1)(1) == 2
    again = loaded(tmp_path / "rule.py", 1)
    assert again(1) == 2 and again.stats.cache_hits
    other = loaded(tmp_path / "rule.py", 2)
    assert other(1) == 3 and not other.stats.cache_hits
    assert len(list((tmp_path / "kept").glob("wayfarer-*"))) == 2


def test_processes_that_start_together_compile_a_rule_once(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "kept"))
    first, second = (loaded(tmp_path / "rule.py", 1) for _ in range(2))
    told, begun, go_on = [], threading.Event(), threading.Event()

    def info(event, **_):
        told.append(event)
        begun.set()
        go_on.wait(10)

    monkeypatch.setattr(compiled, "log", SimpleNamespace(info=info))
    threads = [threading.Thread(target=compiled.warm, args=(rule, 1)) for rule in (first, second)]
    threads[0].start()
    assert begun.wait(10)
    threads[1].start()
    threads[1].join(0.2)
    assert threads[1].is_alive() and not second.stats.cache_misses, "it waits"
    go_on.set()
    for thread in threads:
        thread.join(30)
    assert len(told) == 1 and first.stats.cache_misses and second.stats.cache_hits


def test_code_is_made_anew_when_a_rule_or_a_number_changes_that_it_takes_from_another_file(
    tmp_path, monkeypatch
):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "kept"))
    file = tmp_path / "using.py"
    kept = set()
    for more, far in ((1, 0), (2, 0), (2, 5)):
        sys.modules["used_rule"] = SimpleNamespace(rule=loaded(tmp_path / "used.py", more), FAR=far)
        text = (
            "from wayfarer.process.compiled import compiled\n"
            f"from used_rule import FAR, rule\n{USING}"
        )
        file.write_text(text)
        using = executed(file).using
        assert using(1) == 1 + more + far and not using.stats.cache_hits
        kept.add(using.stats.cache_path)
    assert len(kept) == 3


def test_where_nothing_can_be_written_it_is_compiled_all_the_same(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("no folder")
    monkeypatch.setattr(compiled, "_bases", lambda file: iter([tmp_path / "file"]))
    rule = loaded(tmp_path / "rule.py", 1)
    assert rule.stats.cache_path is None
    compiled.warm(rule, 1)
    assert rule(1) == 2


RULES = """
import numpy as np
from wayfarer.world.avoidance.avoid import avoid
from wayfarer.world.avoidance.people import People
from wayfarer.body.landmarks import marker_names
from wayfarer.world.agents.goal import GoalColumns
from wayfarer.world.agents.slots import Gait, Seeds
from wayfarer.world.goals.steering import Steering, observe
from wayfarer.world.stepping.noise import latents
from wayfarer.world.output.footlock import Planted, leg_shares, lock_feet
from wayfarer.world.stepping.guards import bear_rows, bend_rows
from wayfarer.world.stepping.righting import Step, right_rows
from wayfarer.world.stepping.mirror import mirror_outputs
from wayfarer.world.stepping.new_frames import broken
from wayfarer.engines.engine import StepOutputs
from wayfarer.navigation.mesh import build
from wayfarer.navigation.paths.find import corridor, pull
from wayfarer.transport.conversion.basis import Basis
from wayfarer.transport.codec import PoseEncoding, PoseFormat, PoseProfile, encode
from wayfarer.world.agents.agent import MotionChunks
from tests.transport.samples import chunk
from wayfarer.world.output.legs import Legs, bones
from wayfarer.world.scenes.nearest_obstacles import nearest_people
from wayfarer.world.scenes.around import keep_apart, stand_before, way_around
from wayfarer.world.scenes.cells import cells_of
from wayfarer.world.scenes.people import PRESSED, Gathering, find_near
from wayfarer.world.scenes.spots import Claims, Everyone, Walkers, next_taken
from wayfarer.world.agents.slots import Slots
from wayfarer.world.scenes.routes import Routes

random = np.random.default_rng(0)
people = People.empty(20)
people.number[:] = np.arange(20)
people.position[:] = random.uniform(-2, 2, (20, 2))
people.velocity[:] = random.normal(size=(20, 2))
people.walks[::2], people.radius[:] = True, 0.25
found = avoid(people, np.arange(20), random.normal(size=(20, 2)).astype("f4"), None, 0.2)
legs = Legs.empty(3)
for part in ("hip", "knee", "ankle", "ball", "sole_of_ankle", "sole_of_ball"):
    getattr(legs, part)[:] = random.normal(size=getattr(legs, part).shape) * 0.05 - [0, 0, 0.2]
turns = random.normal(size=(3, 4, 22, 4)) * 0.2 + [0, 0, 0, 1]
turns = (turns / np.linalg.norm(turns, axis=-1, keepdims=True)).astype("f4")
hips = np.full((3, 4, 3), 0.6, "f4")
bent, mended = turns.copy(), np.zeros(3, np.bool_)
bend_rows(bent, legs.ankle, mended)
bore = np.empty((2, 3), "f4")
bear_rows(hips, turns, bones(legs), *bore)
mode, markers = np.arange(3, dtype=np.int8), random.normal(size=(3, 2, 67, 3)).astype("f4")
shares, step = leg_shares(marker_names()), Planted(turns, markers, np.ones((3, 4, 2), np.bool_))
wanted, before = np.array([True, False, True]), (hips[:, :2], turns[:, :2])
feet = lock_feet(wanted, legs, shares, before, hips, step)
eight = np.repeat(turns, 2, 1), np.repeat(hips, 2, 1)
upright = Step(eight[1].copy(), eight[0].copy(), markers.copy())
right_rows(mode, upright)
raw = StepOutputs(np.repeat(hips, 2, 1), eight[0], np.ones((3, 8, 2), "f4"), markers, mode, mode)
here = mirror_outputs(raw, wanted)
lost = broken(hips[:, 0], here)
mesh = build(np.array([[(k, 0), (k + 1, 0), (k, 1)] for k in range(9)]
    + [[(k + 1, 0), (k + 1, 1), (k, 1)] for k in range(9)], float), np.zeros(18, int), 0.1)
ends = (0.1, 0.1), (8.9, 0.8)
passed = np.array([corridor(mesh.portals, 0, 17, *ends, aim) for aim in (True, False)])
string, below = pull(mesh.portals, passed[0], 0, *ends)
moving = MotionChunks.of([chunk()])
packed = [
    np.frombuffer(encode(moving, Basis.UNITY, PoseFormat.choose(kind, profile, (), 20)).poses, "u1")
    for kind in (PoseEncoding.F32_LE, PoseEncoding.SMALLEST_THREE)
    for profile in (PoseProfile.BODY, PoseProfile.FULL)
]
gait, goals, seed = Gait.empty(3), GoalColumns.empty(3), Seeds.empty(3)
gait.mode[:], gait.speed[:], gait.trim[:] = [1, 2, 3], [1.0, 0.1, 0.3], 0.1
gait.stop_facing[:, 1] = goals.heading[:, 1] = goals.onward[:, 0] = 1
goals.given[:] = goals.through[0] = goals.strafe[2] = True
goals.position[:, :2], goals.speed[:], goals.radius[:] = random.normal(size=(3, 2)), 1.2, 0.4
seed.rotations[:], seed.translation[:] = turns[:, :2], random.normal(size=(3, 2, 3))
decided = Steering().decide(gait, seed, goals)
aimed = np.concatenate([part.reshape(-1) for part in Steering().targets(decided, seed, goals)])
went = observe(decided, seed.translation[:, -1], seed.translation, goals)
noise = latents(np.arange(3, dtype=np.uint64), np.arange(3), 1)
room, corners = random.uniform(-0.2, 1, (30, 40)), np.zeros((64, 2), np.int64)
keep_apart(room, np.array([-2.0, -2.0]), 0.15, people.position, 0.05)
room[0, 0] = room[-1, -1] = 1
count = way_around(room, np.array([0, 0]), np.array([29, 39]), corners)
own, stand = (np.repeat([0, 12], [12, 8]), np.repeat([12, 20], [12, 8])), ~people.walks
near, by, who = np.full(20, 9.0), np.zeros((20, 12), np.bool_), np.arange(20)
nearest, places = np.full(20, -1), np.float64(people.position)
ways = people.position[:, None] + np.arange(0, 2, 0.2)[:, None] * people.velocity[:, None]
standing = people.position, people.height, stand
stand_before(who, places, np.float64(ways), own, standing, 0.4, near, nearest, by)
cells = cells_of(own[0], people.position)
pressed = find_near(who, own[0], cells, people.position, people.height, people.walks, PRESSED)
beside, crowd = np.full((20, 4, 7), -1, "f4"), Gathering(people, who, own, stand, who, cells)
nearest_people(crowd, who, who[::-1].copy(), 2, beside)
columns = people.number, people.position, people.height, stand
everyone = Everyone(*own, *columns, people.position, people.position, people.walks)
claims = Claims(np.zeros((20, 2), "f4"), np.zeros(20))
asked, spot = people.position.copy(), people.position + 0.3
yes, goal = np.ones(20, np.bool_), np.column_stack([asked, people.height])
place, radius = people.position, people.radius
mine = yes, who, asked, spot, people.height, place, ~yes, people.walks, goal, radius
waits = np.zeros(20, np.bool_)
taken = next_taken(everyone, Walkers(*mine, ~yes), who, 1, False, claims, waits)
slots = Slots.empty(3)
routes = Routes(slots)
routes.lay(1, np.cumsum(random.uniform(0, 1, (9, 3)), 0), 0, 0)
off = routes.follow(np.arange(3), people.position[:3])
ahead = routes.ahead(np.arange(3), people.position[:3], goal[:3], np.arange(0.2, 9, 0.7))
"""


KEPT = {
    "here.rotations": 0,
    "here.next_seed_markers": 0,
    "lost": 0,
    "passed": 0,
    "string": 0,
    "below": 0,
    "found.velocity": 1e-5,
    "beside": 1e-6,
    "feet.rotations": 1e-5,
    "feet.markers": 1e-5,
    "bent": 1e-6,
    "bore": 1e-6,
    "upright.rotations": 1e-6,
    "upright.markers": 1e-5,
    "decided.mode": 0,
    "decided.stop_place": 1e-6,
    "aimed": 1e-6,
    "went.trim": 1e-6,
    "noise": 0,
    "np.concatenate(packed)": 0,
    "near": 1e-6,
    "nearest": 0,
    "by": 0,
    "pressed": 0,
    "taken": 0,
    "goal": 1e-6,
    "off": 1e-6,
    "ahead": 1e-6,
    "claims.places": 1e-6,
    "claims.apart": 1e-6,
    "room": 1e-12,
    "corners": 0,
    "count": 0,
}
"""Compared values, and their tolerances."""


def test_rules_stay_within_their_arrays_and_are_the_same_as_plain_python(tmp_path):
    """Compiled code does not look: beyond an array it reads and writes what is not its own."""
    keep = f"np.savez({str(tmp_path / 'plain.npz')!r}, {', '.join(KEPT)})"
    plain = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    subprocess.run([sys.executable, "-c", RULES + keep], env=plain, check=True)
    names = {}
    exec(RULES, names)
    kept = np.load(tmp_path / "plain.npz")
    for number, (name, tolerance) in enumerate(KEPT.items()):
        made = eval(name, names)
        np.testing.assert_allclose(made, kept[f"arr_{number}"], atol=tolerance, err_msg=name)
    assert names["count"] > 1
    assert (names["beside"][:, :2] == -1).all() and (names["beside"][:, 3, 6] > 0).any(), "near"
    assert (names["bent"] != names["turns"]).any(), "a knee is bent too far"
    assert names["by"].any() and not names["by"].all(), "some are in others' ways"
    assert names["pressed"].any() and not names["pressed"].all(), "some walk in a crowd"
    assert names["taken"][1] > 1, "a spot is taken"
    assert (names["upright"].rotations != names["eight"][0]).any(), "somebody leans"


@pytest.mark.parametrize("size", [1, 7, 64, 513])
def test_what_a_compiled_rule_makes_of_a_row_does_not_depend_on_its_batch(size):
    """They are equal to the last bit, as replay needs."""
    names = {}
    exec(RULES, names)
    legs, turns, hips = names["legs"], names["turns"], names["hips"]
    rows = np.random.default_rng(size).integers(0, len(turns), size)
    many, far, shape = turns[rows], hips[rows], legs.take(rows)
    step = Planted(many, names["markers"][rows], np.ones((size, 4, 2), np.bool_))
    before = far[:, :2], many[:, :2]
    feet = lock_feet(names["wanted"][rows], shape, names["shares"], before, far, step)
    eight = Step(np.repeat(far, 2, 1), np.repeat(many, 2, 1), names["markers"][rows])
    upright = Step(*(part.copy() for part in eight))
    right_rows(names["mode"][rows], upright)
    bent = many.copy()
    bend_rows(bent, shape.ankle, np.zeros(size, np.bool_))
    seed, gait, goals = (names[name].take(rows) for name in ("seed", "gait", "goals"))
    decided = Steering().decide(gait, seed, goals)
    went = observe(decided, seed.translation[:, -1], seed.translation, goals)
    for made, alone in (
        (decided.mode, names["decided"].mode),
        (decided.stop_place, names["decided"].stop_place),
        (went.trim, names["went"].trim),
        (latents(rows.astype(np.uint64), rows, 1), names["noise"]),
        (feet.rotations, names["feet"].rotations),
        (feet.markers, names["feet"].markers),
        (feet.contacts, names["feet"].contacts),
        (bent, names["bent"]),
        (upright.rotations, names["upright"].rotations),
        (upright.markers, names["upright"].markers),
    ):
        np.testing.assert_array_equal(made, alone[rows])


@pytest.fixture(autouse=True)
def _forget():
    yield
    sys.modules.pop("kept_rule", None)
    sys.modules.pop("used_rule", None)
