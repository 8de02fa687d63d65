"""Traces of the server for some people and commands, to check ports of its rules."""

from dataclasses import replace
from typing import Any

import numpy as np

from wayfarer.engines.engine import StepInputs, StepOutputs
from wayfarer.engines.onnx_engine import OnnxEngine
from wayfarer.models.bundle import DEFAULT_MODEL, START_POSES, load_bodies, load_models
from wayfarer.navigation.scene import Scene
from wayfarer.world.agents.agent import AgentSpec, SessionSpec
from wayfarer.world.agents.goal import Goal
from wayfarer.world.agents.spawn import load_start_poses
from wayfarer.world.goals.commands import Path as GoalPath
from wayfarer.world.goals.commands import Stop
from wayfarer.world.goals.steering import Steering
from wayfarer.world.scenes.messages import SceneSource
from wayfarer.world.scenes.scene_registry import SceneRegistry
from wayfarer.world.stepping.settings import WorldSettings
from wayfarer.world.world import World

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


class _Counted(OnnxEngine):
    """Counts its calls."""

    calls = 0

    def step(self, gender: str, inputs: StepInputs) -> StepOutputs:
        self.calls += 1
        return super().step(gender, inputs)


def traced(
    specs: list[AgentSpec],
    commands: list[tuple],
    scene: Scene | None = None,
    seconds: float = SECONDS,
    avoid: bool = True,
) -> dict:
    """The chunks of a world of the server for these people and commands, one candidate."""
    settings = WorldSettings(steering=Steering().with_search(candidates=1), phases=1)
    engine, scenes = _Counted(load_models(DEFAULT_MODEL), 1), SceneRegistry()
    poses = load_start_poses(START_POSES)
    world = World(engine, load_bodies("anny52"), poses, settings, scenes=scenes)
    number = scenes.create(SceneSource(scene.spec), baked=scene).scene_id if scene else ""
    spec = SessionSpec(lock_step=True, scene=number, avoid=avoid)
    session = world.create_session(spec, now=0.0).session_id
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
    run(seconds)
    return {
        "seconds": seconds,
        "calls": engine.calls,
        "avoid": avoid,
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


def both_ways() -> dict[str, Any]:
    """Each person occurs twice: with foot lock and postures, and as the model moves it.

    They walk through each other: the C++ core has no avoidance.
    """
    specs = [*PEOPLE, *(replace(spec, foot_lock=False) for spec in PEOPLE)]
    commands = [(at, who + twin, goals) for at, who, goals in COMMANDS for twin in (0, len(PEOPLE))]
    return traced(specs, commands, avoid=False)
