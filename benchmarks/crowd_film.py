"""Films of a crowd among its walls, before a fixed camera."""

from dataclasses import replace
from math import radians
from pathlib import Path

from PIL import Image

from benchmarks.crowd_cases import Case
from wayfarer.clips.clip import join_chunks
from wayfarer.models.bundle import Bodies
from wayfarer.navigation.scene_spec import Box
from wayfarer.navigation.solids import solid_triangles
from wayfarer.spec import FPS
from wayfarer.world.agents.agent import AgentSpec, MotionChunk
from wayfarer_lab.evaluation.pictures.camera import Camera, View
from wayfarer_lab.evaluation.pictures.files import GIF_FPS, write_film
from wayfarer_lab.evaluation.pictures.film import Film
from wayfarer_lab.evaluation.pictures.scene import ClipActor, Prop, picture

SIZE, COLOURS = (320, 200), 64
AZIMUTH, ELEVATION, ANGLE, DISTANCE = radians(-35), radians(38), radians(30), 15.0
START, SECONDS = 6.0, 6.0
"""When a film begins, and how long it is."""

FEW = 40
"""People up to whom a film has all pictures of a GIF; of more it has half, to stay small."""

LOW = 0.9
"""Metres: walls are drawn no higher, so that people are seen behind them."""

MARGIN = 40
"""Pixels outside the picture within which the middle of a body is drawn."""


class Filming:
    """Keeps what is sent in a window of time, and draws it."""

    def __init__(self, case: Case, specs: list[AgentSpec], bodies: Bodies) -> None:
        self._case, self._specs, self._bodies = case, specs, bodies
        self._chunks: list[list[MotionChunk]] = [[] for _ in specs]

    def see(self, who: int, chunk: MotionChunk) -> None:
        """A chunk of person number `who`."""
        if START - 1 < chunk.scheduled_at < START + SECONDS:
            self._chunks[who].append(chunk)

    def write(self, path: Path) -> None:
        """Draws the film into a GIF."""
        actors = [
            (self._actor(number), round((START - chunks[0].scheduled_at) * FPS))
            for number, chunks in enumerate(self._chunks)
        ]
        view = View.wide(AZIMUTH, ELEVATION, DISTANCE, ANGLE, SIZE)
        camera, solids = Camera(view, (0.0, 0.0, 0.5)), self._solids()

        rate = GIF_FPS if len(actors) <= FEW else GIF_FPS / 2

        def draw(number: int) -> Image.Image:
            poses = []
            for actor, first in actors:
                frame = first + round(number * FPS / rate)
                x, y, _ = camera.project(actor.hips[frame])
                if -MARGIN < x < SIZE[0] + MARGIN and -MARGIN < y < SIZE[1] + MARGIN:
                    poses.append((actor, frame))
            return picture(camera, poses, (), solids)

        film = Film(round(SECONDS * rate), rate, SIZE, draw)
        write_film(path, film, lambda done, total: None, COLOURS)

    def _solids(self) -> list[Prop]:
        solids = self._case.spec.solids if self._case.spec else ()
        low = [replace(solid, height=LOW) for solid in solids if isinstance(solid, Box)]
        return [Prop(solid_triangles(solid), "#b9bec6") for solid in low]

    def _actor(self, number: int) -> ClipActor:
        spec = self._specs[number]
        clip = join_chunks(self._chunks[number], spec)
        return ClipActor.of(clip, self._bodies[spec.gender], "dressed", number)
