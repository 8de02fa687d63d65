"""A* over the triangles of a navigation mesh."""

from heapq import heappop, heappush
from math import hypot, inf

from wayfarer.navigation.mesh import NavMesh, Portal

Spot = tuple[float, float]


def corridor(
    mesh: NavMesh, first: int, last: int, start: Spot, goal: Spot, aim: bool = True
) -> list[Portal] | None:
    """The portals of a short way from triangle `first` to `last`; None where there is none.

    How far a way is can only be guessed before its string is pulled. It is measured through one
    point of each portal: with `aim` the one where the straight line to the goal crosses it (or the
    end nearest to that), without it the one nearest to the point before. Each guess overlooks
    short ways that the other finds.
    """
    if mesh.island[first] != mesh.island[last]:
        return None
    gx, gy = goal
    portals = mesh.portals
    best = {first: 0.0}
    came: dict[int, tuple[int, Portal]] = {}
    queue = [(hypot(gx - start[0], gy - start[1]), 0.0, first, start[0], start[1])]
    while queue:
        _, cost, here, x, y = heappop(queue)
        if here == last:
            return _trace(came, first, last)
        if cost > best[here]:
            continue
        dx, dy = gx - x, gy - y
        for portal in portals[here]:
            there, lx, ly, rx, ry = portal
            least = best.get(there, inf)
            if least <= cost:
                continue
            # the crossing is not a function of its own: this is where the time goes
            ex, ey = lx - rx, ly - ry
            if aim:
                across = dx * ey - dy * ex
                share = (dy * (rx - x) - dx * (ry - y)) / across if across else 0.5
            else:
                share = ((x - rx) * ex + (y - ry) * ey) / (ex * ex + ey * ey)
            share = 0.0 if share < 0.0 else min(share, 1.0)
            px, py = rx + share * ex, ry + share * ey
            spent = cost + hypot(px - x, py - y)
            if spent < least:
                best[there] = spent
                came[there] = here, portal
                heappush(queue, (spent + hypot(gx - px, gy - py), spent, there, px, py))
    return None


def _trace(came: dict[int, tuple[int, Portal]], first: int, last: int) -> list[Portal]:
    way = []
    while last != first:
        last, portal = came[last]
        way.append(portal)
    return way[::-1]
