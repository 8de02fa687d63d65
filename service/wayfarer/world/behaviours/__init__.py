"""Behaviours that an agent follows until its next goal command.

Each kind is a file: a frozen dataclass (world space) with its checks and its next goals; see
`world/agents/behaviour.py`. `runner.py` runs them. A new kind is a new file and an entry in
`PartBehaviour` (routine.py), the registry of kinds.
"""

from typing import Final, get_args

from wayfarer.world.agents.behaviour import Behaviour
from wayfarer.world.behaviours.follow import Follow
from wayfarer.world.behaviours.keep_away import KeepAway
from wayfarer.world.behaviours.patrol import Patrol
from wayfarer.world.behaviours.queue import Queue
from wayfarer.world.behaviours.routine import Part, PartBehaviour, Routine, Stand, Visit
from wayfarer.world.behaviours.wander import Wander

AnyBehaviour = PartBehaviour | Routine
"""Every kind, as journals and logs read them."""


KINDS: Final = {kind.__name__: kind for kind in get_args(AnyBehaviour)}
"""Every kind by its name."""


def known_behaviour(behaviour: Behaviour) -> AnyBehaviour:
    """The same behaviour, for journals and logs. Raises TypeError for an unregistered kind."""
    if not isinstance(behaviour, AnyBehaviour):
        raise TypeError(f"{type(behaviour).__name__} is not a registered kind of behaviour")
    return behaviour


__all__ = [
    "KINDS",
    "AnyBehaviour",
    "Behaviour",
    "Follow",
    "KeepAway",
    "Part",
    "PartBehaviour",
    "Patrol",
    "Queue",
    "Routine",
    "Stand",
    "Visit",
    "Wander",
    "known_behaviour",
]
