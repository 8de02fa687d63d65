"""Several people who walk about in a scene, as a clip each."""

from collections.abc import Callable
from pathlib import Path
from typing import Final

import numpy as np

from wayfarer.clips.clip import join_chunks
from wayfarer.clips.files import Performance
from wayfarer.errors import InvalidArgument
from wayfarer.navigation.examples import EXAMPLES, rectangle
from wayfarer.navigation.scene_spec import Floor, MeshFile, MeshFormat, SceneSpec
from wayfarer.spec import FPS
from wayfarer.world.agents.agent import AgentSpec, MotionChunk, SessionSpec
from wayfarer.world.scenes.messages import Crowd
from wayfarer.world.world import World

LEVELS: Final[dict[str, MeshFormat]] = {".glb": "glb", ".obj": "obj", ".ply": "ply"}
TICK: Final = 0.1
"""Seconds between two looks at the crowd."""
BEFORE: Final = 1.0
"""Seconds within which the first person has come."""
FIELD: Final = SceneSpec((Floor(rectangle(-10.0, -10.0, 10.0, 10.0)),))


def scene_of(name: str) -> SceneSpec:
    """The scene of that name: an example, a level's file, or "" for an empty field of 20 x 20 m.

    Raises InvalidArgument.
    """
    if not name:
        return FIELD
    if name in EXAMPLES:
        return EXAMPLES[name]()
    path = Path(name)
    if path.suffix.lower() in LEVELS and path.is_file():
        return SceneSpec(mesh=MeshFile(path.read_bytes(), LEVELS[path.suffix.lower()]))
    raise InvalidArgument(
        f"there is no scene {name}: give {', '.join(EXAMPLES)}, or a file ({', '.join(LEVELS)})",
        "scene",
    )


def crowd_clips(
    world: World,
    scene_id: str,
    crowd: Crowd,
    seconds: float,
    watch: Callable[[float], None] = lambda done: None,
) -> list[Performance]:
    """The first `seconds` of a crowd. A latecomer stands in its first frame until it comes.

    Raises InvalidArgument, and NotFound without the scene.
    """
    session_id = world.create_session(SessionSpec(scene=scene_id), now=0.0).session_id
    world.crowds.set(session_id, crowd, 0.0)
    chunks: dict[str, list[MotionChunk]] = {}
    specs: dict[str, AgentSpec] = {}
    for now in np.arange(0.0, seconds + BEFORE, TICK).tolist():
        for chunk in world.tick(now):
            chunks.setdefault(chunk.agent_id, []).append(chunk)
        specs |= {info.agent_id: info.spec for info in world.list_agents(session_id)}
        watch(min(now, seconds))
    world.delete_session(session_id)
    if not chunks:
        raise InvalidArgument("nobody has found a place in the scene", "scene")
    first = min(own[0].scheduled_at for own in chunks.values())
    people = []
    for number, (agent_id, own) in enumerate(chunks.items(), 1):
        spec, start = specs[agent_id], own[0].scheduled_at - first
        clip = join_chunks(own, spec)[: max(round((seconds - start) * FPS), 1)]
        name = spec.name or f"person {number}"
        people.append(Performance(name, clip, spec.noise_seed, spec.outfit, start))
    return people
