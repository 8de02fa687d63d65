"""Keeping to the right before people who come the other way: lanes form before streams meet."""

import numpy as np

from wayfarer.world.avoidance.people import Float, People
from wayfarer.world.avoidance.rules import Rules
from wayfarer.world.rows import Index


def keep_right(people: People, rows: Index, preferred: Float, rules: Rules) -> Float:
    """Preferred velocities [A, 2] of people at `rows`, turned to the right for who is oncoming.

    Everybody in sight counts, not the nearest few: in a stream those are one's own. What counts is
    where others want to go, so who waits is oncoming, too. Of one person that comes the other way
    only the one nearly ahead matters; of a stream its middle shall be passed on the right.
    """
    speed = np.maximum(np.sqrt((preferred * preferred).sum(-1)), 1e-6)[:, None]
    ux, uy = preferred[:, :1] / speed, preferred[:, 1:] / speed
    theirs = people.memory.preferred
    fast = np.maximum(np.sqrt((theirs * theirs).sum(-1)), 1e-6)
    dx = people.position[:, 0] - people.position[rows, :1]
    dy = people.position[:, 1] - people.position[rows, 1:]
    against = -(theirs[:, 0] * ux + theirs[:, 1] * uy) / fast
    ahead = dx * ux + dy * uy
    left = dy * ux - dx * uy  # metres by which it would be passed on the right
    near = (ahead > 0) & (ahead < rules.lane_sight) & (np.abs(left) < rules.lane_wide)
    oncoming = near & people.walks & (against > rules.opposite)
    if not oncoming.any():
        return preferred
    soon = np.maximum(ahead / (speed + fast), rules.lane_soon)
    aside = np.maximum(rules.lane - left, 0) / soon * oncoming
    pair = (aside * np.clip(left + rules.beside, 0, 1)).max(-1, keepdims=True)
    count = np.maximum(oncoming.sum(-1, keepdims=True), 1)
    stream = aside.sum(-1, keepdims=True) / count * (1 - 1 / count)
    sideways = np.minimum(np.maximum(pair, stream), rules.lane_most * speed)
    way = preferred + sideways * np.concatenate([uy, -ux], -1)
    turned = way * (speed / np.maximum(np.sqrt((way * way).sum(-1, keepdims=True)), 1e-6))
    return np.asarray(np.where(sideways > 0, turned, preferred), np.float32)
