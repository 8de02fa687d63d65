"""Shorter steps: on stairs people take one riser at a time, and the model cannot.

The model steps as far as its speed wants, about 60 cm at 0.9 m/s, which is two treads. So while
the way leads over stairs everything horizontal about a walk is *shortened* by one factor: the way
of the hips here, the places of the feet around them in `output/footlock.py`. Elsewhere each agent
shortens its steps, or makes them longer, by a habit of its own (`style.py`). A foot that stands
goes on standing, since hips and feet are shortened alike, and the model, whose own motion is not
changed, walks as on a floor.

Stretches are shortened by degrees, so that nobody's stride changes from one step to the next. World
space, metres. Pure functions of columns: rows do not influence each other.
"""

from dataclasses import replace
from typing import Final

import numpy as np

from wayfarer.spec import NEW_FRAMES, STEP_SECONDS
from wayfarer.world.agents.goal import GoalColumns
from wayfarer.world.agents.slots import Gait, Mode, Seeds
from wayfarer.world.output.quaternion import bounded
from wayfarer.world.rows import Float
from wayfarer.world.stepping.planting import Step

STEP: Final = (0.27, 0.31)
"""Metres of the model's step when it hardly moves, and further metres per m/s of its speed."""

MOST: Final = 0.65
"""Largest share of a step that is removed."""

RATE: Final = 0.6 * STEP_SECONDS
"""Largest change of that share in a step."""


def shortened_gait(gait: Gait, goals: GoalColumns, habit: Float) -> Gait:
    """The gait [A] of the next step, with the share that its steps are shortened by at its end.

    `habit` [A]: that of walkers on level ground.
    """
    step = STEP[0] + STEP[1] * goals.speed
    stairs = bounded(1 - goals.tread / step, 0, MOST)
    going = np.isin(gait.mode, (Mode.WALKING, Mode.STOPPING))
    wanted = np.where(goals.tread > 0, stairs, habit) * going
    change = bounded(wanted - gait.shortened, -RATE, RATE)
    return replace(gait, shortened=(gait.shortened + change).astype(np.float32))


def shorten(before: Float, gait: Gait, start: Float, step: Step, seed: Seeds) -> tuple[Step, Seeds]:
    """The step and where the next one starts, with the way of the hips shortened.

    By shares `before` [A] at its start, and the gait's at its end; start [A, 3] is the hips' last
    place. The seed moves as a whole: the model does not know that it is shortened.
    """
    if not (before.any() or gait.shortened.any()):
        return step, seed
    rise = np.arange(1, NEW_FRAMES + 1, dtype=np.float32) / NEW_FRAMES
    share = before[:, None] + rise * (gait.shortened - before)[:, None]
    translation = step.translation.copy()
    moved = Seeds(seed.markers.copy(), seed.translation.copy(), seed.rotations)
    for axis in (0, 1):  # one after the other: numpy is slow over a last axis of two
        path = np.concatenate([start[:, None, axis], step.translation[..., axis]], 1)
        off = -np.cumsum(share * np.diff(path, axis=1), axis=1)
        whole = off[:, -1:].astype(np.float32)
        translation[..., axis] += off
        moved.markers[..., axis] += whole[..., None]
        moved.translation[..., axis] += whole
    return step._replace(translation=translation), moved
