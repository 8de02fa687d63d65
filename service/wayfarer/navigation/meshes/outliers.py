"""Parts of a level that lie far from all else and have no ground to walk on.

A sky dome would make the cells of the ground coarse, or the scene too large, and its top would
count as ground; a stray triangle far away does the same. Both are left out, and named.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.errors import Metres, Text, spot
from wayfarer.navigation.algorithms import components, links
from wayfarer.navigation.scene_spec import MAX_EXTENT, Point3

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]

APART: Final = 3.0
"""Metres between unrelated parts, more in large scenes."""
SHARE: Final = 0.01
"""The same, as a share of the scene's extent."""
WIDER: Final = 1.5
"""A dome is wider than the rest by this factor, along both axes."""
LOOKS_UP: Final = (10.0, 25.0, 45.0, 65.0)
SEEN: Final = 0.75
"""Elevations, in degrees, at which a dome is looked for all around, and the minimum share of these
looks that meet it: many domes are open at the top."""
SMALL: Final = 0.05
"""A part that is left out has at most this share of the largest part's level surface."""
FINE_AREA: Final = 5_000.0
"""Square metres up to which a scene has the finest cells."""
_MOST: Final = 3_000_000
"""Number of points at which triangles are sampled."""


def without_outliers(
    corners: Array, level: Mask, entries: tuple[Point3, ...]
) -> tuple[Mask, list[Text]]:
    """Which triangles [T, 3, 3] stay, and remarks about the others. `level` [T]: flat enough to
    stand on.

    Domes are always left out, other parts only if they enlarge the scene needlessly.
    """
    kept, notes = np.ones(len(corners), bool), list[Text]()
    part = parts(corners)
    if part.max(initial=0) == 0:
        return kept, notes
    count = part.max() + 1
    low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    np.minimum.at(low, part, corners.min(1))
    np.maximum.at(high, part, corners.max(1))
    there = np.ones(count, bool)
    while (dome := _dome_of(corners, part, kept, low, high, there)) is not None:
        mine = part == dome
        kept &= ~mine
        there[dome] = False
        notes.append(_dome(corners[mine], corners[kept]))
    flat = np.bincount(part[level], _plan_area(corners[level]), count)
    large = there & (flat > SMALL * flat[there].max())
    outside = (low > high[large].max(0))[:, :2] | (high < low[large].min(0))[:, :2]
    far = there & ~large & outside.any(1) & ~_entered(low, high, entries)
    stray = far[part] & kept
    if stray.any() and _shrinks(corners[kept], corners[kept & ~stray]):
        kept &= ~stray
        notes.append(_stray(corners[stray]))
    return kept, notes


def parts(corners: Array) -> Ints:
    """The number of the part that each triangle belongs to. [T]

    Cells that touch form one part; triangles are sampled densely.
    """
    low = corners.min((0, 1))
    extent = float((corners.max((0, 1)) - low).max())
    size = max(APART, SHARE * extent)
    side = np.linalg.norm(corners - np.roll(corners, 1, 1), axis=-1).max(1)
    steps = np.maximum(np.ceil(side / (size / 2)), 1)
    while ((steps + 1) * (steps + 2) / 2).sum() > _MOST and steps.max() > 1:
        size *= 2
        steps = np.maximum(np.ceil(side / (size / 2)), 1)
    cells, owner = [], []
    for count in np.unique(steps).astype(int).tolist():
        mine = np.flatnonzero(steps == count)
        a, b = np.divmod(np.arange((count + 1) ** 2), count + 1)
        share = np.stack([a, b], 1)[a + b <= count] / count
        weights = np.column_stack([1 - share.sum(1), share])
        points = np.einsum("pk,tkd->tpd", weights, corners[mine])
        cells.append(np.floor((points - low) / size).astype(np.int64).reshape(-1, 3))
        owner.append(np.repeat(mine, len(weights)))
    wide = int(np.concatenate(cells).max()) + 3
    key = (np.concatenate(cells) + 1) @ np.array([wide * wide, wide, 1])
    names, name = np.unique(key, return_inverse=True)
    one, other = [], []
    around = np.stack(np.meshgrid(*[(-1, 0, 1)] * 3, indexing="ij"), -1).reshape(-1, 3)
    for offset in (around @ np.array([wide * wide, wide, 1])).tolist():
        if offset > 0:
            at = np.minimum(np.searchsorted(names, names + offset), len(names) - 1)
            near = np.flatnonzero(names[at] == names + offset)
            one.append(near)
            other.append(at[near])
    _, number = components(links(len(names), np.concatenate(one), np.concatenate(other)))
    found = np.empty(len(corners), np.int64)
    found[np.concatenate(owner)] = number[name]
    return found


def _dome_of(
    corners: Array,
    part: Ints,
    kept: Mask,
    low: Array,
    high: Array,
    there: Mask,
) -> int | None:
    """A part that lies over all others like a sky; None: there is none."""
    for number in np.flatnonzero(_widest(low, high, there)).tolist():
        mine = part == number
        if _covers(corners[mine], corners[kept & ~mine]):
            return int(number)
    return None


def _covers(part: Array, rest: Array) -> bool:
    """Whether a part is much wider than the rest and, seen from on top of that, covers the sky."""
    if len(rest) == 0:
        return False
    low, high = part.min((0, 1)), part.max((0, 1))
    inner, top = rest.min((0, 1)), rest.max((0, 1))
    if not ((high - low)[:2] > WIDER * (top - inner)[:2]).all():
        return False
    eye = np.array([*(inner + top)[:2] / 2, top[2]])
    turn, lift = np.meshgrid(np.linspace(0, 2 * np.pi, 8, endpoint=False), np.radians(LOOKS_UP))
    looks = np.stack([np.cos(turn) * np.cos(lift), np.sin(turn) * np.cos(lift), np.sin(lift)], -1)
    met = [_meets(part - eye, look) for look in looks.reshape(-1, 3)]
    return bool(np.mean(met) >= SEEN)


def _meets(corners: Array, way: Array) -> bool:
    """Whether a ray from the origin meets a triangle [T, 3, 3] (Moeller and Trumbore)."""
    a = corners[:, 0]
    one, other = corners[:, 1] - a, corners[:, 2] - a
    across = np.cross(way, other)
    turn = (one * across).sum(-1)
    turn = np.where(np.abs(turn) < 1e-12, np.inf, turn)  # it runs along the triangle
    u = -(a * across).sum(-1) / turn
    beside = np.cross(-a, one)
    v = (beside * way).sum(-1) / turn
    along = (beside * other).sum(-1) / turn
    return bool(((u >= 0) & (v >= 0) & (u + v <= 1) & (along > 0)).any())


def _cross(a: Array, b: Array) -> Array:
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


def _plan_area(corners: Array) -> Array:
    sides = corners[:, 1:, :2] - corners[:, :1, :2]
    return np.abs(_cross(sides[:, 0], sides[:, 1])) / 2


def _shrinks(whole: Array, rest: Array) -> bool:
    """Whether the rest of a scene has finer cells than the whole, or fits although the whole does
    not.
    """
    before, after = (np.ptp(c.reshape(-1, 3)[:, :2], axis=0) for c in (whole, rest))
    return bool(
        (before.prod() > FINE_AREA and after.prod() < 0.9 * before.prod())
        or before.max() > MAX_EXTENT >= after.max()
    )


def _widest(low: Array, high: Array, there: Mask) -> Mask:
    """Parts that reach as far as all others to each side, as a dome does. [P]"""
    reach = (low <= low[there].min(0))[:, :2] & (high >= high[there].max(0))[:, :2]
    found: Mask = there & reach.all(1)
    return found


def _entered(low: Array, high: Array, entries: tuple[Point3, ...]) -> Mask:
    """Parts with an entry. [P]"""
    found = np.zeros(len(low), bool)
    for entry in entries:
        found |= ((low - APART <= entry) & (entry <= high + APART)).all(1)
    return found


def _dome(part: Array, rest: Array) -> Text:
    width, depth, _ = np.ptp(part.reshape(-1, 3), axis=0)
    x, y, _ = np.ptp(rest.reshape(-1, 3), axis=0)
    return Text(
        "left out: {} triangles, {} x {}, that lie over all else ({} x {}) like a sky",
        (f"{len(part):,}", *_rounded(width, depth), *_rounded(x, y)),
    )


def _stray(part: Array) -> Text:
    width, depth, _ = np.ptp(part.reshape(-1, 3), axis=0)
    return Text(
        "left out: {}, {} x {}, far from all else, at {}; an entry there keeps it",
        (
            "1 triangle" if len(part) == 1 else f"{len(part):,} triangles",
            *_rounded(width, depth),
            spot(part.mean((0, 1)).tolist()),
        ),
    )


def _rounded(*metres: float) -> list[Metres]:
    return [Metres(round(float(value), 1)) for value in metres]
