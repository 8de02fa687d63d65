"""Local mode in JavaScript and in C++, rule by rule, against the server: beyond the traces."""

import json
import logging
import shutil
from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.clients.web_scripts import node
from tests.programs import run_program
from tests.world.stepping.guarded import bendable, fallen
from wayfarer.body.landmarks import marker_names
from wayfarer.body.rotation import quaternion_from_rotvec
from wayfarer.models.bundle import START_POSES, load_bodies
from wayfarer.spec import MARKERS, NEW_FRAMES, POSED_JOINTS, SEED_FRAMES
from wayfarer.world.agents.agent import AgentSpec
from wayfarer.world.agents.goal import GoalColumns
from wayfarer.world.agents.heading import facing_at, facing_of
from wayfarer.world.agents.slots import Gait, Mode, Motion, Seeds
from wayfarer.world.agents.spawn import Spawner, load_start_poses
from wayfarer.world.agents.style import sets_off, style_of
from wayfarer.world.goals.steering import Steering
from wayfarer.world.output.legs import KNEES, Legs, measure_legs, pose_legs
from wayfarer.world.output.quaternion import multiply
from wayfarer.world.output.twobone import move_ankles
from wayfarer.world.stepping.guards import got_up
from wayfarer.world.stepping.mirror import is_mirrored
from wayfarer.world.stepping.noise import latents
from wayfarer.world.stepping.righting import Step, right_rows

LOG = logging.getLogger(__name__)
CPP = Path(__file__).parents[2] / "clients" / "cpp"
Port = Callable[[str, Path], Any]
"""A port's results for the rows in a file, by one of random, guards, righting and rules."""


@pytest.fixture(scope="module")
def cpp(tmp_path_factory) -> Port:
    """The C++ port, compiled without CMake; undefined behaviour ends it.

    Compiled by clang, in half of the time.
    """
    if not shutil.which("clang++") or not Path("/usr/include/nlohmann/json.hpp").exists():
        pytest.skip("needs clang and nlohmann-json3-dev")
    program = tmp_path_factory.mktemp("cpp") / "rules"
    sources = [CPP / "local/tests/rules.cpp", *sorted((CPP / "local/src").glob("*.cpp"))]
    together = program.with_suffix(".cpp")  # the headers cost most
    together.write_text("".join(f'#include "{source}"\n' for source in sources))
    folders = [CPP / "local/src", CPP / "local/include", CPP / "include"]
    flags = ["-std=c++17", "-O0", "-fsanitize=undefined,local-bounds", "-fsanitize-trap=all"]
    run_program("clang++", *flags, *(f"-I{folder}" for folder in folders), together, "-o", program)
    return lambda rules, file: json.loads(run_program(program, rules, file).stdout)


@pytest.fixture(params=["javascript", "cpp"])
def port(request) -> Port:
    if request.param == "cpp":
        return request.getfixturevalue("cpp")
    if not shutil.which("node"):
        pytest.skip("needs node: apt-get install nodejs")
    return lambda rules, file: json.loads(node(f"local_{rules}.js", file))


def test_people_are_drawn_from_their_seeds_as_on_the_server(port, tmp_path):
    seeds = np.random.default_rng(0).integers(0, 2**64, 200, np.uint64)
    seeds[:4] = 0, 1, 2, 2**64 - 1
    file = tmp_path / "seeds.json"
    file.write_text(json.dumps([str(seed) for seed in seeds]))
    found = port("random", file)
    style = style_of(seeds)
    for name, drawn in (("own", style.own_noise), ("manner", style.manner)):
        np.testing.assert_allclose([one[name] for one in found], drawn, rtol=1e-6, atol=1e-7)
    assert [one["mirrored"] for one in found] == is_mirrored(seeds).tolist()
    noise = latents(seeds, np.full(len(seeds), 7), 1)[:, 0]
    np.testing.assert_allclose([one["noise"] for one in found], noise, rtol=1e-6, atol=1e-7)
    chunk = np.full(len(seeds), 4)
    ready = [(4 + one["reaction"]) % 3 == 0 for one in found]
    assert ready == sets_off(seeds, chunk, 3).tolist()


def test_guards_repair_as_the_servers_do(port, tmp_path):
    """Impossible steps: twisted and overbent knees, falls."""
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
    bend = np.float32([[np.sin(np.radians(9))], [0], [0], [np.cos(np.radians(9))]])
    turns[0, 3:, KNEES[0]] = multiply(bend, turns[0, 3:, KNEES[0]].T).T  # beyond straight
    hips = np.repeat(seeds.translation[:, -1:], 8, axis=1)
    hips[5, -1, 2] = 0.4
    target = Motion.join(stands)
    fell = fallen(hips, turns, legs)
    repaired, _ = bendable(turns, legs)
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
    measured = {
        "hip": legs.hip, "knee": legs.knee, "ankle": legs.ankle, "ball": legs.ball,
        "soleOfAnkle": legs.sole_of_ankle, "soleOfBall": legs.sole_of_ball,
        "ballShare": legs.ball_share,
    }  # fmt: skip
    measured = {name: values[0].ravel() for name, values in measured.items()}
    measured["standing"] = [-down - heel]
    file.write_text(json.dumps({"legs": measured, "steps": steps}, default=_flat))
    found = port("guards", file)
    up = got_up(seeds, target)  # changes the stands' arms
    assert fell.any() and not fell.all()
    assert np.flatnonzero((repaired != turns)[0].any((0, 2))).tolist() == [KNEES[0]]
    for k, one in enumerate(found):
        assert one["fallen"] == fell[k]
        for name, wanted in (
            ("bendable", repaired[k]),
            ("upTranslation", up[0][k]),
            ("upRotations", up[1][k]),
            ("stand", target.seed.rotations[k]),
        ):
            np.testing.assert_allclose(one[name], wanted.ravel(), atol=2e-4, err_msg=name)


def test_leaning_people_straighten_up_as_on_the_server(port, tmp_path):
    """All modes, leans on both sides of the bounds, in all directions."""
    count, rng = 60, np.random.default_rng(8)
    bends = np.radians(12) * rng.normal(size=(count, NEW_FRAMES, POSED_JOINTS, 3))
    bends[: count // 3] *= 0.2
    step = Step(
        rng.normal([0, 0, 0.9], 0.05, (count, NEW_FRAMES, 3)).astype(np.float32),
        quaternion_from_rotvec(bends).astype(np.float32),
        rng.normal([0, 0, 1], 0.4, (count, SEED_FRAMES, MARKERS, 3)).astype(np.float32),
    )
    modes = rng.integers(0, len(Mode), count).astype(np.int8)
    parts = {"translation": step.translation, "rotations": step.rotations, "markers": step.markers}
    rows = [
        {"mode": int(modes[k])} | {name: part[k] for name, part in parts.items()}
        for k in range(count)
    ]
    file = tmp_path / "steps.json"
    file.write_text(json.dumps({"names": marker_names(), "steps": rows}, default=_flat))
    found = port("righting", file)
    after = Step(*(part.copy() for part in step))
    right_rows(modes, after)
    left = (after.markers == step.markers).all((1, 2, 3))
    assert 5 < left.sum() < count - 20
    assert [one["same"] for one in found] == left.tolist()
    for k, one in enumerate(found):
        np.testing.assert_allclose(one["rotations"], after.rotations[k].ravel(), atol=2e-6)
        np.testing.assert_allclose(one["markers"], after.markers[k].ravel(), atol=2e-6)


def random_gaits(count: int) -> tuple[Gait, Seeds, GoalColumns, np.ndarray]:
    """People in any state near a goal of any kind, a tenth without one; whether each is ready."""
    rng = np.random.default_rng(6)

    def some(share: float) -> np.ndarray:
        return rng.random(count) < share

    def headings() -> np.ndarray:
        return np.stack([facing_at(a) for a in rng.uniform(-np.pi, np.pi, count)])

    gait, seed, goals = Gait.empty(count), Seeds.empty(count), GoalColumns.empty(count)
    gait.mode[:] = rng.integers(0, len(Mode), count)
    gait.speed[:] = rng.choice([0.1, 0.5, 1.5], count) * rng.random(count)
    gait.slow_seconds[:] = 0.2 * rng.integers(0, 4, count)
    gait.arrived[:], gait.rested[:] = some(0.5), some(0.5)
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
    goals.onward[:], goals.bend[:] = headings(), rng.uniform(0, 2, count)
    gait.trim[:] = rng.uniform(-0.15, 0.15, count)
    goals.put(np.arange(count // 10), GoalColumns.empty(count // 10))
    return gait, seed, goals, some(0.7)


def test_people_decide_and_feet_are_moved_as_on_the_server(port, tmp_path):
    count, steering = 3000, Steering()
    gait, seed, goals, ready = random_gaits(count)
    facing = facing_of(seed.rotations[:, -1, 0])
    rows = [
        {
            "gait": {
                "mode": int(gait.mode[k]), "speed": float(gait.speed[k]),
                "slowSeconds": float(gait.slow_seconds[k]), "arrived": bool(gait.arrived[k]),
                "rested": bool(gait.rested[k]), "stopPlace": gait.stop_place[k],
                "stopFacing": gait.stop_facing[k], "trim": float(gait.trim[k]),
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
                "bend": float(goals.bend[k]), "onward": goals.onward[k],
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
            {"translation": hips[k], "rotations": turns[k], "shift": shift[k]}
            for k in range(people)
        ],
    }
    file = tmp_path / "rows.json"
    file.write_text(json.dumps(given, default=_flat))
    found = port("rules", file)

    after = steering.decide(gait, seed, goals, ready)
    never = replace(steering, pausing=0).decide(gait, seed, goals, ready)
    assert (after.mode != never.mode).sum() > 5, "somebody pauses"
    assert len(set(after.mode)) == len(Mode)
    assert [one["mode"] for one in found["gaits"]] == after.mode.tolist()
    assert [one["rested"] for one in found["gaits"]] == after.rested.tolist()
    numbers = np.column_stack(
        [
            *(after.slow_seconds, after.stop_place, after.stop_facing),
            *steering.targets(after, seed, goals),
        ]
    )
    np.testing.assert_allclose([one["numbers"] for one in found["gaits"]], numbers, atol=1e-5)

    moved, legs = turns.copy(), legs.take(np.zeros(people, int))
    move_ankles(pose_legs(legs, hips, turns), shift, moved)
    off = np.abs(np.array(found["poses"]) - moved.reshape(people, -1)).max()
    LOG.info("feet: off by %.1e", off)
    assert off < 1e-3


def _flat(values: object) -> list[float]:
    return np.asarray(values).ravel().tolist()
