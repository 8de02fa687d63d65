"""Keeping to the right before people who come the other way: lanes form before streams meet."""

import numpy as np

from wayfarer.world.avoidance.neighbours import Pairs
from wayfarer.world.avoidance.people import Float, People
from wayfarer.world.avoidance.rules import Rules


def keep_right(people: People, pairs: Pairs, preferred: Float, rules: Rules) -> Float:
    """Preferred velocities [A, 2] of people, turned to the right for who is oncoming.

    Everybody in sight counts, not the nearest few: in a stream those are one's own. What counts is
    where others want to go, so who waits is oncoming, too. Of one person that comes the other way
    only the one nearly ahead matters; of a stream its middle shall be passed on the right.
    """
    speed = np.maximum(np.sqrt((preferred * preferred).sum(-1)), 1e-6)
    unit = preferred / speed[:, None]
    ux, uy = unit[pairs.asking].T
    ahead = pairs.dx * ux + pairs.dy * uy
    left = pairs.dy * ux - pairs.dx * uy  # metres by which it would be passed on the right
    near = (ahead > 0) & (ahead < rules.lane_sight) & (np.abs(left) < rules.lane_wide)
    near = np.flatnonzero(near & people.walks[pairs.other])
    asking, ahead, left = pairs.asking[near], ahead[near], left[near]
    theirs = people.memory.preferred[pairs.other[near]]
    fast = np.maximum(np.sqrt((theirs * theirs).sum(-1)), 1e-6)
    oncoming = -(theirs[:, 0] * ux[near] + theirs[:, 1] * uy[near]) / fast > rules.opposite
    asking, ahead, left, fast = asking[oncoming], ahead[oncoming], left[oncoming], fast[oncoming]
    if not len(asking):
        return preferred
    aside = np.maximum(rules.lane - left, 0) / np.maximum(
        ahead / (speed[asking] + fast), rules.lane_soon
    )
    pair = np.zeros(len(speed))
    np.maximum.at(pair, asking, aside * np.clip(left + rules.beside, 0, 1))
    # bincount adds in the order of the pairs, so a sum does not depend on who else is asked
    total = np.bincount(asking, aside, len(speed))
    count = np.maximum(np.bincount(asking, minlength=len(speed)), 1)
    stream = total / count * (1 - 1 / count)
    sideways = np.minimum(np.maximum(pair, stream), rules.lane_most * speed)[:, None]
    way = preferred + sideways * np.stack([unit[:, 1], -unit[:, 0]], -1)
    turned = way * (speed / np.maximum(np.sqrt((way * way).sum(-1)), 1e-6))[:, None]
    return np.asarray(np.where(sideways > 0, turned, preferred), np.float32)
