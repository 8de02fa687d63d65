"""The problem of an offline search and its result: a tree of primitives, and its paths.

A tree shares its levels with the other trees of the same search. Nodes point back to their parent
and hold only their own new frames; a path is assembled on request.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Annotated, Self

import numpy as np

from wayfarer.config.limits import Limits
from wayfarer.errors import InvalidArgument
from wayfarer.spec import BETAS, GENDERS, NEW_FRAMES, POSED_JOINTS
from wayfarer.world.agents.agent import AgentSpec
from wayfarer.world.agents.goal import Goal, GoalColumns, check_path, goal_columns
from wayfarer.world.agents.slots import Gait, Mode, Motion
from wayfarer.world.agents.style import Style, style_of
from wayfarer.world.rows import Flags, Float, Index, Int, Int8, Rows, Shape, UInt64
from wayfarer.world.stepping.mirror import is_mirrored


@dataclass(slots=True)
class PlanningStart(Rows):
    """Agents before the first primitive."""

    gender: Int8  # index into spec.GENDERS
    noise_seed: UInt64
    style: Style  # drawn from that
    mirrored: Flags  # moved as its mirror image; see stepping/mirror.py
    chunk: Int  # number of the first primitive; noise is drawn by it
    betas: Annotated[Float, Shape(BETAS)]
    path: Int  # row of the first of its goals
    motion: Motion


@dataclass(frozen=True)
class PlanningProblem:
    """Agents, each with the goals that it should visit in turn."""

    starts: PlanningStart
    goals: GoalColumns  # of all agents, agent after agent; one without goals has a row of zeros

    @classmethod
    def of(
        cls,
        specs: Sequence[AgentSpec],
        motions: Sequence[Motion],
        paths: Sequence[Sequence[Goal]],
        first_chunk: int = 0,
        mirrors: bool = True,
    ) -> Self:
        """`motions` as from `World.prepare` or `MotionPlan.end`; an agent with an empty path
        stands.

        `first_chunk` continues the agents' noise where an earlier plan ended
        (`MotionPlan.next_chunk`). `mirrors`: whether the bodies have a mirror image
        (`has_mirror_image`). Raises InvalidArgument for bad goals and lists of unequal length.
        """
        if not specs or not len(specs) == len(motions) == len(paths):
            raise InvalidArgument(
                f"{len(specs)} specs, {len(motions)} motions, {len(paths)} paths; "
                "there must be one of each for every agent, and at least one agent",
                "specs",
            )
        starts = PlanningStart.empty(len(specs))
        starts.chunk[:] = first_chunk
        goals: list[GoalColumns] = []
        for row, (spec, motion, path) in enumerate(zip(specs, motions, paths, strict=True)):
            x, y, z = motion.seed.translation[0, -1].tolist()
            starts.gender[row] = GENDERS.index(spec.gender)
            starts.noise_seed[row] = spec.noise_seed
            starts.mirrored[row] = mirrors and is_mirrored(starts.noise_seed[row : row + 1])[0]
            starts.betas[row] = spec.betas
            starts.path[row] = sum(len(columns.given) for columns in goals)
            starts.motion.put(np.array([row]), motion)
            if path:
                check_path(path, (x, y, z), Limits())
                starts.motion.gait.mode[row] = Mode.WALKING
            goals.append(goal_columns(path, (x, y)) if path else GoalColumns.empty(1))
        starts.style = style_of(starts.noise_seed)
        starts.motion.gait.arrived[:] = False
        starts.motion.gait.waypoint[:] = 0
        return cls(starts, GoalColumns.join(goals))

    def goals_of(self, agent: Index, gait: Gait) -> GoalColumns:
        """The present goals of some agents, by the waypoints of `gait`."""
        return self.goals.take(self.starts.path[agent] + gait.waypoint)

    def distance(self, agent: Index, hips: Float) -> Float:
        """Metres, horizontal, from hips [N, 3] to agents' last goals [N]; NaN without a goal."""
        last = np.append(self.starts.path[1:], len(self.goals.given)) - 1
        goals = self.goals.take(last[agent])
        way = np.linalg.norm(hips[:, :2] - goals.position[:, :2], axis=-1)
        return np.where(goals.given, way, np.nan).astype(np.float32)


class Ending(StrEnum):
    """The reason why a tree grew no further."""

    REACHED = "reached"  # a node came within reach of the last goal
    STANDING = "standing"  # a node has arrived there and stands
    DEPTH = "depth"  # the maximum number of primitives
    BROKEN = "broken"  # no primitive after these nodes could be shown


@dataclass(slots=True)
class BeamLevel(Rows):
    """Kept nodes of one depth, of all agents: each has a primitive's new frames."""

    parent: Int  # row in the level before; in the first, of the problem
    mode: Int8  # Mode
    cost: Float  # of this primitive alone
    rejected: Flags  # over a hard limit; kept because all of its agent's nodes were
    translation: Annotated[Float, Shape(NEW_FRAMES, 3)]
    rotations: Annotated[Float, Shape(NEW_FRAMES, POSED_JOINTS, 4)]
    contacts: Annotated[Flags, Shape(NEW_FRAMES, 2)]


@dataclass(frozen=True)
class MotionPlan:
    """One path from the root: L primitives, N = 8 L frames; world, like `engine.StepOutputs`."""

    translation: Float = field(repr=False)  # [N, 3] hips joint
    rotations: Float = field(repr=False)  # [N, 22, 4]
    contacts: Flags = field(repr=False)  # [N, 2] left, right
    modes: Int8 = field(repr=False)  # [L] Mode
    costs: Float = field(repr=False)  # [L] of each primitive
    rejected: Flags = field(repr=False)  # [L] over a hard limit: all that were tried were
    ending: Ending
    distance: float  # metres, hips to the last goal at the end, horizontal; NaN without a goal
    end: Motion = field(repr=False)  # one row, from which another plan can continue
    next_chunk: int  # number of the primitive after the last

    @property
    def steps(self) -> int:
        """Number of primitives L."""
        return len(self.modes)


@dataclass(frozen=True)
class Tree:
    """The kept nodes of one agent's tree."""

    levels: Sequence[BeamLevel] = field(
        repr=False
    )  # shared; deeper than `depth` where others continued
    depth: int
    ending: Ending
    leaves: Index = field(repr=False)  # rows in level `depth - 1`; best first
    ends: Motion = field(repr=False)  # of the leaves
    distances: Float  # [leaves] as `MotionPlan.distance`
    first_chunk: int

    def plan(self, leaf: int = 0) -> MotionPlan:
        """The path to a leaf; 0 is the best."""
        row, path = int(self.leaves[leaf]), []
        for level in reversed(self.levels[: self.depth]):
            path.append(level.take(np.array([row])))
            row = int(level.parent[row])
        nodes = BeamLevel.join([BeamLevel.empty(0), *path[::-1]])
        return MotionPlan(
            translation=nodes.translation.reshape(-1, 3),
            rotations=nodes.rotations.reshape(-1, POSED_JOINTS, 4),
            contacts=nodes.contacts.reshape(-1, 2),
            modes=nodes.mode,
            costs=nodes.cost,
            rejected=nodes.rejected,
            ending=self.ending,
            distance=float(self.distances[leaf]),
            end=self.ends.take(np.array([leaf])),
            next_chunk=self.first_chunk + self.depth,
        )
