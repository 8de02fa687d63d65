"""What a velocity costs a person among others: the sum of a few terms, each a function here."""

from collections.abc import Callable

import numpy as np

from wayfarer.world.avoidance.neighbours import Neighbours
from wayfarer.world.avoidance.people import Float, People
from wayfarer.world.avoidance.rules import Rules
from wayfarer.world.rows import Index

Clearance = Callable[[Float], Float]
"""Metres to the nearest wall [A, N] at points [A, N, 2]."""


def costs(
    people: People,
    rows: Index,
    near: Neighbours,
    way: Float,
    tried: Float,
    last: Float,
    clear: Clearance | None,
    left: Float | None,
    rules: Rules,
) -> Float:
    """Costs [A, C] of the velocities `tried` [A, C, 2] by people at `rows` who want to go `way`."""
    total = rules.deviation * _apart(tried, way) + rules.change * _apart(tried, last)
    total += meetings(people, rows, near, tried, left, rules)
    if clear is not None:
        total += walls(people, rows, tried, clear, rules)
    return total


def meetings(
    people: People, rows: Index, near: Neighbours, tried: Float, left: Float | None, rules: Rules
) -> Float:
    """How soon and how nearly others are met. [A, C]"""
    own, their = people.velocity[rows], people.velocity[near.index]
    # w: velocity relative to the other, reciprocal (2v - own - theirs) where it gives way, too;
    # close by it would be too late to rely on that
    gives_way = people.walks[near.index] & ((their * their).sum(-1) > 0.09)
    touch = people.radius[rows][:, None] + people.radius[near.index]
    far = np.clip((near.distance - touch) / rules.close - 1, 0, 1)
    share = 1 + gives_way * far
    base = (share - 1)[..., None] * own[:, None] + their
    # [A, K, C] from here on: sums over K neighbours are then fast
    vx, vy = tried[:, None, :, 0], tried[:, None, :, 1]
    wx = share[:, :, None] * vx - base[:, :, None, 0]
    wy = share[:, :, None] * vy - base[:, :, None, 1]
    # until the body reacts it keeps its velocity
    dx = near.dx[:, :, None] - rules.reaction * (own[:, None, None, 0] - vx)
    dy = near.dy[:, :, None] - rules.reaction * (own[:, None, None, 1] - vy)
    along, fast = wx * dx + wy * dy, np.maximum(wx * wx + wy * wy, 1e-4)
    at = (along / fast).clip(rules.soon, rules.horizon)  # seconds to the nearest approach
    if left is not None:  # whom it would meet behind the place where it stops, it does not meet
        speed = np.sqrt((tried * tried).sum(-1))
        stops = left[:, None] / np.maximum(speed, 1e-3)
        at = np.minimum(at, np.maximum(stops, rules.soon)[:, None])
    dx -= wx * at
    dy -= wy * at
    square = dx * dx + dy * dy

    mine = people.group[rows][:, None]
    same = (mine > 0) & (people.group[near.index] == mine)
    # the longer an agent has waited, the less room it asks for and the less far it looks ahead:
    # people who all stand 0.8 m apart could else not move, for fear of a touch seconds later
    waited = people.memory.waited[rows]
    asked = np.maximum(rules.comfort / (1 + waited / rules.push), rules.least_comfort)
    if left is not None:  # nor does it ask for more room on the way than where it stops
        asked = np.minimum(asked, np.maximum(rules.stands_apart, 0.25 * left))
    # an agent that stands will stay where it is, and can be passed closely
    stands = ~people.walks[near.index] & ~their.any(-1)
    asked = np.where(stands, np.minimum(asked, rules.beside_standing)[:, None], asked[:, None])
    room = touch + np.where(same, 0.05, asked)
    weight = np.where(near.nobody, 0, rules.collision / np.where(same, 0.05, rules.comfort))
    room, weight = room[:, :, None], weight.astype(np.float32)[:, :, None]
    depth = weight * np.maximum(room - np.sqrt(square), 0)
    sooner = at - np.sqrt(np.maximum(room * room - square, 0) / fast)
    horizon = np.maximum(rules.horizon / np.maximum(waited / rules.hurry, 1), rules.shortest)
    away = (sooner / horizon[:, None, None]).clip(0, 1)
    each = depth * (1 / (0.1 + away) - 1 / 1.1)
    return np.asarray(each.max(1) + 0.25 * each.sum(1), np.float32)


def walls(people: People, rows: Index, tried: Float, clear: Clearance, rules: Rules) -> Float:
    """How far a way leads into walls within the next second. [A, C]"""
    own = people.velocity[rows]
    slip = rules.reaction * (own[:, None] - tried)
    start = people.position[rows]
    times = np.array(rules.wall_times, np.float32)
    points = start[:, None, None] + slip[:, :, None] + tried[:, :, None] * times[:, None]
    count, fan = tried.shape[:2]
    flat = np.concatenate([points.reshape(count, -1, 2), start[:, None]], 1)
    room = clear(flat.astype(np.float32))
    # a person that is too near already may go wherever it is no nearer
    wanted = np.minimum(people.radius[rows] + rules.wall_room, room[:, -1])
    lack = np.maximum(wanted[:, None] - room[:, :-1], 0).reshape(count, fan, len(times))
    return np.asarray(rules.wall * (lack / rules.wall_room).max(-1), np.float32)


def _apart(a: Float, b: Float) -> Float:
    """Metres per second between velocities a [A, C, 2] and b [A, 2]. [A, C]"""
    gap = a - b[:, None]
    return np.sqrt((gap * gap).sum(-1))
