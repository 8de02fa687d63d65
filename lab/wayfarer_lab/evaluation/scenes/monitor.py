"""Measures the motion sent from a scene: every body against walls, ground and other bodies."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.clips.clip import join_chunks
from wayfarer.models.bundle import Bodies
from wayfarer.navigation.scene import Scene
from wayfarer.spec import FPS
from wayfarer.world.agents.agent import AgentSpec, MotionChunk
from wayfarer_lab.evaluation.gait import Row
from wayfarer_lab.evaluation.pictures.scene import ClipActor
from wayfarer_lab.evaluation.scenes.bodies import Form, PosedBodies, pose
from wayfarer_lab.evaluation.scenes.measures import Depths, Gaps, ProgressWatch
from wayfarer_lab.evaluation.scenes.overlap import overlaps
from wayfarer_lab.evaluation.scenes.solids import (
    SceneSolid,
    ground_height,
    signed_distance,
    standing,
)

Array = NDArray[np.floating[Any]]
Index = NDArray[np.int64]

BLOCK: Final = 5 * FPS
"""Frames measured together: bounds memory."""

NEAR: Final = 1.0
"""Metres from the hips within which all of a walking body is, in plan."""

UNDER_SKIN: Final = 0.3
"""Metres from any part of the skin to the nearest joint, at most: the crown of a head."""


STILL: Final = 8.0
"""Seconds after which the pose of every agent is kept for the picture."""

AROUND: Final = 0.25 * np.array([[1.0, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]])
UNEVEN: Final = 0.02
"""Metres by which the ground around a foot differs from here on where it is not level."""


@dataclass(frozen=True)
class MonitorFrames:
    """R frames of agents, by their number."""

    agent: Index  # [R]
    frame: Index  # [R] of the world
    translation: Array  # [R, 3]
    rotations: Array  # [R, 22, 4]
    contacts: NDArray[np.bool_]  # [R, 2]

    def __getitem__(self, rows: NDArray[Any]) -> "MonitorFrames":
        return MonitorFrames(
            self.agent[rows],
            self.frame[rows],
            self.translation[rows],
            self.rotations[rows],
            self.contacts[rows],
        )

    @classmethod
    def join(cls, parts: Sequence["MonitorFrames"]) -> "MonitorFrames":
        """One after the other."""
        return cls(
            np.concatenate([part.agent for part in parts]),
            np.concatenate([part.frame for part in parts]),
            np.concatenate([part.translation for part in parts]),
            np.concatenate([part.rotations for part in parts]),
            np.concatenate([part.contacts for part in parts]),
        )


class SceneMonitor:
    """Measures every `every`-th frame of all added agents, in the scene as it is then."""

    def __init__(
        self, bodies: Bodies, scene: Scene, every: int = 4, strangers: bool = True
    ) -> None:
        """`strangers`: bodies can touch each other; False where they do not share one world."""
        self.walls, self.people = Depths(), Depths()
        self.gaps, self.uneven = Gaps("foot_gap"), Gaps("foot_gap_uneven")
        self.ids: list[str] = []
        self.progress: list[ProgressWatch] = []
        self._bodies, self._every, self._strangers = bodies, every, strangers
        self._forms: list[Form] = []
        self._specs: list[AgentSpec] = []
        self._ways: list[list[Array]] = []
        self._still: list[MotionChunk | None] = []
        self._number: dict[str, int] = {}
        self._scene, self._solids = scene, standing(scene)
        self._waiting: list[MonitorFrames] = []
        self._until = BLOCK

    def meet(self, agent_id: str, spec: AgentSpec) -> None:
        """Adds an agent."""
        self._number[agent_id] = len(self.ids)
        self.ids.append(agent_id)
        self._forms.append(Form.of(self._bodies[spec.gender], spec))
        self.progress.append(ProgressWatch())
        self._specs.append(spec)
        self._ways.append([])
        self._still.append(None)

    def __contains__(self, agent_id: str) -> bool:
        """Whether the agent has been added."""
        return agent_id in self._number

    def see(self, chunk: MotionChunk) -> None:
        """A chunk as it is sent; in order of time."""
        number = self._number[chunk.agent_id]
        start = round(chunk.scheduled_at * FPS)
        if start >= self._until:
            self._judge(start)
            self._until = start + BLOCK
        self.progress[number].see(chunk)
        self._ways[number].append(chunk.translation[-1].copy())
        if chunk.scheduled_at <= STILL:
            self._still[number] = chunk
        frame = start + np.arange(len(chunk.translation))
        chosen = frame % self._every == 0
        self._waiting.append(
            MonitorFrames(
                np.full(int(chosen.sum()), number),
                frame[chosen],
                chunk.translation[chosen],
                chunk.rotations[chosen],
                chunk.contacts[chosen],
            )
        )

    def change(self, scene: Scene) -> None:
        """Uses another version of the scene from now on."""
        self.finish()
        self._scene, self._solids, self._until = scene, standing(scene), 0

    def finish(self) -> None:
        """Measures all frames so far."""
        self._judge(None)

    def figures(self) -> Row:
        """Figures of all measured frames."""
        walls, people = self.walls, self.people
        row: Row = {
            "agents": len(self.ids),
            "agent_frames": walls.frames,
            "penetration_frames": walls.share(walls.touching),
            "penetration_5cm": walls.share(walls.deep),
            "penetration_mean_cm": 100 * walls.mean,
            "penetration_max_cm": 100 * walls.deepest,
        }
        if self._strangers:
            row["overlap_frames"] = people.share(people.deep)
            row["overlap_max_cm"] = 100 * people.deepest
        row["stuck_agents"] = sum(p.stuck_at is not None for p in self.progress)
        row["stuck_seconds"] = sum(p.stuck_seconds for p in self.progress)
        return row | self.gaps.figures() | self.uneven.figures()

    def worst(self) -> list[dict[str, float | int | str]]:
        """The moments to look at first."""
        kinds = (("in a solid", self.walls), ("in somebody", self.people))
        found: list[dict[str, float | int | str]] = [
            {"what": kind, "agent": who, "at_s": frame / FPS, "cm": round(100 * depth, 1)}
            for kind, depths in kinds
            for depth, who, frame in depths.worst
        ]
        return found + [
            {"what": "stuck", "agent": who, "at_s": p.stuck_at, "s": round(p.stuck_seconds, 1)}
            for who, p in enumerate(self.progress)
            if p.stuck_at is not None
        ]

    def actors(self) -> list[tuple[ClipActor, int]]:
        """Every agent's pose after `STILL` seconds, for the picture."""
        return [
            (ClipActor.of(join_chunks([chunk], spec), body, "dressed", number), 0)
            for number, (chunk, spec) in enumerate(zip(self._still, self._specs, strict=True))
            if chunk is not None
            for body in (self._bodies[spec.gender],)
        ]

    def trails(self) -> list[Array]:
        """Every agent's `trail`."""
        return [self.trail(number) for number in range(len(self.ids))]

    def trail(self, number: int) -> Array:
        """Hips of an agent at the end of each chunk. [N, 3]"""
        return np.array(self._ways[number]).reshape(-1, 3)

    # Within

    def _judge(self, until: int | None) -> None:
        """All frames before `until`, of which none is missing any more."""
        if not self._waiting:
            return
        every = MonitorFrames.join(self._waiting)
        ready = every.frame < until if until is not None else np.ones(len(every.frame), bool)
        self._waiting = [every[~ready]]
        known = every[ready]
        bodies: list[tuple[MonitorFrames, PosedBodies]] = []
        genders = np.array([form.body.gender for form in self._forms])[known.agent]
        for gender in np.unique(genders):
            part = known[genders == gender]
            posed = pose(self._forms, part.agent, part.translation, part.rotations)
            bodies.append((part, posed))
            self.walls.add(self._in_walls(part, posed), part.agent, part.frame)
            self._feet(part, posed)
        if self._strangers and bodies:
            self._in_people(bodies)

    def _in_walls(self, part: MonitorFrames, posed: PosedBodies) -> Array:
        """How deep the skin of each body is in any solid. [R]"""
        depth = np.zeros(len(part.agent))
        if not self._solids:
            return depth
        near = np.stack([_near(solid, posed.places) for solid in self._solids])  # [S, R]
        touching = np.flatnonzero(near.any(0))
        for who in np.unique(part.agent[touching]):
            rows = touching[part.agent[touching] == who]
            form = self._forms[who]
            skin = form.skin(posed.turns[rows], posed.places[rows])
            for solid, close in zip(self._solids, near[:, rows], strict=True):
                if close.any():
                    part_of = skin[close][:, ~form.feet] if solid.walked_on else skin[close]
                    inside = -signed_distance(solid.solid, part_of).min(1)
                    depth[rows[close]] = np.maximum(depth[rows[close]], inside)
        return depth

    def _feet(self, part: MonitorFrames, posed: PosedBodies) -> None:
        """Gaps under all feet with a contact flag."""
        touching = np.flatnonzero(part.contacts.any(1))
        for who in np.unique(part.agent[touching]):
            rows = touching[part.agent[touching] == who]
            soles = self._forms[who].soles(posed.turns[rows], posed.places[rows])
            soles = soles[part.contacts[rows]]  # [N, 4, 3]
            gap = (soles[..., 2] - self._ground(soles)).min(-1)
            around = self._ground(soles.mean(1)[:, None] + AROUND)
            self.gaps.add(gap[np.isfinite(gap)])
            known = np.isfinite(gap) & np.isfinite(around).all(-1)
            self.uneven.add(gap[known][np.ptp(around[known], axis=-1) > UNEVEN])

    def _ground(self, points: Array) -> Array:
        return ground_height(self._scene, self._solids, points)

    def _in_people(self, bodies: Sequence[tuple[MonitorFrames, PosedBodies]]) -> None:
        agent, frame = (np.concatenate([getattr(f, k) for f, _ in bodies]) for k in _WHO)
        hips = np.concatenate([posed.places[:, 0] for _, posed in bodies])
        start, end, radii = (
            np.concatenate([getattr(posed, k) for _, posed in bodies]) for k in _CAPSULES
        )
        one, other, deep = overlaps(frame, hips, start, end, radii)
        depth = np.zeros(len(agent))
        np.maximum.at(depth, one, deep)
        np.maximum.at(depth, other, deep)
        self.people.add(depth, agent, frame)


_WHO: Final = ("agent", "frame")
_CAPSULES: Final = ("start", "end", "radii")


def _near(standing: SceneSolid, places: Array) -> NDArray[np.bool_]:
    """Bodies, by their joints [R, J, 3], that may touch it. [R]"""
    x, y, radius = standing.disc
    near = np.hypot(places[:, 0, 0] - x, places[:, 0, 1] - y) < radius + NEAR
    rows = np.flatnonzero(near)
    near[rows] = signed_distance(standing.solid, places[rows]).min(1) < UNDER_SKIN
    return near
