"""A town square full of people who walk about."""

from typing import Final

import numpy as np

from wayfarer.navigation.examples import town_square
from wayfarer.navigation.scene import bake
from wayfarer.world.scenes.messages import Crowd
from wayfarer_lab.evaluation.gait import Row
from wayfarer_lab.evaluation.goals import Watch
from wayfarer_lab.evaluation.scenes.play import House
from wayfarer_lab.evaluation.scenes.scenarios.seen import Seen

EVERY: Final = 8
"""Frames between measured ones: 5 a second."""


def square(seconds: float, house: House, seed: int, people: int, watch: Watch) -> Seen:
    """One call populates it; after that there are no commands."""
    scene = bake(town_square())
    play = house.play(scene, people, avoid=True, every=EVERY)
    play.world.crowds.set(play.session_id, Crowd(people, seed), 0.0)
    play.world.crowds.tend(0.0)  # an empty world has no moments at which it would do so itself
    for chunk in play.run(seconds):
        watch(chunk.scheduled_at, seconds)
    reached = sum(p.arrivals for p in play.witness.progress)
    stuck = np.array([p.stuck_at is not None for p in play.witness.progress])
    row: Row = {
        "name": "square",
        "success": float((~stuck).mean()),
        "goals_per_minute_each": reached / len(stuck) / (seconds / 60),
    }
    return Seen(row | play.figures(), scene, play.witness)
