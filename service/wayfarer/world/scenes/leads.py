"""The point that an agent heads for on its way: the farthest to which no corner is cut."""

from functools import cache
from math import acos, inf, radians, sqrt
from typing import Final, NamedTuple

import numpy as np

from wayfarer.process.compiled import compiled, inner, warm
from wayfarer.world.agents.goal import GoalColumns
from wayfarer.world.goals.gait_rules import GoalArrays
from wayfarer.world.output.turns import between, bounded
from wayfarer.world.rows import Double, Flags, Float, Index, columns
from wayfarer.world.scenes.collision_avoidance import PASSED

REACH: Final = 1.0
"""Metres along its way to the point that an agent heads for."""

SHARES: Final = (1.0, 0.75, 0.5, 0.3, 0.15)
"""Shares of `REACH` that are tried in turn, until the straight line there cuts no corner."""

LINE: Final = np.linspace(0.0, 1.0, 8)
"""Shares of a straight line at which its distance from walls is tested."""

ROOM: Final = 0.2
"""Metres beyond the radius that a straight line keeps from walls, where the way itself does."""

SLACK: Final = 0.01
"""Metres by which a straight line may come nearer to walls than it should."""

ELBOW: Final = 0.18
"""Metres beyond the radius that the hips keep from walls where they can: arms swing."""

CLOSE: Final = 0.05
"""Value of `ROOM` and `ELBOW` in a crowd, in metres: otherwise all would walk in single file."""

PUSH: Final = (2.5, 0.25)
"""Lateral push per metre of missing clearance, and the deficit (m) at which it saturates."""

CURVE: Final = (0.4, 1.6)
"""Metres ahead between which the bend of a way is taken."""

BENDS: Final = (radians(25.0), radians(80.0))
CORNER_SPEED: Final = (1.5, 0.75)
"""Maximum m/s at these bends, linear in between: sharp turns are taken slowly."""

NARROW: Final = (0.02, 0.15)
NARROW_SPEED: Final = (0.8, 1.5)
"""Maximum m/s, by the room (m) that the way leaves beside the radius: gaps are passed slowly."""

TRIED: Final = len(SHARES)
METRES: Final = np.array([REACH * share for share in SHARES] + list(CURVE))
"""Metres along the way to the points that the rules read: those tried, and those of the bend."""


class Space(NamedTuple):
    """The room that some agents [A] have."""

    lines: Double  # [A, S L] metres from the points of `look_along` to walls
    near: Double  # metres to the nearest wall
    away: Double  # [A, 2] direction from there, see `ClearanceField.sample`
    radius: Double  # metres that an agent keeps from walls
    crowded: Flags  # whether it walks in a crowd


@compiled
def look_along(hips: Float, points: Double, lines: Double) -> None:
    """Writes points [A, S L, 3] of straight lines from `hips` [A, 2] to points [A, S + 2, 3]."""
    for row in range(len(hips)):
        for k in range(TRIED):
            for step in range(len(LINE)):
                at = k * len(LINE) + step
                for axis in range(2):
                    here = float(hips[row, axis])
                    lines[row, at, axis] = here + LINE[step] * (points[row, k, axis] - here)
                lines[row, at, 2] = points[row, k, 2]


@compiled
def lead_rows(
    hips: Float, led: Index, points: Double, ends: Flags, space: Space, ahead: GoalArrays
) -> None:
    """Writes the points that agents [A] at `hips` [A, 2] head for to rows `led` of `ahead`, and how
    fast they walk there. `points` [A, S + 2, 3] of their ways at `METRES`; `ends` [A, S + 2]: which
    of them are the end.
    """
    for row in range(len(led)):
        at, radius, crowded = led[row], space.radius[row], space.crowded[row]
        best, room = _visible(space, row)
        if not ends[row, best]:
            lack = radius + (CLOSE if crowded else ELBOW) - space.near[row]
            push = PUSH[0] * bounded(lack, 0.0, PUSH[1])
            x = points[row, best, 0] + push * space.away[row, 0]
            y = points[row, best, 1] + push * space.away[row, 1]
            ahead.position[at, 0], ahead.position[at, 1] = x, y
            x, y = x - hips[row, 0], y - hips[row, 1]
            far = max(sqrt(x * x + y * y), 1e-6)
            ahead.through[at], ahead.radius[at], ahead.bend[at] = True, PASSED, 0.0
            ahead.onward[at, 0], ahead.onward[at, 1] = x / far, y / far
            if not ahead.strafe[at]:
                ahead.heading[at, 0] = ahead.heading[at, 1] = 0.0
        into_x, into_y = points[row, -2, 0] - hips[row, 0], points[row, -2, 1] - hips[row, 1]
        out_x, out_y = (
            points[row, -1, 0] - points[row, -2, 0],
            points[row, -1, 1] - points[row, -2, 1],
        )
        into, out = sqrt(into_x * into_x + into_y * into_y), sqrt(out_x * out_x + out_y * out_y)
        bend = np.float32(0)
        if out > 0.1:
            into = max(into, 1e-6)
            turn = (into_x / into) * (out_x / out) + (into_y / into) * (out_y / out)
            bend = np.float32(acos(bounded(turn, -1.0, 1.0)))
        corner = between(float(bend), BENDS, CORNER_SPEED)
        most = min(corner, between(room, NARROW, NARROW_SPEED))
        ahead.speed[at] = min(float(ahead.speed[at]), most)


@inner
def _visible(space: Space, row: int) -> tuple[int, float]:
    """The first point, farthest first, that a straight line leads to; and the room that the way
    leaves up to the farthest: metres beyond the radius.
    """
    lines, count = space.lines[row], len(LINE)
    keeps = space.radius[row] + (CLOSE if space.crowded[row] else ROOM)
    best, own = TRIED - 1, inf
    for k in range(TRIED - 1, -1, -1):
        own = min(own, lines[(k + 1) * count - 1])  # the way itself keeps this room up to there
        # an agent that stands too near already may go wherever it is no nearer than that
        if lines[k * count : (k + 1) * count].min() >= min(keeps, own, lines[0]) - SLACK:
            best = k
    return best, own - space.radius[row]


@cache
def prepare() -> None:
    """Compiles the rules, or loads them, before agents walk."""
    row, flag, hips = np.zeros(1, np.int64), np.zeros(1, np.bool_), np.zeros((1, 2), np.float32)
    points, lines = np.zeros((1, len(METRES), 3)), np.zeros((1, TRIED * len(LINE), 3))
    warm(look_along, hips, points, lines)
    space = Space(lines[..., 0].copy(), np.zeros(1), np.zeros((1, 2)), np.zeros(1), flag)
    ends, ahead = np.zeros(points.shape[:2], np.bool_), columns(GoalArrays, GoalColumns.empty(1))
    warm(lead_rows, hips, row, points, ends, space, ahead)
