"""Islands that lie over other ones: roofs and similar surfaces."""

from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayfarer.errors import Text, spot
from wayfarer.navigation.ground.ground import Ground
from wayfarer.navigation.mesh import NavMesh
from wayfarer.navigation.scene_spec import Point3

Array = NDArray[np.floating[Any]]

SHARE: Final = 0.5
"""An island is a roof if at least this share of its area lies over another one."""
SAMPLES: Final = 40
"""Maximum number of an island's triangles that are checked, the largest first."""


class Roof(NamedTuple):
    """An island over another one."""

    island: int
    area: float
    at: Point3


def roofs_of(mesh: NavMesh, ground: Ground) -> list[Roof]:
    """The islands that lie over other ones, largest first."""
    if len(mesh.areas) < 2 or len(ground.layers) < 2:
        return []
    middles = mesh.corners.mean(1)
    one, other = mesh.corners[:, 1] - mesh.corners[:, 0], mesh.corners[:, 2] - mesh.corners[:, 0]
    area = np.abs(one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]) / 2
    found = []
    for island in np.argsort(-mesh.areas).tolist():
        mine = np.flatnonzero(mesh.island == island)
        mine = mine[np.argsort(-area[mine])][:SAMPLES]
        over = [k for k in mine.tolist() if _is_over(mesh, ground, k, middles[k])]
        if over and area[over].sum() >= SHARE * area[mine].sum():
            x, y = middles[over[0]].tolist()
            height = _height(mesh, ground, over[0], middles[over[0]])
            found.append(Roof(island, float(mesh.areas[island]), (x, y, height)))
    return found


def told_roofs(roofs: Sequence[Roof], islands: int) -> list[Text]:
    """A remark on roofs for the author of a level without entries."""
    if not roofs:
        return []
    return [
        Text(
            "ground lies above ground: {} of {} islands are over another one, such as {} m² at {}; "
            "name an entry on the ground that is meant, and only what can be reached from there is "
            "kept",
            (str(len(roofs)), str(islands), f"{roofs[0].area:,.1f}", spot(roofs[0].at)),
        )
    ]


def _is_over(mesh: NavMesh, ground: Ground, triangle: int, point: Array) -> bool:
    """Whether another island is below the point of a triangle."""
    here = _height(mesh, ground, triangle, point)
    x, y = point.tolist()
    return any(
        mesh.island[below] != mesh.island[triangle] and _height(mesh, ground, below, point) < here
        for below in mesh.under((x, y)).tolist()
    )


def _height(mesh: NavMesh, ground: Ground, triangle: int, point: Array) -> float:
    return float(ground.layers[mesh.layer[triangle]].heights.at(point))
