"""Scenes as bytes: in the journal their content, and their obstacles, which change. To another
server goes the content with its baked ground, which takes long to make.
"""

import pickle
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Final

import structlog
from pydantic import Base64Bytes, ConfigDict, TypeAdapter

from wayfarer import __version__
from wayfarer.errors import InvalidArgument
from wayfarer.navigation.scene_spec import (
    Box,
    Cylinder,
    Floor,
    MeshAxes,
    MeshFile,
    MeshFormat,
    Obstacle,
    Point3,
    Prism,
    Ramp,
    SceneSpec,
    Solid,
    Walkable,
)
from wayfarer.runtime.persistence.journal_file import Entries, EntryKind
from wayfarer.world.scenes.messages import SceneSource
from wayfarer.world.scenes.scene_registry import SceneEntry, SceneRecord

log = structlog.get_logger(__name__)

STRICT: Final = ConfigDict(extra="forbid")


@dataclass(frozen=True, slots=True)
class SolidPart:
    """A solid or an obstacle; exactly one is there."""

    __pydantic_config__: ClassVar[ConfigDict] = STRICT

    box: Box | None = None
    cylinder: Cylinder | None = None
    prism: Prism | None = None
    ramp: Ramp | None = None

    @classmethod
    def of(cls, solid: Solid) -> "SolidPart":
        """The part of a solid."""
        kind: dict[str, Any] = {type(solid).__name__.lower(): solid}
        return cls(**kind)

    @property
    def solid(self) -> Solid:
        """The stored scene. Raises ValueError unless that is one."""
        [found] = [s for s in (self.box, self.cylinder, self.prism, self.ramp) if s is not None]
        return found


@dataclass(frozen=True, slots=True)
class MeshPart:
    """`MeshFile`, its bytes as text."""

    __pydantic_config__: ClassVar[ConfigDict] = STRICT

    data: Base64Bytes
    format: MeshFormat
    axes: MeshAxes
    unit: float


@dataclass(frozen=True, slots=True)
class ScenePart:
    """A scene without its obstacles."""

    __pydantic_config__: ClassVar[ConfigDict] = STRICT

    name: str
    attributes: dict[str, str]
    created_at: float
    floors: tuple[Floor, ...]
    solids: tuple[SolidPart, ...]
    mesh: MeshPart | None
    walkable: Walkable
    entries: tuple[Point3, ...]


@dataclass(frozen=True, slots=True)
class ObstaclesPart:
    """The obstacles of a scene."""

    __pydantic_config__: ClassVar[ConfigDict] = STRICT

    version: int
    obstacles: dict[str, SolidPart]


SCENE: Final = TypeAdapter(ScenePart)
OBSTACLES: Final = TypeAdapter(ObstaclesPart)


def scene_part(kept: SceneEntry) -> ScenePart:
    """The part of a scene that never changes."""
    source, spec = kept.source, kept.source.spec
    mesh = spec.mesh
    return ScenePart(
        name=source.name,
        attributes=dict(source.attributes),
        created_at=kept.created_at,
        floors=spec.floors,
        solids=tuple(map(SolidPart.of, spec.solids)),
        mesh=None if mesh is None else MeshPart(mesh.data, mesh.format, mesh.axes, mesh.unit),
        walkable=spec.walkable,
        entries=spec.entries,
    )


def obstacles_part(kept: SceneEntry) -> ObstaclesPart:
    """The part of a scene that changes."""
    scene = kept.scene
    parts = {name: SolidPart.of(obstacle) for name, obstacle in scene.obstacles.items()}
    return ObstaclesPart(scene.version, parts)


def content_bytes(kept: SceneEntry) -> bytes:
    """The part of a scene that never changes, baked, for another server.

    It is pickled, which is safe between nodes: Ray pickles all arguments of their calls.
    """
    text, baked = SCENE.dump_json(scene_part(kept)), pickle.dumps(kept.baked)
    return pickle.dumps((text, __version__, baked))


def obstacles_bytes(kept: SceneEntry) -> bytes:
    """The part of a scene that changes, for another server."""
    return OBSTACLES.dump_json(obstacles_part(kept))


def decode_scene(scene_id: str, content: bytes, obstacles: bytes) -> SceneRecord:
    """A scene of another server; of another release, it has to be baked again. Raises
    InvalidArgument.
    """
    try:
        text, version, baked = pickle.loads(content)
        record = _record(scene_id, text, obstacles)
    except (ValueError, EOFError, pickle.UnpicklingError) as error:  # pydantic's are ValueErrors
        raise InvalidArgument(f"scene {scene_id!r} is unsound: {error}", "scene") from None
    return replace(record, baked=pickle.loads(baked)) if version == __version__ else record


def decode_scenes(entries: Entries) -> list[SceneRecord]:
    """All sound scenes, oldest first; damaged ones are logged and lost."""
    obstacles = entries.of(EntryKind.OBSTACLES)
    found: list[SceneRecord] = []
    for name, text in entries.of(EntryKind.SCENE).items():
        try:
            found.append(_record(name, text, obstacles.get(name)))
        except Exception as error:
            log.error("a scene is lost: its entry is unsound", name=name, why=str(error))
    return sorted(found, key=lambda record: record.created_at)


def _record(name: str, text: bytes, obstacles: bytes | None) -> SceneRecord:
    part = SCENE.validate_json(text)
    stands = OBSTACLES.validate_json(obstacles) if obstacles else ObstaclesPart(0, {})
    mesh = part.mesh
    spec = SceneSpec(
        floors=part.floors,
        solids=tuple(solid.solid for solid in part.solids),
        mesh=None if mesh is None else MeshFile(mesh.data, mesh.format, mesh.axes, mesh.unit),
        walkable=part.walkable,
        entries=part.entries,
    )
    source = SceneSource(spec, part.name, part.attributes)
    return SceneRecord(name, source, part.created_at, stands.version, _obstacles(stands.obstacles))


def _obstacles(parts: Mapping[str, SolidPart]) -> dict[str, Obstacle]:
    found: dict[str, Obstacle] = {}
    for name, part in parts.items():
        solid = part.solid
        if isinstance(solid, Ramp):
            raise ValueError(f"obstacle {name!r} is a ramp")
        found[name] = solid
    return found
