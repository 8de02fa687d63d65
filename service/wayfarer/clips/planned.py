"""Motion that is planned whole, by tree search, before a frame of it is shown."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import ceil

import numpy as np

from wayfarer.body.model import BodyModel
from wayfarer.clips.clip import Clip
from wayfarer.engines.engine import Engine
from wayfarer.errors import FailedPrecondition, InvalidArgument
from wayfarer.spec import FPS, NEW_FRAMES, STEP_SECONDS
from wayfarer.world.agents.agent import AgentSpec
from wayfarer.world.agents.goal import Goal
from wayfarer.world.agents.slots import Motion
from wayfarer.world.output.footlock import Planted, leg_shares, lock_feet
from wayfarer.world.output.legs import measure_legs
from wayfarer.world.rows import Flags, Float
from wayfarer.world.search.beam import plan
from wayfarer.world.search.beam_settings import BeamSettings
from wayfarer.world.search.problem import Ending, MotionPlan, PlanningProblem
from wayfarer.world.stepping.mirror import has_mirror_image


def plan_clip(
    engine: Engine,
    body: BodyModel,
    spec: AgentSpec,
    start: Motion,
    goals: Sequence[Goal],
    seconds: float,
    settings: BeamSettings,
    watch: Callable[[float], None] = lambda done: None,
) -> Clip:
    """`generate_clip` by the search of `settings`, whose depth is made to fit `seconds`.

    The foot lock is the world's only correction after the model; no guard acts. So a plan
    shows what the paper's search has judged, and Table 1 compares it.
    `body` is of the spec's gender, `start` comes from `World.prepare` with the spec. Raises
    InvalidArgument on a bad goal, and FailedPrecondition when the search finds no way on.
    """
    frames = round(seconds * FPS)
    if frames < 1:
        raise InvalidArgument(f"seconds is {seconds:g}; at least one frame is needed", "seconds")
    whole = replace(settings, depth=ceil(frames / NEW_FRAMES), until="depth")
    mirrors = has_mirror_image([body])
    problem = PlanningProblem.of([spec], [start], [goals], mirrors=mirrors)
    [found] = plan(engine, problem, whole, watch=lambda level, _: watch(level * STEP_SECONDS))
    if found.ending is Ending.BROKEN:
        raise FailedPrecondition(
            f"the search found no way on after {found.steps * STEP_SECONDS:.1f} s: every primitive "
            "it tried was broken; keep more nodes, or use another body or seed"
        )
    watch(seconds)
    gait = found.end.gait
    rotations, contacts = found.rotations, found.contacts
    if spec.foot_lock:
        rotations, contacts = _locked(body, spec, found)
    return Clip(
        translation=found.translation,
        rotations=rotations,
        contacts=contacts,
        gender=spec.gender,
        betas=spec.betas,
        goals=tuple(goal.position for goal in goals),
        meta={
            "goals_reached": str(int(gait.waypoint[0]) + int(gait.arrived[0])),
            "primitives_rejected": str(int(found.rejected.sum())),
        },
    )[:frames]


def _locked(body: BodyModel, spec: AgentSpec, found: MotionPlan) -> tuple[Float, Flags]:
    """Rotations [N, 22, 4] and contacts [N, 2] as the service would send them."""
    legs = measure_legs(body, np.array(spec.betas))
    hips, rotations = found.translation[None], found.rotations[None]
    first = hips[:, [0, 0]], rotations[:, [0, 0]]
    step = Planted(rotations, np.zeros((1, 0, 0, 3), np.float32), found.contacts[None])
    locked = lock_feet(np.ones(1, np.bool_), legs, leg_shares([]), first, hips, step)
    return locked.rotations[0], locked.contacts[0]
