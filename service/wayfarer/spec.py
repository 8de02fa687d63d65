"""The constants of a motion primitive, shared by training, export and serving.

This module imports nothing of the project, so that everything may import it.
An exported graph carries these values in its metadata; `artifacts.py` refuses a
graph whose values differ.
"""

from typing import Final

FPS: Final = 40
"""Frames per second of every primitive, stream and prepared clip (paper Sec. 4)."""

PRIMITIVE_FRAMES: Final = 10
"""Frames of one motion primitive, its seed included: 0.25 s."""

SEED_FRAMES: Final = 2
"""Frames that a primitive shares with the one before, as served (the 2-frame model)."""

NEW_FRAMES: Final = PRIMITIVE_FRAMES - SEED_FRAMES
"""New frames of a step: 8, or `STEP_SECONDS` of real time."""

STEP_SECONDS: Final = NEW_FRAMES / FPS
"""Real time covered by one step: an agent is stepped every 0.2 s."""

TURN: Final = 6.2832
"""A full turn in radians, rounded up: a greater heading is probably in degrees."""

MARKERS: Final = 67
"""Body-surface markers per frame."""

LATENT: Final = 128
"""Size of the CVAE latent z, which is also the policy's action."""

MANNER: Final = 8
"""Numbers of an agent's manner: how it moves whatever it does."""

BETAS: Final = 10
"""Body shape coefficients per gender."""

POSED_JOINTS: Final = 22
"""Joints whose rotation the regressor finds: the root and 21 body joints."""

JOINTS: Final = 52
"""Bones of the skeleton, SMPL-H order; the last 30 are fingers, held at rest."""

GENDERS: Final = ("male", "female")
"""Bodies and regressors come per gender (paper Sec. 3.2.1); a graph serves one."""

OBSTACLES: Final = 8
"""Most obstacles near an agent that a step gets."""

ROLLOUT_PRIMITIVES: Final = 8
"""Primitives of one training rollout (paper Sec. 3.2.2)."""

MAX_COORDINATE: Final = 10_000.0
"""Metres. Float32 keeps about 1 mm there; positions beyond are refused."""
