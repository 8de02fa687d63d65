"""Motion control as the paper tests it (Sec. 4.2, Table 1): random bodies, random goals.

A body stands in the centre of an area of 20 × 20 m; its goal lies anywhere in it. *Offline* methods
grow a tree of primitives for each pair (`world.search.beam`), as the paper does: all nodes of a
level are the body's clones, and the simulation ends when one of them reaches the goal or after 60
primitives. *Online* methods are the service's own: one body, without going back.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.body.model import BodyModel
from wayfarer.engines.engine import Engine
from wayfarer.models.bundle import Bodies
from wayfarer.spec import STEP_SECONDS
from wayfarer.world.agents.agent import AgentSpec
from wayfarer.world.agents.goal import Goal
from wayfarer.world.agents.slots import Mode, Motion
from wayfarer.world.goals.steering import Steering
from wayfarer.world.rows import Index
from wayfarer.world.search.beam import grow
from wayfarer.world.search.beam_settings import BeamSettings
from wayfarer.world.search.problem import BeamLevel, PlanningProblem, Tree
from wayfarer.world.stepping.mirror import has_mirror_image
from wayfarer.world.world import World
from wayfarer_lab.evaluation.figures import distances, first, mean, share
from wayfarer_lab.evaluation.gait import Row, Windows, gait_row, lean
from wayfarer_lab.evaluation.metrics.trunk import Trunk
from wayfarer_lab.evaluation.outcome import NEAR, REACHED, STEP_LIMIT, goal_outcome
from wayfarer_lab.evaluation.tasks import AgentTask, Plan, TimedCommand, random_specs, run_tasks
from wayfarer_lab.evaluation.tracks import BodyTrack, skin_track

Array = NDArray[np.floating[Any]]

AREA: Final = 10.0
"""Metres from the centre of the area to its sides (paper Sec. 3.3.1)."""

TOGETHER: Final = 20
"""Pairs whose trees grow together: bounds memory."""

JUDGED: Final = 4
"""Clones of a body whose gait is measured, chosen at random: skinning all takes minutes."""


@dataclass(frozen=True)
class Pair:
    """A body and its goal."""

    spec: AgentSpec
    goal: Goal


@dataclass(frozen=True)
class Trial:
    """Result of one pair: when its first clone reached the goal, or after 60 primitives."""

    steps: float  # primitives until then; NaN: not reached
    near: bool  # a clone came within 0.3 m in 60 primitives
    distances: Array  # [clones] metres, hips to goal; 0 if reached
    tracks: list[BodyTrack]  # of the measured clones


def random_pairs(count: int, speed: float, random: np.random.Generator) -> list[Pair]:
    """Genders alternate; shape, pose, facing and goal are random, goals uniform over the area."""
    return [Pair(spec, _random_goal(spec, speed, random)) for spec in random_specs(count, random)]


def told_the_goal_alone() -> Steering:
    """Steering for policies trained by PPO, which receive only a goal and a speed.

    The steering of the service also gives each agent its own noise.
    """
    usual = Steering()
    walking = replace(usual.searches[Mode.WALKING], own=0.0)
    return replace(usual, searches=dict.fromkeys(Mode, walking))


def offline(
    engine: Engine,
    world: World,
    bodies: Bodies,
    pairs: Sequence[Pair],
    settings: BeamSettings,
    random: np.random.Generator,
    lead: Callable[[Sequence[AgentSpec], Sequence[Motion]], None] | None = None,
    steering: Steering | None = None,
) -> Iterator[Trial]:
    """Trials by tree search; `settings.reach` must be the nearer of the two distances, 0.3 m.

    `lead` may move the standing bodies before their trees begin. `steering` None: the service's.
    """
    for begin in range(0, len(pairs), TOGETHER):
        some = pairs[begin : begin + TOGETHER]
        specs, goals = [p.spec for p in some], [[p.goal] for p in some]
        motions = world.prepare(specs)
        if lead is not None:
            lead(specs, motions)
        mirrors = has_mirror_image(bodies.values())
        problem = PlanningProblem.of(specs, motions, goals, mirrors=mirrors)
        trees = grow(engine, problem, settings, steering)
        owners = _owners(trees[0].levels)
        for row, (pair, tree) in enumerate(zip(some, trees, strict=True)):
            nodes = [np.flatnonzero(owner == row) for owner in owners[: tree.depth]]
            yield _tree_trial(tree, nodes, pair, bodies[pair.spec.gender], random)


def online(
    world: World, bodies: Bodies, pairs: Sequence[Pair], foot_lock: bool = False
) -> Iterator[Trial]:
    """Trials of single bodies in a world, as served; without the foot lock, as the model makes
    them, which is how trees are judged, too.
    """
    tasks = [
        AgentTask(replace(p.spec, foot_lock=foot_lock), (TimedCommand(0.0, _always([p.goal])),))
        for p in pairs
    ]
    # a goal takes effect a primitive after it is given
    seconds = (STEP_LIMIT + 2) * STEP_SECONDS
    for pair, trajectory in zip(pairs, run_tasks(world, tasks, seconds), strict=True):
        outcome = goal_outcome(trajectory)
        left = 0.0 if outcome.reached is not None else outcome.final_distance
        body = bodies[pair.spec.gender]
        track = trajectory.track(body, outcome.walking())
        yield Trial(outcome.steps, outcome.near, np.array([left]), [track])


def control_row(name: str, trials: Sequence[Trial], body: BodyModel) -> Row:
    """Table 1's figures and those of the gait; both genders have the same markers.

    A body stands in the centre of 20 × 20 m, its goal is anywhere in it. Rows `policy` and `N(0,
    I)` grow a tree of 32 clones per body offline (paper Sec. 3.3.2, 4.2); `top k` keeps the best k
    at every level. Rows `search K` are single agents as served. Trees grow on to 0.3 m for
    `success_03m`. Everything else is of the moment at which the first clone is within 0.75 m, and
    gait is of four clones chosen at random. Only the last row has the foot lock. `policy` is that
    of `--models`. `--policy-10`, `--policy-1` and `--g-cvae` name model folders for the paper's
    rows `policy(10)`, `policy(1)` (PPO with these KL weights) and `g-CVAE`. Those three receive the
    goal and the speed alone, all others what the service's steering sends: it turns a standing
    agent on the spot first.

    Figures:
        pairs: number of bodies and goals
        success: share in which a clone is within 0.75 m in 60 primitives
        success_03m: the same within 0.3 m
        steps: primitives until `success`
        avg_dist: mean distance of all clones at the end; 0 for clones that have arrived
        contact: `contact_paper`
        walk_*: the same in windows at 0.9-1.4 m/s
    """
    steps = [trial.steps for trial in trials]
    row: Row = {
        "name": name,
        "pairs": len(trials),
        "success": share([not np.isnan(s) for s in steps]),
        "success_03m": share([trial.near for trial in trials]),
        "steps": mean(steps),
        "avg_dist": float(np.mean([trial.distances.mean() for trial in trials])),
    }
    motion = Windows.join([track.windows() for trial in trials for track in trial.tracks])
    return row | gait_figures(motion, body)


def mocap_row(name: str, motion: Windows, body: BodyModel) -> Row:
    """Recorded locomotion, by the same code; it has no goals."""
    goal = dict.fromkeys(("success", "success_03m", "steps", "avg_dist"), float("nan"))
    return {"name": name, "pairs": 0, **goal, **gait_figures(motion, body)}


def gait_figures(motion: Windows, body: BodyModel) -> Row:
    """Gait of all windows, and under `walk_…` of those at walking speed."""
    trunk = Trunk.of(body)
    figures: Row = {}
    for prefix, part in (("", motion), ("walk_", motion.at_walking_speed())):
        row = lean(gait_row("", part, body.sole_markers), part, trunk)
        row["contact"] = row.pop("contact_paper", float("nan"))
        figures |= {prefix + key: value for key, value in row.items() if key != "name"}
    return figures


def _random_goal(spec: AgentSpec, speed: float, random: np.random.Generator) -> Goal:
    while True:
        way = random.uniform(-AREA, AREA, 2)
        if np.linalg.norm(way) > REACHED:  # else it is reached without a step
            x, y = (spec.position + way).tolist()
            return Goal((x, y, 0.0), speed=speed)


def _always(path: Sequence[Goal]) -> Plan:
    return lambda agent: path


def _owners(levels: Sequence[BeamLevel]) -> list[Index]:
    """Returns, by level, the pair that each of its nodes belongs to."""
    owners: list[Index] = []
    for level in levels:
        owners.append(owners[-1][level.parent] if owners else level.parent)
    return owners


def _tree_trial(
    tree: Tree,
    nodes: Sequence[Index],
    pair: Pair,
    body: BodyModel,
    random: np.random.Generator,
) -> Trial:
    """A trial from a tree grown to 0.3 m: it is cut where the first node is within 0.75 m.

    `nodes` are the tree's own rows of each level.
    """
    if not tree.depth:  # the first step had no valid node
        start = distances(np.array(pair.spec.position), pair.goal)
        return Trial(float("nan"), False, start[None], [])
    ways = [
        distances(level.translation[rows], pair.goal)
        for level, rows in zip(tree.levels, nodes, strict=False)
    ]
    reached = first(np.array([(way <= REACHED).any() for way in ways], bool))
    last = tree.depth - 1 if reached is None else reached
    left = np.where((ways[last] <= REACHED).any(-1), 0.0, ways[last][:, -1])
    chosen = random.permutation(nodes[last])[:JUDGED]
    return Trial(
        steps=float("nan") if reached is None else reached + 1.0,
        near=any((way <= NEAR).any() for way in ways),
        distances=left,
        tracks=[_track(tree.levels[: last + 1], int(row), pair.spec, body) for row in chosen],
    )


def _track(levels: Sequence[BeamLevel], row: int, spec: AgentSpec, body: BodyModel) -> BodyTrack:
    """Skinned path to row `row` of the last of `levels`."""
    hips, rotations = [], []
    for level in reversed(levels):
        hips.append(level.translation[row])
        rotations.append(level.rotations[row])
        row = int(level.parent[row])
    joined = (np.concatenate(part[::-1]) for part in (hips, rotations))
    return skin_track(body, np.array(spec.betas), *joined)
