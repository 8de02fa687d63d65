"""Quality terms of a candidate primitive: their names, meanings and the one weight table.

The functions are in `motion/quality.py`; search, policy training and evaluation share these names.
A candidate's cost is the weighted sum of its terms; lower is better.
"""

from typing import Final

TERMS: Final = (
    "goal_distance",  # m, hips to goal, horizontal, last frame
    "facing",  # 1 - cos(angle from body facing to wished facing or goal direction), last frame
    "speed",  # m/s, |mean horizontal hips speed - target speed|
    "floating",  # m, mean height of the lowest sole marker above the floor
    "sinking",  # m, mean depth of the lowest sole marker below the floor
    "skating",  # m/s, mean horizontal speed of the lowest sole marker (sole on the floor)
    "sliding",  # m/s, mean over feet of the speed of the lowest marker, less the higher it is
    "upright",  # 1 - cos(tilt of the trunk from vertical), more beyond 15 degrees, last frame
    "stillness",  # m/s, mean speed of all markers
    "feet_apart",  # m, horizontal distance of the ankles along the facing direction, last frame
    "seam",  # m/s, mean change of the markers' velocity from the seed to the first new frame
    "clearance",  # m, depth of the body in the margin around obstacles and other people
)

POLICY_TERMS: Final = TERMS[: TERMS.index("clearance")]
"""Terms whose weights are inputs of the policy, which sees no obstacles.

A term that the policy need not know stands behind `clearance`.
"""

CLEARANCE: Final = 10.0
"""The weight of "clearance", whatever an agent is doing."""

WALK: Final = {
    "goal_distance": 1.0,
    "facing": 1.0,
    "speed": 0.7,
    "floating": 1.0,
    "sinking": 1.0,
    "skating": 2.0,
    "sliding": 0.5,
    "upright": 3.0,
    "seam": 1.0,
    "clearance": CLEARANCE,
}
"""Weights on the way to a goal."""

STRAFE: Final = WALK | {"goal_distance": 3.0, "facing": 1.0, "speed": 0.3}
"""Weights on the way to a goal while facing elsewhere: sideways or backwards.

`speed` knows no direction: with its weight in WALK the body would walk where it faces.
"""

STAND: Final = {
    "goal_distance": 0.5,
    "facing": 0.3,
    "floating": 1.0,
    "sinking": 1.0,
    "skating": 1.0,
    "sliding": 1.0,
    "upright": 3.0,
    "stillness": 2.0,
    "feet_apart": 0.8,
    "seam": 0.6,
    "clearance": CLEARANCE,
}
"""Stopping and standing."""

TURN: Final = {
    "goal_distance": 1.0,
    "facing": 1.5,
    "floating": 1.0,
    "sinking": 1.0,
    "skating": 2.0,
    "sliding": 0.5,
    "upright": 3.0,
    "stillness": 0.2,
    "seam": 0.6,
    "clearance": CLEARANCE,
}
"""Turning on the spot to a wished facing."""


def weights(table: dict[str, float]) -> list[float]:
    """The table as a list in the order of `TERMS`. Raises KeyError on an unknown name."""
    unknown = set(table) - set(TERMS)
    if unknown:
        raise KeyError(f"unknown quality terms {sorted(unknown)}; allowed: {list(TERMS)}")
    return [table.get(name, 0.0) for name in TERMS]
