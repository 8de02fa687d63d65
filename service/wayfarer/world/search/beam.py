"""Offline tree search over primitives: of N children per node, the K best of every level are kept
(paper Sec. 3.3.2), for many agents at once.

The scheduler's online search chooses among candidates within one step and never revises a choice. A
beam does: a primitive that looked best may lead nowhere, and a second best is still available. Each
child is a separate row in the engine's batch, with one candidate; each node has its own steering
(mode, targets, weights) and gait. With `keep=1` a plan equals the online search's result for the
same seed with K = `children`.

It is reproducible: a node's noise is drawn by its agent's seed, its level and its rank, so an
agent's plan does not depend on others in the search.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.engines.engine import Engine, Float, StepInputs, StepOutputs
from wayfarer.engines.padding import pick
from wayfarer.spec import GENDERS, SEED_FRAMES
from wayfarer.terms import TERMS
from wayfarer.world.agents.goal import GoalColumns
from wayfarer.world.agents.slots import Gait, Mode, Motion, Seeds
from wayfarer.world.goals.steering import Steering, observe
from wayfarer.world.rows import Double, Flags, Index, Int, Rows
from wayfarer.world.search.beam_settings import BeamSettings
from wayfarer.world.search.problem import (
    BeamLevel,
    Ending,
    MotionPlan,
    PlanningProblem,
    PlanningStart,
    Tree,
)
from wayfarer.world.stepping.batch import assemble
from wayfarer.world.stepping.mirror import mirror_inputs, mirror_outputs
from wayfarer.world.stepping.new_frames import broken
from wayfarer.world.stepping.noise import latents

Watch = Callable[[int, int], None]
"""Called before each level with the number of completed levels and of agents in progress."""

BLOCK: Final = 64
"""Maximum rows of one engine call: larger ones are no faster on a CPU and take more memory."""


def plan(
    engine: Engine,
    problem: PlanningProblem,
    settings: BeamSettings | None = None,
    steering: Steering | None = None,
    watch: Watch = lambda level, agents: None,
) -> list[MotionPlan]:
    """Finds the best path for each agent of the problem."""
    return [tree.plan() for tree in grow(engine, problem, settings, steering, watch)]


def grow(
    engine: Engine,
    problem: PlanningProblem,
    settings: BeamSettings | None = None,
    steering: Steering | None = None,
    watch: Watch = lambda level, agents: None,
) -> list[Tree]:
    """Grows a tree for each agent of the problem, with all leaves that were kept.

    A tree ends as soon as one of its kept nodes is at its goal; such leaves come first.
    """
    search = _Search(engine, problem, settings or BeamSettings(), steering or Steering())
    return search.run(watch)


@dataclass(slots=True)
class Nodes(Rows):
    """The deepest nodes of all trees: agent after agent, best first."""

    agent: Int  # row of `PlanningProblem.starts`
    row: Int  # row of the last `BeamLevel`
    rank: Int  # within its agent; 0 is the best
    cost: Double  # of the path, as far as it is remembered
    done: Flags  # at its goal
    motion: Motion

    def where(self, chosen: Flags) -> "Nodes":
        """The chosen rows."""
        return self.take(np.flatnonzero(chosen))


class _Search:
    """The trees while they grow."""

    def __init__(
        self, engine: Engine, problem: PlanningProblem, settings: BeamSettings, steering: Steering
    ) -> None:
        self._engine = engine
        self._problem = problem
        self._settings = settings
        self._steering = settings.steer(steering)
        self._levels: list[BeamLevel] = []
        self._trees: dict[int, Tree] = {}

    def run(self, watch: Watch) -> list[Tree]:
        nodes = self._close_done(self._roots())
        while len(nodes.agent) and len(self._levels) < self._settings.depth:
            watch(len(self._levels), len(np.unique(nodes.agent)))
            level, following = self._grow(nodes)
            self._close(nodes.where(~np.isin(nodes.agent, following.agent)), Ending.BROKEN)
            self._levels.append(level)
            nodes = self._close_done(following)
        self._close(nodes, Ending.DEPTH)
        return [self._trees[agent] for agent in range(len(self._problem.starts.gender))]

    def _roots(self) -> Nodes:
        motion = self._problem.starts.motion
        agent = np.arange(len(self._problem.starts.gender))
        hips, goals = motion.seed.translation[:, -1:], self._problem.goals_of(agent, motion.gait)
        return Nodes(
            agent=agent,
            row=agent,
            rank=np.zeros_like(agent),
            cost=np.zeros(len(agent)),
            done=self._done(motion.gait, hips, goals),
            motion=motion,
        )

    def _grow(self, nodes: Nodes) -> tuple[BeamLevel, Nodes]:
        """Tries children of all nodes and keeps the best of each agent."""
        starts = self._problem.starts.take(nodes.agent)
        seed, gait, goals = self._steer(nodes)
        noise = self._noise(starts, nodes)
        asked = assemble(seed, starts.betas, gait, goals, noise, starts.style, self._steering)
        count = noise.shape[1]
        rows = fan_out(mirror_inputs(asked, starts.mirrored))
        outputs = _step(self._engine, np.repeat(starts.gender, count), rows)
        parent = np.repeat(np.arange(len(nodes.agent)), count)
        start = seed.translation[:, -1]
        outputs = mirror_outputs(outputs, starts.mirrored[parent])
        felt = np.maximum(outputs.terms - _row(self._settings.tolerances, 0.0), 0.0)
        own = (felt * self._weights(nodes, asked)[parent]).sum(-1).astype(np.float64)
        own[broken(start[parent], outputs) | ~np.isfinite(own)] = np.inf
        cost = self._settings.memory * nodes.cost[parent] + own
        within = outputs.terms <= _row(self._settings.limits, np.inf)
        rejected = np.logical_not(within.all(-1))
        kept, rank = select(nodes.agent[parent], cost, rejected, self._settings.keep)

        mother = parent[kept]
        frames, rotations = outputs.translation[kept], outputs.rotations[kept]
        goals = goals.take(mother)
        after = observe(gait.take(mother), start[mother], frames, goals)
        level = BeamLevel(
            parent=nodes.row[mother],
            mode=after.mode,
            cost=own[kept].astype(np.float32),
            rejected=rejected[kept],
            translation=frames,
            rotations=rotations,
            contacts=outputs.contacts[kept] > 0.5,
        )
        end = Seeds(
            markers=outputs.next_seed_markers[kept],
            translation=frames[:, -SEED_FRAMES:],
            rotations=rotations[:, -SEED_FRAMES:],
        )
        following = Nodes(
            agent=nodes.agent[mother],
            row=np.arange(len(kept)),
            rank=rank,
            cost=cost[kept],
            done=self._done(after, frames, goals),
            motion=replace(nodes.motion.take(mother), seed=end, gait=after),
        )
        return level, following

    def _steer(self, nodes: Nodes) -> tuple[Seeds, Gait, GoalColumns]:
        """Seed, gait and goal of each node's next step, as in the scheduler."""
        seed, gait = nodes.motion.seed, nodes.motion.gait
        gait = self._steering.advance(gait, self._problem.goals_of(nodes.agent, gait))
        goals = self._problem.goals_of(nodes.agent, gait)
        return seed, self._steering.decide(gait, seed, goals), goals

    def _noise(self, starts: PlanningStart, nodes: Nodes) -> Float:
        """Standard normal [N, C, 128]: the node of rank r has the r-th C draws of its agent."""
        level = len(self._levels)
        count = self._settings.children if level else self._settings.first
        leads = nodes.rank == 0
        ranks = int(nodes.rank.max()) + 1
        drawn = latents(starts.noise_seed[leads], starts.chunk[leads] + level, ranks * count)
        return drawn.reshape(len(drawn), ranks, count, -1)[np.cumsum(leads) - 1, nodes.rank]

    def _weights(self, nodes: Nodes, asked: StepInputs) -> Float:
        """Weights [N, T] of the ranking.

        All nodes of an agent use the table of its best node: costs of different tables are not
        comparable, and a walk would always look better than the stop in which it must end.
        """
        if self._settings.weights is not None:
            return np.broadcast_to(_row(self._settings.weights, 0.0), asked.term_weights.shape)
        return asked.term_weights[np.searchsorted(nodes.agent, nodes.agent)]

    def _done(self, gait: Gait, frames: Float, goals: GoalColumns) -> Flags:
        """Whether nodes are at their last goal; frames [N, F, 3] are the last primitive's hips."""
        last = goals.given & ~goals.more
        if self._settings.until == "depth":
            return np.zeros_like(last)
        if self._settings.until == "standing":
            return last & gait.arrived & (gait.mode == Mode.STANDING)
        way = np.linalg.norm(frames[..., :2] - goals.position[:, None, :2], axis=-1)
        return last & (way <= self._settings.reach).any(-1)

    def _close_done(self, nodes: Nodes) -> Nodes:
        """Ends the trees that have a finished node; returns the nodes of the others."""
        ends = np.isin(nodes.agent, nodes.agent[nodes.done])
        self._close(nodes.where(ends), Ending(self._settings.until))
        return nodes.where(~ends)

    def _close(self, nodes: Nodes, ending: Ending) -> None:
        for agent in np.unique(nodes.agent):
            leaves = nodes.where(nodes.agent == agent)
            leaves = leaves.take(np.argsort(~leaves.done, kind="stable"))
            hips = leaves.motion.seed.translation[:, -1]
            self._trees[int(agent)] = Tree(
                levels=self._levels,
                depth=len(self._levels),
                ending=ending,
                leaves=leaves.row,
                ends=leaves.motion,
                distances=self._problem.distance(leaves.agent, hips),
                first_chunk=int(self._problem.starts.chunk[agent]),
            )


def select(
    agent: Index, cost: NDArray[np.float64], rejected: Flags, keep: int
) -> tuple[Index, Index]:
    """Rows to keep, agent after agent and cheapest first, and their ranks.

    At most `keep` of each agent that are not rejected, or only the cheapest if all are rejected.
    Rows of infinite cost are never kept. Ties go to the first row.
    """
    lost = np.isinf(cost)
    order = np.lexsort([cost, rejected, lost, agent])
    rank = np.arange(len(order)) - np.searchsorted(agent[order], agent[order])
    good = ~lost[order] & (rank < keep) & (~rejected[order] | (rank == 0))
    return order[good], rank[good]


def fan_out(inputs: StepInputs) -> StepInputs:
    """Rows with K candidates [A, K, 128] as A·K rows with one candidate each [A·K, 1, 128]."""
    rows, count, size = inputs.noise.shape
    one = replace(inputs, noise=inputs.noise[:, :1])
    many = pick(one, np.repeat(np.arange(rows), count))
    return replace(many, noise=inputs.noise.reshape(rows * count, 1, size))


def _step(engine: Engine, gender: NDArray[np.int8], inputs: StepInputs) -> StepOutputs:
    """Steps all rows, gender by gender and in blocks; outputs are in the order of the inputs."""
    order, done = [], []
    for number, name in enumerate(GENDERS):
        rows = np.flatnonzero(gender == number)
        for first in range(0, len(rows), BLOCK):
            block = rows[first : first + BLOCK]
            done.append(engine.scoring.step(name, pick(inputs, block)))
            order.append(block)
    back = np.argsort(np.concatenate(order))
    return StepOutputs(
        **{
            column.name: np.concatenate([getattr(outputs, column.name) for outputs in done])[back]
            for column in fields(StepOutputs)
        }
    )


def _row(table: Mapping[str, float], missing: float) -> Float:
    return np.array([table.get(name, missing) for name in TERMS], np.float32)
