"""The 67 surface markers: names and how each is found on a T-posed mesh.

Left markers are found by casting a ray from a point inside the body (between joints) and taking
the mesh vertex nearest to where it leaves the skin; right ones in the mirror image. Names
follow the SSM2 set where the place is the same (C7, CLAV, STRN, T10, ARIEL, LFHD …); the list
and the places are our own. Sole markers lie on the underside of the shoe-less foot.
"""

from collections.abc import Callable, Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.body import skeleton

Array = NDArray[np.floating[Any]]
Index = NDArray[np.int64]

Origin = Callable[[Mapping[str, Array]], Array]  # joint name → place gives the ray's start [3]
Ray = tuple[Origin, tuple[float, float, float]]  # start, direction

MIDLINE: Final = 0.004
"""Metres from the plane x = 0 within which a vertex of an uneven mesh counts as central."""


def _between(first: str, second: str, share: float, up: float = 0.0) -> Origin:
    """A point on the way from one joint to another, raised by `up` metres."""
    return lambda at: (1 - share) * at[first] + share * at[second] + [0, 0, up]


def _central(joint: str, up: float = 0.0) -> Origin:
    return lambda at: at[joint] * [0, 1, 1] + [0, 0, up]


# Directions: the body faces +Y, its left is -X, up is +Z.
CENTRAL: Final[Mapping[str, Ray]] = {
    "ARIEL": (_central("head"), (0, 0, 1)),  # top of the head
    "C7": (_central("neck"), (0, -1, 0.1)),
    "T10": (_between("spine2", "spine3", 0.5), (0, -1, 0)),
    "CLAV": (_central("left_collar", -0.015), (0, 1, 0)),  # between the collar bones
    "STRN": (_between("spine2", "spine3", 0.9), (0, 1, 0)),
}

LEFT: Final[Mapping[str, Ray]] = {
    "LFHD": (_central("head", 0.12), (-0.5, 1, 0)),  # front of the head
    "LBHD": (_central("head", 0.12), (-0.9, -1, 0)),  # back of the head
    "LSHO": (_between("left_collar", "left_shoulder", 0.85), (0, 0, 1)),  # top of the shoulder
    "LFSH": (_between("left_collar", "left_shoulder", 0.8, -0.05), (0, 1, 0)),  # front
    "LBSH": (_between("left_collar", "left_shoulder", 0.6, -0.10), (0, -1, 0)),  # shoulder blade
    "LNWST": (_central("spine1", 0.03), (-1, 0, 0)),  # side of the waist
    "LFWT": (_central("pelvis", 0.02), (-0.75, 1, 0)),  # front of the hip bone
    "LBWT": (_central("pelvis", 0.04), (-0.6, -1, 0)),  # dimple of the back
    "LHIP": (_between("left_hip", "left_knee", 0.05), (-1, 0, 0)),  # greater trochanter
    "LUPA": (_between("left_shoulder", "left_elbow", 0.5), (0, -0.5, 1)),  # upper arm
    "LELB": (_between("left_shoulder", "left_elbow", 0.98), (0, -0.3, 1)),  # outer elbow
    "LELBIN": (_between("left_shoulder", "left_elbow", 0.98), (0, -0.3, -1)),
    "LFRM": (_between("left_elbow", "left_wrist", 0.4), (0, -0.5, 1)),  # forearm
    "LIWR": (_between("left_elbow", "left_wrist", 0.97), (0, 1, 0.1)),  # thumb side of the wrist
    "LOWR": (_between("left_elbow", "left_wrist", 0.97), (0, -1, 0.1)),
    "LFIN": (_between("left_wrist", "left_middle1", 0.95), (0, 0, 1)),  # middle knuckle
    "LTHM": (_between("left_thumb1", "left_thumb2", 0.9), (0, 1, 0.3)),  # base of the thumb
    "LTHI": (_between("left_hip", "left_knee", 0.5), (-0.7, 1, 0)),  # front of the thigh
    "LKNE": (_between("left_hip", "left_knee", 0.98), (-1, 0, 0)),  # outer knee
    "LKNI": (_between("left_hip", "left_knee", 0.98), (1, 0, 0)),
    "LSHN": (_between("left_knee", "left_ankle", 0.45), (0, 1, 0)),
    "LCLF": (_between("left_knee", "left_ankle", 0.3), (-0.2, -1, 0)),  # calf
    "LANK": (_between("left_knee", "left_ankle", 0.98), (-1, -0.1, 0)),  # outer ankle
}

FOOT: Final = ("LHEE", "LTOE", "LMT1", "LMT5")
"""Back of the heel, tip of the big toe, balls of the big and the little toe: extreme points."""

SOLE: Final = ("HEEL", "MT1", "MT5", "TOE")
"""Markers on the underside of each foot, such as LSOLE_HEEL."""

AROUND_SOLE: Final = ("HEE", "MT1", "MT5", "TOE")
"""The markers of `FOOT`, and of MOJO's SSM2, that are nearest to each of `SOLE`."""


def marker_names() -> tuple[str, ...]:
    """67 names: 5 central ones, 31 left ones, and their 31 mirror images in the same order."""
    left = (*LEFT, *FOOT, *(f"LSOLE_{part}" for part in SOLE))
    return (*CENTRAL, *left, *("R" + name[1:] for name in left))


def mirrored(name: str) -> str:
    """The name of the marker on the other side; a central marker is its own mirror."""
    if name in CENTRAL:
        return name
    return ("R" if name[0] == "L" else "L") + name[1:]


def find_markers(
    vertices: Array, faces: Index, joints: Mapping[str, Array], mirror: Index | None = None
) -> Index:
    """Vertex index of each marker [67], on a body in the T-pose standing on z = 0.

    joints: canonical name → place. `mirror` [V], each vertex's mirror image, makes the right
    markers exact mirrors of the left ones; without it they are found in the mirrored body.
    Raises ValueError when a ray misses the mesh or two markers meet.
    """
    found = _central_markers(vertices, faces, joints, mirror)
    left = _left_markers(vertices, faces, joints)
    if mirror is not None:
        right = {name: int(mirror[vertex]) for name, vertex in left.items()}
    else:
        flip = np.array([-1.0, 1.0, 1.0])
        other = {name: joints[skeleton.mirrored(name)] * flip for name in joints}
        right = _left_markers(vertices * flip, faces[:, ::-1], other)
    found |= left | {"R" + name[1:]: vertex for name, vertex in right.items()}
    indices = [found[name] for name in marker_names()]
    if len(set(indices)) != len(indices):
        twice = [n for n in marker_names() if indices.count(found[n]) > 1]
        raise ValueError(f"markers {twice} share a vertex")
    return np.array(indices, dtype=np.int64)


def find_soles(vertices: Array, joints: Mapping[str, Array]) -> Index:
    """Vertices [8] under both feet, left ones first, in the order of `SOLE`.

    Arguments as in `find_markers`. Raises ValueError when there are no vertices near the floor.
    """
    flip = np.array([-1.0, 1.0, 1.0])
    feet = [(vertices, joints["left_foot"]), (vertices * flip, joints["right_foot"] * flip)]
    found = [_soles(body, _foot(body, ball)) for body, ball in feet]
    return np.array([foot[f"LSOLE_{part}"] for foot in found for part in SOLE], dtype=np.int64)


def _central_markers(
    vertices: Array, faces: Index, joints: Mapping[str, Array], mirror: Index | None
) -> dict[str, int]:
    """Points on the midline: exact for a symmetric mesh, otherwise within a few millimetres."""
    if mirror is not None:
        middle = np.flatnonzero(mirror == np.arange(len(mirror)))
    else:
        middle = np.flatnonzero(np.abs(vertices[:, 0]) < MIDLINE)
    return {
        name: _nearest(vertices, middle, ray_exit(vertices, faces, origin(joints), direction))
        for name, (origin, direction) in CENTRAL.items()
    }


def _left_markers(vertices: Array, faces: Index, joints: Mapping[str, Array]) -> dict[str, int]:
    left = np.flatnonzero(vertices[:, 0] < -1e-6)
    left_faces = faces[(vertices[faces, 0] < MIDLINE).all(-1)]  # rays must not meet the other leg
    found = {
        name: _nearest(vertices, left, ray_exit(vertices, left_faces, origin(joints), direction))
        for name, (origin, direction) in LEFT.items()
    }
    found |= _foot(vertices, joints["left_foot"])
    return found | _soles(vertices, found)


def _foot(vertices: Array, ball: Array) -> dict[str, int]:
    """Extreme points of the left foot around its ball joint."""
    foot = np.flatnonzero((vertices[:, 0] < 0) & (vertices[:, 2] < 0.06))
    x, y = vertices[foot, 0], vertices[foot, 1]

    def extreme(value: Array, where: NDArray[np.bool_]) -> int:
        return int(foot[np.where(where, value, -np.inf).argmax()])

    return {
        "LHEE": extreme(-y, x < 0),
        "LTOE": extreme(y, x > ball[0]),  # the big toe is on the inner side
        "LMT1": extreme(x, np.abs(y - ball[1]) < 0.015),
        "LMT5": extreme(-x, np.abs(y - ball[1] + 0.02) < 0.015),
    }


def _soles(vertices: Array, found: Mapping[str, int]) -> dict[str, int]:
    """The lowest vertices near the heel, both balls and the big toe."""
    heel, toe, inner, outer = (vertices[found[n]] for n in ("LHEE", "LTOE", "LMT1", "LMT5"))
    targets = {
        "HEEL": heel + np.array([0, 0.035, 0]),
        "MT1": inner + 0.25 * (outer - inner),
        "MT5": outer + 0.25 * (inner - outer),
        "TOE": toe - np.array([0, 0.02, 0]),
    }
    left = np.flatnonzero(vertices[:, 0] < 0)
    chosen = {}
    for part, target in targets.items():
        distance = np.linalg.norm(vertices[left, :2] - target[:2], axis=-1)
        cost = vertices[left, 2] + 0.15 * distance + np.where(distance > 0.02, 1.0, 0.0)
        chosen[f"LSOLE_{part}"] = int(left[cost.argmin()])
    return chosen


def ray_exit(
    vertices: Array, faces: Index, origin: Array, direction: tuple[float, float, float]
) -> Array:
    """Where a ray leaves the mesh for the last time, [3]. Möller–Trumbore over all faces."""
    along = np.array(direction) / np.linalg.norm(direction)
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    edge_ab, edge_ac, offset = b - a, c - a, origin - a
    p, q = np.cross(along, edge_ac), np.cross(offset, edge_ab)
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = 1 / np.sum(edge_ab * p, axis=-1)
        u = np.sum(offset * p, axis=-1) * inverse
        v = (q @ along) * inverse
        distance = np.sum(edge_ac * q, axis=-1) * inverse
        hit = (u >= -1e-9) & (v >= -1e-9) & (u + v <= 1 + 1e-9) & (distance > 0)
    if not hit.any():
        raise ValueError(f"a ray from {origin} towards {direction} does not meet the mesh")
    return np.asarray(origin + along * distance[hit].max())


def _nearest(vertices: Array, candidates: Index, place: Array) -> int:
    distance = np.linalg.norm(vertices[candidates] - place, axis=-1)
    return int(candidates[distance.argmin()])
