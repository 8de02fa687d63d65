"""How deep the bodies of a crowd are in walls and in each other."""

import numpy as np
import shapely

from benchmarks.bench import Row
from benchmarks.crowd_cases import Case
from wayfarer.models.bundle import Bodies
from wayfarer.spec import FPS
from wayfarer.world.agents.agent import AgentSpec, MotionChunk
from wayfarer_lab.evaluation.scenes.bodies import Form, pose
from wayfarer_lab.evaluation.scenes.overlap import overlaps

EVERY = 4
"""Frames from one measured pose to the next."""

TURNS = np.linspace(0, 2 * np.pi, 32, endpoint=False)
OUTWARD = np.stack([np.cos(TURNS), np.sin(TURNS)])
"""Directions in which the outermost point of a skin is compared with the walls."""


class Skin:
    """Measures the poses of a case's people as they are sent."""

    def __init__(self, case: Case, specs: list[AgentSpec], bodies: Bodies) -> None:
        self._ground = case.ground
        self._forms = [Form.of(bodies[spec.gender], spec) for spec in specs]
        self._frames: list[np.ndarray] = []
        self._hips: list[np.ndarray] = []
        self._capsules: list[tuple[np.ndarray, ...]] = []
        self._wall = 0.0

    def see(self, who: int, chunk: MotionChunk) -> None:
        """A chunk of person number `who`."""
        frame = round(chunk.scheduled_at * FPS) + np.arange(len(chunk.translation))
        chosen = frame % EVERY == 0
        form, count = self._forms[who], int(chosen.sum())
        row = np.zeros(count, np.int64)
        posed = pose([form], row, chunk.translation[chosen], chunk.rotations[chosen])
        skin = form.skin(posed.turns, posed.places)[..., :2]  # [R, V, 2]
        outermost = np.take_along_axis(skin, (skin @ OUTWARD).argmax(1)[..., None], 1)
        outside = shapely.distance(self._ground, shapely.points(outermost))
        self._wall = max(self._wall, float(outside.max(initial=0)))
        self._frames.append(frame[chosen])
        self._hips.append(posed.places[:, 0])
        self._capsules.append((posed.start, posed.end, posed.radii))

    def figures(self) -> Row:
        """Centimetres by which the skin was in a wall, and a limb or trunk in another body."""
        start, end, radii = (np.concatenate(each) for each in zip(*self._capsules, strict=True))
        frames, hips = np.concatenate(self._frames), np.concatenate(self._hips)
        _, _, deep = overlaps(frames, hips, start, end, radii)
        return {"wall_cm": 100 * self._wall, "body_cm": 100 * float(deep.max(initial=0))}
