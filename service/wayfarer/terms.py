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
    "clearance",  # m, how far the body comes into the margin around obstacles and other people
)

TOLD: Final = TERMS[:-1]
"""Those whose weights the policy is told: what is near an agent it does not see."""

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
"""On the way to a goal."""

STRAFE: Final = WALK | {"goal_distance": 3.0, "facing": 1.0, "speed": 0.3}
"""On the way to a goal while facing elsewhere: sideways or backwards.

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

REWARDS: Final = (
    "path",  # Eq. 5: the hips move the way to the goal
    "orientation",  # Eq. 6: the body faces the goal, or as wished
    "contact",  # Eq. 7: hips keep their height, something stays where it is
    "pose_prior",  # Eq. 8: the pose is a usual one
    "speed",  # exp of the quality term of this name, and so on; not in the paper
    "sliding",
    "upright",
    "seam",
    "goal",  # Eq. 9: how close the agent came in the whole episode
)
"""Rewards of policy training (Eq. 4), each 0…1, higher is better; see `motion/reward.py`."""

PAPER_REWARD: Final = {
    "path": 1.0,
    "orientation": 1.0,
    "contact": 1.0,
    "pose_prior": 1.0,
    "goal": 1.0,
}
"""Eq. 4. The paper names no β; in GAMMA's code all are 1 but the orientation's, which is 0.5."""

REWARD: Final = PAPER_REWARD | {
    "orientation": 0.5,
    "speed": 1.0,
    "sliding": 0.5,
    "upright": 0.5,
    "seam": 0.5,
}
"""What our policies are trained with."""

REWARD_SCALES: Final = {"speed": 0.3, "sliding": 0.3, "upright": 0.06, "seam": 0.5}
"""Value of a quality term at which its reward has fallen to 1/e: exp(-term / scale)."""


def weights(table: dict[str, float]) -> list[float]:
    """The table as a list in the order of `TERMS`. Raises KeyError on an unknown name."""
    unknown = set(table) - set(TERMS)
    if unknown:
        raise KeyError(f"unknown quality terms {sorted(unknown)}; allowed: {list(TERMS)}")
    return [table.get(name, 0.0) for name in TERMS]
