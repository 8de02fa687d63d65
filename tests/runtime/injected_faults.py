"""Ways to make each stage of a turn fail, and the effects."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tests.runtime.fault_rig import GUILTY, MARK, InjectedError
from wayfarer.runtime.persistence.record import Recordings
from wayfarer.runtime.streams.goal_events import GoalEvents
from wayfarer.runtime.streams.publications import SlowReader
from wayfarer.runtime.streams.publisher import Publisher
from wayfarer.runtime.streams.root_tracks import RootTracks
from wayfarer.world import sending
from wayfarer.world.agents.faults import Stage
from wayfarer.world.agents.goal import Goal
from wayfarer.world.behaviours import Wander
from wayfarer.world.behaviours.runner import BehaviourRunner
from wayfarer.world.scenes import populate
from wayfarer.world.scenes.guide import SceneGuide
from wayfarer.world.scenes.planner import Planner
from wayfarer.world.scenes.world_scenes import WorldScenes
from wayfarer.world.stepping import scheduler
from wayfarer.world.stepping.scheduler import Scheduler


@dataclass
class Case:
    """A way to make a stage fail, and the effect."""

    stage: Stage
    inject: Callable
    of_agent: bool = True  # otherwise of its session
    options: dict | None = None
    goal: object = Goal((2.0, 10.0, 0.0))
    holds: bool = False  # the agent stands meanwhile


def failing(monkeypatch, owner, name, is_guilty):
    """Make a function fail when `is_guilty(arguments)`."""
    real = getattr(owner, name)

    def wrapped(*args, **kwargs):
        if is_guilty(*args):
            raise InjectedError(f"{name} fails")
        return real(*args, **kwargs)

    monkeypatch.setattr(owner, name, wrapped)


def engine_fails(rig, monkeypatch):
    rig.engine.fails = True


def engine_gives_nan(rig, monkeypatch):
    rig.engine.nan_for_beta = MARK


def way_is_not_found(rig, monkeypatch):
    failing(monkeypatch, Planner, "_look", lambda self, slot, *_: slot == rig.slot)


def way_fails(rig, monkeypatch):
    failing(monkeypatch, SceneGuide, "_led", lambda self, rows, *_: rig.slot in rows)


def steering_fails(rig, monkeypatch):
    seed = rig.world.slots.noise_seed[rig.slot] = np.uint64(666)
    failing(monkeypatch, scheduler, "sets_off", lambda seeds, *_: seed in seeds)


def inputs_fail(rig, monkeypatch):
    failing(monkeypatch, scheduler, "gather", lambda slots, rows, *_: rig.slot in rows)


def rules_fail(rig, monkeypatch):
    failing(monkeypatch, Scheduler, "apply", lambda self, batch, *_: rig.slot in batch.rows)


def rules_give_nan(rig, monkeypatch):
    real = scheduler.Seeds

    def seeds(markers, translation, rotations):
        mine = np.abs(translation[:, -1, 0] - 2.0) < 1.0  # where the guilty agent is
        return real(np.where(mine[:, None, None], np.nan, markers), translation, rotations)

    monkeypatch.setattr(scheduler, "Seeds", seeds)


def ground_fails(rig, monkeypatch):
    failing(monkeypatch, sending, "ground", lambda s, scenery, sent, *_: rig.slot in sent.slots)


def behaviour_fails(rig, monkeypatch):
    failing(
        monkeypatch, BehaviourRunner, "_update", lambda self, agent: agent.agent_id == rig.guilty
    )


def recording_fails(rig, monkeypatch):
    failing(monkeypatch, Recordings, "sent", lambda self, due: due.session_id == GUILTY)


def schedule_fails(rig, monkeypatch):
    log = rig.service._live._publisher._logs[GUILTY]
    failing(monkeypatch, type(log), "has_holders", lambda self: self is log)


def sights_fail(rig, monkeypatch):
    failing(monkeypatch, Publisher, "sights", lambda self, session_id, _: session_id == GUILTY)


def roots_fail(rig, monkeypatch):
    failing(monkeypatch, RootTracks, "follow", lambda self, chunks: rig.guilty in chunks.agent_id)


def events_fail(rig, monkeypatch):
    failing(monkeypatch, GoalEvents, "_of", lambda self, chunk: chunk.agent_id == rig.guilty)


def crowd_fails(rig, monkeypatch):
    failing(monkeypatch, populate, "drawn_person", lambda crowd, *_: crowd.seed == 666)


def scene_fails(rig, monkeypatch):
    failing(monkeypatch, WorldScenes, "_take_up", lambda *_: True)


NEAR = Goal((2.0, 3.0, 0.0))
CASES = {
    "way not found": Case(Stage.WAY, way_is_not_found),
    "way": Case(Stage.WAY, way_fails, holds=True),
    "steering": Case(Stage.STEERING, steering_fails, holds=True),
    "inputs": Case(Stage.INPUTS, inputs_fail, holds=True),
    "engine": Case(Stage.ENGINE, engine_fails, holds=True),
    "engine gives NaN": Case(Stage.ENGINE, engine_gives_nan, holds=True),
    "rules": Case(Stage.RULES, rules_fail, holds=True),
    "rules give NaN": Case(Stage.RULES, rules_give_nan, holds=True),
    "behaviour": Case(Stage.BEHAVIOUR, behaviour_fails, goal=Wander(None)),
    "ground": Case(Stage.GROUND, ground_fails),
    "event": Case(Stage.EVENT, events_fail, goal=NEAR),
    "record": Case(Stage.RECORD, recording_fails, of_agent=False),
    "schedule": Case(
        Stage.SCHEDULE, schedule_fails, of_agent=False, options={"slow_reader": SlowReader.HOLD}
    ),
    "sight": Case(Stage.SIGHT, sights_fail, of_agent=False),
    "roots": Case(Stage.ROOTS, roots_fail, of_agent=False, options={"roots": True}),
    "crowd": Case(Stage.CROWD, crowd_fails, of_agent=False),
    "scene": Case(Stage.SCENE, scene_fails, of_agent=False),
}
