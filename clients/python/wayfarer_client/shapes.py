"""Parts of scenes, in the scene's basis; see proto/wayfarer/v1/scene.proto."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any, TypeAlias

from wayfarer_client.messages import Place, vector
from wayfarer_client.v1 import scene_pb2


@dataclass(frozen=True, slots=True)
class Box:
    """A box, standing upright."""

    position: Place  # the middle of its base
    size: Place  # extents along the axes of the basis, before it is turned
    heading: float = 0.0  # radians about up


@dataclass(frozen=True, slots=True)
class Cylinder:
    """A cylinder, standing upright."""

    position: Place  # the middle of its base
    radius: float
    height: float


@dataclass(frozen=True, slots=True)
class Prism:
    """An outline raised along up."""

    outline: Sequence[Place]  # corners; the component along up is ignored
    height: float
    bottom: float = 0.0


@dataclass(frozen=True, slots=True)
class Ramp:
    """A wedge to walk up, which rises along the basis's forward before it is turned."""

    position: Place  # the middle of its base
    size: Place
    heading: float = 0.0


@dataclass(frozen=True, slots=True)
class Floor:
    """A level piece of ground."""

    outline: Sequence[Place]  # corners; the component along up is ignored
    holes: Sequence[Sequence[Place]] = ()
    height: float = 0.0

    def to_wire(self) -> scene_pb2.Floor:
        """As protobuf."""
        return scene_pb2.Floor(
            outline=[vector(place) for place in self.outline],
            holes=[{"points": [vector(place) for place in hole]} for hole in self.holes],
            height=self.height,
        )


@dataclass(frozen=True, slots=True)
class Walkable:
    """The walkers of a scene; None takes the server's default. Lengths in units of the basis."""

    radius: float | None = None  # from the middle of an agent to walls and edges; 0.3 m
    step_height: float | None = None  # up or down in one step; 0.25 m
    slope_deg: float | None = None  # steeper ground is a wall; 40
    height: float | None = None  # free above the ground; 1.9 m

    def to_wire(self) -> scene_pb2.Walkable:
        """As protobuf."""
        return scene_pb2.Walkable(**{f.name: getattr(self, f.name) for f in fields(self)})


Obstacle: TypeAlias = Box | Cylinder | Prism
Solid: TypeAlias = Box | Cylinder | Prism | Ramp


def shape_to_wire(shape: Solid) -> dict[str, Any]:
    """The one field of a Solid or an Obstacle."""
    given = {field.name: getattr(shape, field.name) for field in fields(shape)}
    for name in {"position", "size"} & given.keys():
        given[name] = vector(given[name])
    if isinstance(shape, Prism):
        given["outline"] = [vector(place) for place in shape.outline]
    return {type(shape).__name__.lower(): given}
