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
from wayfarer.world.agents.slots import Mode, Motion
from wayfarer.world.agents.style import draws
from wayfarer.world.output.footlock import begin, lock_feet
from wayfarer.world.output.legs import measure_legs
from wayfarer.world.output.posture import DRAWN, calmed, habits, hold, settled
from wayfarer.world.output.quaternion import Array
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

    Of what the world does to motion beside the model it has the foot lock and the posture only: no
    stride of one's own, no planted stop, no guard. So what a plan shows is what the paper's search
    has judged, and Table 1 compares it.
    `body` is of the spec's gender, `start` what `World.prepare` makes of the spec. Raises
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
    hips, rotations, contacts = found.translation, found.rotations, found.contacts
    if spec.foot_lock:
        hips, rotations, contacts = _cleaned(body, spec, found)
    return Clip(
        translation=hips,
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


def _cleaned(body: BodyModel, spec: AgentSpec, found: MotionPlan) -> tuple[Float, Float, Flags]:
    """Hips [N, 3], rotations [N, 22, 4] and contacts [N, 2] as the service would send them."""
    legs = measure_legs(body, np.array(spec.betas))
    hips, rotations = found.translation[None], found.rotations[None]
    state, nobody = begin(legs, hips[:, 0], rotations[:, 0]), np.zeros(1, np.bool_)
    stands = found.modes == Mode.STANDING
    rests = stands | (found.modes == Mode.TURNING)
    rest, upright = _calmed(rests), _calmed(stands)
    level = np.zeros(1, np.float32)
    locked = lock_feet(state, legs, hips, rotations, nobody, nobody, level, upright)
    own = habits(draws(np.array([spec.noise_seed], np.uint64), DRAWN))
    begun = settled(rotations[:, 0], rests[:1], stands[:1])
    held, _ = hold(begun, locked.rotations, own, rest)
    return locked.translation[0], held[0], locked.contacts[0]


def _calmed(rests: Flags) -> Array:
    """How far somebody is at rest in each frame [N, 1], of whom it is known for primitives [L]."""
    share, shares = rests[:1].astype(np.float32), []
    for now in rests:
        eased, share = calmed(share, now[None], NEW_FRAMES)
        shares.append(eased)
    return np.concatenate(shares)
