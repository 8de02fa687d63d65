"""Motion that is planned whole, by tree search, before a frame of it is shown."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import ceil

from wayfarer.clips.clip import Clip
from wayfarer.errors import FailedPrecondition, InvalidArgument
from wayfarer.runtime.agent import AgentSpec, Goal
from wayfarer.runtime.beam import plan
from wayfarer.runtime.beam_settings import BeamSettings
from wayfarer.runtime.engine import Engine
from wayfarer.runtime.plan import Ending, Problem
from wayfarer.runtime.slots import Motion
from wayfarer.spec import FPS, NEW_FRAMES, STEP_SECONDS


def plan_clip(
    engine: Engine,
    spec: AgentSpec,
    start: Motion,
    goals: Sequence[Goal],
    seconds: float,
    settings: BeamSettings,
    watch: Callable[[float], None] = lambda done: None,
) -> Clip:
    """`generate_clip` by the search of `settings`, whose depth is made to fit `seconds`.

    `start` is what `World.prepare` makes of `spec`. Raises InvalidArgument on a bad goal, and
    FailedPrecondition when the search finds no way on.
    """
    frames = round(seconds * FPS)
    if frames < 1:
        raise InvalidArgument(f"seconds is {seconds:g}; at least one frame is needed", "seconds")
    whole = replace(settings, depth=ceil(frames / NEW_FRAMES), until="depth")
    problem = Problem.of([spec], [start], [goals])
    [found] = plan(engine, problem, whole, watch=lambda level, _: watch(level * STEP_SECONDS))
    if found.ending is Ending.BROKEN:
        raise FailedPrecondition(
            f"the search found no way on after {found.steps * STEP_SECONDS:.1f} s: every primitive "
            "it tried was broken; keep more nodes, or use another body or seed"
        )
    watch(seconds)
    gait = found.end.gait
    return Clip(
        translation=found.translation,
        rotations=found.rotations,
        contacts=found.contacts,
        gender=spec.gender,
        betas=spec.betas,
        goals=tuple(goal.position for goal in goals),
        meta={
            "goals_reached": str(int(gait.waypoint[0]) + int(gait.arrived[0])),
            "primitives_rejected": str(int(found.rejected.sum())),
        },
    )[:frames]
