"""Why no way leads from one island to another: headroom, a step, a slope or width."""

from collections import deque
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import shapely
from numpy.typing import NDArray

from wayfarer.errors import Metres, Text, spot
from wayfarer.navigation.algorithms import labels, nearest_cell
from wayfarer.navigation.clearance import REACH
from wayfarer.navigation.ground.barriers import Barrier, Kind
from wayfarer.navigation.roofs import roofs_of, told_roofs
from wayfarer.navigation.scene_spec import Point3, Walkable

if TYPE_CHECKING:
    from wayfarer.navigation.scene import Scene

Array = NDArray[np.floating[Any]]
Mask = NDArray[np.bool_]

NARROWEST: Final = 0.05
"""Metres to either side of a middle: narrower passages are not reported."""
HALVINGS: Final = 5


def notes_on(scene: "Scene") -> list[Text]:
    """Remarks on the baked ground for a level's author."""
    asked = Metres(scene.spec.walkable.height)
    notes = [
        Text(
            "{} m² of ground can only be reached below a headroom of {} at {}, where {} are asked "
            "for (walkable.height)",
            (f"{low.areas[1]:,.1f}", Metres(round(low.value, 2)), spot(low.at), asked),
        )
        for low in scene.ground.barriers
        if low.kind is Kind.HEADROOM and scene.island_of(low.sides[0]) is not None
    ]
    if not scene.spec.entries:
        notes += told_roofs(roofs_of(scene.mesh, scene.ground), scene.islands)
    return notes


def why_apart(scene: "Scene", one: int, other: int) -> Text | None:
    """A clause that names the barrier between two islands; None: it is unknown.

    It takes some tenths of a second in a large scene.
    """
    walkable = scene.spec.walkable
    if (found := _worst(scene, one, other)) is not None:
        return _text(found, walkable)
    if (narrow := _narrowest(scene, one, other)) is not None:
        return Text(
            "a passage about {} wide at {} is in the way, where {} are asked for (twice "
            "walkable.radius)",
            (Metres(round(narrow[0], 2)), spot(narrow[1]), Metres(2 * walkable.radius)),
        )
    return None


def _text(barrier: Barrier, walkable: Walkable) -> Text:
    """A clause that names the barrier, its place, and the allowed value."""
    length = Metres(round(barrier.value, 2))
    if barrier.kind is Kind.HEADROOM:
        return Text(
            "a headroom of {} at {} is in the way, where {} are asked for (walkable.height)",
            (length, spot(barrier.at), Metres(walkable.height)),
        )
    if barrier.kind is Kind.STEP:
        return Text(
            "a step of {} at {} is in the way, where {} are taken (walkable.step_height)",
            (length, spot(barrier.at), Metres(walkable.step_height)),
        )
    return Text(
        f"a slope of {barrier.value:.0f}° at {{}} is in the way, where {walkable.slope_deg:g}° are "
        "walked on (walkable.slope_deg)",
        (spot(barrier.at),),
    )


def _worst(scene: "Scene", one: int, other: int) -> Barrier | None:
    """The greatest barrier on the way through the fewest barriers, of one kind if such a way
    exists.
    """
    for kinds in ({Kind.HEADROOM}, {Kind.SLOPE}, {Kind.STEP}, set(Kind)):
        if (worst := _worst_of(scene, one, other, kinds)) is not None:
            return worst
    return None


def _worst_of(scene: "Scene", one: int, other: int, kinds: set[Kind]) -> Barrier | None:
    ways: dict[int, list[tuple[int, Barrier]]] = {}
    for barrier in scene.ground.barriers:
        a, b = (scene.island_of(side) for side in barrier.sides)
        if barrier.kind in kinds and a is not None and b is not None:
            ways.setdefault(a, []).append((b, barrier))
            ways.setdefault(b, []).append((a, barrier))
    found: dict[int, Barrier | None] = {one: None}
    waiting = deque([one])
    while waiting:
        here = waiting.popleft()
        for there, barrier in ways.get(here, []):
            if there not in found:
                before = found[here]
                worse = before is not None and before.excess > barrier.excess
                found[there] = before if worse else barrier
                waiting.append(there)
    return found.get(other)


def _narrowest(scene: "Scene", one: int, other: int) -> tuple[float, Point3] | None:
    """Width of the widest passage between two islands of a layer, and where it is narrowest."""
    mesh = scene.mesh
    for number, field in enumerate(scene.fields):
        grid, distance = field.grid, field.distance
        ends = []
        for island in (one, other):
            middles = mesh.corners[(mesh.island == island) & (mesh.layer == number)].mean(1)
            mask = np.zeros(distance.shape, bool)
            if len(middles):
                column, row = np.rint(grid.places(middles)).astype(int).T
                mask[row.clip(0, grid.rows - 1), column.clip(0, grid.columns - 1)] = True
            ends.append(mask)
        low, high = NARROWEST, scene.spec.walkable.radius + grid.cell
        if not all(mask.any() for mask in ends) or low >= high or not _meet(distance >= low, ends):
            continue
        for _ in range(HALVINGS):
            middle = (low + high) / 2
            low, high = (middle, high) if _meet(distance >= middle, ends) else (low, middle)
        row, column = _between(distance, low, high, ends)
        across, ahead = grid.middles()
        x, y = float(across[column]), float(ahead[row])
        height = scene.ground.layers[number].heights.at(np.array([x, y]))
        return 2 * _half_width(scene, number, x, y), (x, y, float(height))
    return None


def _half_width(scene: "Scene", number: int, x: float, y: float) -> float:
    """Metres from the middle of a passage to its sides, near a cell of the field, which may miss
    the middle by half a cell.
    """
    cell = scene.fields[number].grid.cell
    near = shapely.box(x - REACH, y - REACH, x + REACH, y + REACH)
    free = shapely.difference(
        shapely.intersection(scene.ground.layers[number].ground, near),
        shapely.union_all(scene.standing(number, near)),
    )
    offsets = np.stack(np.meshgrid(*[np.linspace(-cell / 2, cell / 2, 9)] * 2), -1).reshape(-1, 2)
    spots = shapely.points(offsets + np.array([x, y]))
    inside = shapely.intersects(free, spots)
    return float(np.where(inside, shapely.distance(shapely.boundary(free), spots), 0.0).max())


def _meet(free: Mask, ends: Sequence[Mask]) -> bool:
    """Whether a component of the free cells holds cells of both ends."""
    number = labels(free)
    one, other = (np.unique(number[mask & free]) for mask in ends)
    return bool(np.isin(one, other).any())


def _between(distance: Array, low: float, high: float, ends: Sequence[Mask]) -> tuple[int, int]:
    """The cell of the gap: free at `low`, not at `high`, and nearest to the free cells on both
    sides.
    """
    number = labels(distance >= high)
    gap = (distance >= low) & (distance < high)
    away = np.zeros(distance.shape)
    rows, columns = np.indices(distance.shape)
    for mask in ends:
        side = np.isin(number, np.setdiff1d(np.unique(number[mask]), 0))
        row, column = nearest_cell(side if side.any() else mask)
        away += np.hypot(rows - row, columns - column)
    best = int(np.where(gap, away, np.inf).argmin())
    return divmod(best, distance.shape[1])
