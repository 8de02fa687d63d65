"""Quality terms of a candidate primitive: their names, meanings and the one weight table.

The functions are in `motion/quality.py`; search (now) and reward (policy) and evaluation share
these names. A candidate's cost is the weighted sum of its terms; lower is better.
"""

from typing import Final

TERMS: Final = (
    "goal_distance",  # m, hips to goal, horizontal, last frame
    "facing",  # 1 - cos(angle from body facing to goal direction), last frame
    "speed",  # m/s, |mean horizontal hips speed - target speed|
    "floating",  # m, mean height of the lowest sole marker above the floor
    "sinking",  # m, mean depth of the lowest sole marker below the floor
    "skating",  # m/s, mean horizontal speed of the lowest sole marker (sole on the floor)
    "upright",  # 1 - cos(tilt of the trunk from vertical), last frame
    "stillness",  # m/s, mean speed of all markers
    "feet_apart",  # m, horizontal distance of the ankles along the facing direction, last frame
)

WALK: Final = {
    "goal_distance": 1.0,
    "facing": 0.5,
    "speed": 0.1,
    "floating": 0.5,
    "sinking": 1.0,
    "skating": 1.0,
    "upright": 3.0,
}
"""On the way to a goal."""

STAND: Final = {
    "goal_distance": 0.5,
    "floating": 1.0,
    "sinking": 1.0,
    "skating": 0.2,
    "upright": 3.0,
    "stillness": 2.0,
    "feet_apart": 0.3,
}
"""Stopping and standing."""


def weights(table: dict[str, float]) -> list[float]:
    """The table as a list in the order of `TERMS`. Raises KeyError on an unknown name."""
    unknown = set(table) - set(TERMS)
    if unknown:
        raise KeyError(f"unknown quality terms {sorted(unknown)}; allowed: {list(TERMS)}")
    return [table.get(name, 0.0) for name in TERMS]
