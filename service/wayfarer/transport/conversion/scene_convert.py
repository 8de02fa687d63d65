"""Schema ↔ runtime for scenes: values in the basis of a scene ↔ messages in world space."""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wayfarer.errors import InvalidArgument
from wayfarer.navigation import scene_spec as world
from wayfarer.navigation.paths.path import GroundPath
from wayfarer.transport import schema
from wayfarer.transport.conversion import convert
from wayfarer.transport.conversion.basis import Axes, Basis
from wayfarer.transport.conversion.units import in_world, place, vector
from wayfarer.world.scenes import messages as runtime

CROWD = runtime.Crowd(0)
"""Its fields are the defaults."""

DECIMALS = 4
"""Decimals of coordinates for drawing."""

Array = NDArray[np.floating[Any]]
Shape = schema.Box | schema.Cylinder | schema.Prism | schema.Ramp


def scene_spec(request: schema.NewScene, mesh: world.MeshFile | None = None) -> world.SceneSpec:
    """The scene to bake. Takes long for a large scene."""
    axes = request.basis.axes
    return world.SceneSpec(
        floors=tuple(_floor(floor, axes) for floor in request.floors),
        solids=tuple(_solid(shape_of(solid), axes) for solid in request.solids),
        mesh=mesh,
        walkable=_walkable(request.walkable, axes),
        entries=tuple(place(entry, axes) for entry in request.entries),
    )


def mesh_file(mesh: schema.Mesh, basis: Basis, data: bytes) -> world.MeshFile:
    """A file whose coordinates are in the basis that it declares, by default the scene's."""
    usual = Basis.GLTF if mesh.format is schema.MeshFormat.GLB else basis
    axes = (mesh.basis or usual).axes
    x, y, z = ((float(a), float(b), float(c)) for a, b, c in axes.matrix.T)
    unit = axes.metres_per_unit if mesh.unit is None else mesh.unit
    return world.MeshFile(data, mesh.format.value, (x, y, z), unit)


def obstacle(request: schema.Obstacle, axes: Axes) -> world.Obstacle:
    """The obstacle in world space."""
    made = _solid(shape_of(request), axes)
    assert not isinstance(made, world.Ramp)
    return made


def shape_of(solid: schema.Solid | schema.Obstacle) -> Shape:
    """The shape that is given."""
    _, shape = solid.given
    assert isinstance(shape, Shape)
    return shape


def crowd(request: schema.Crowd, basis: Basis, seed: int) -> runtime.Crowd:
    """The crowd in world space; `seed` is used if the client gave none."""
    given = {"seed": seed} | in_world(dict[str, Any], request, basis.axes)
    for name, (low, high) in (("speed", CROWD.speed), ("dwell", CROWD.dwell)):
        given[name] = (given.pop(f"min_{name}", low), given.pop(f"max_{name}", high))
    return runtime.Crowd(**given)


def scene(
    info: runtime.SceneInfo, basis: Basis, lease_s: float, endpoint: schema.Endpoint | None
) -> schema.Scene:
    """Describes a scene for its client."""
    axes = basis.axes
    x0, y0, x1, y1 = info.bounds
    corners = axes.points_to_wire(np.array([[x0, y0, 0.0], [x1, y1, 0.0]]))
    return schema.Scene(
        scene_id=info.scene_id,
        name=info.name,
        basis=convert.basis_info(basis),
        content_hash=info.content_hash,
        version=info.version,
        area_m2=info.area,
        islands=info.islands,
        min=vector(corners.min(0)),
        max=vector(corners.max(0)),
        obstacles=tuple(
            schema.NamedObstacle(name=name, obstacle=_obstacle_to_wire(found, axes))
            for name, found in info.obstacles.items()
        ),
        sessions=info.sessions,
        created_at_us=convert.microseconds(info.created_at),
        bake_s=info.bake_s,
        lease_s=lease_s,
        endpoint=endpoint,
        notes=tuple(convert.written(note, axes) for note in info.notes),
    )


def scene_version(info: runtime.SceneInfo) -> schema.SceneVersion:
    """The scene after a change."""
    return schema.SceneVersion(version=info.version, area_m2=info.area, islands=info.islands)


def scene_path(way: GroundPath, axes: Axes) -> schema.ScenePath:
    """Describes a way for its client."""
    return schema.ScenePath(
        points=tuple(vector(p) for p in axes.points_to_wire(way.points)),
        length=axes.length_to_wire(way.length),
        start_moved=axes.length_to_wire(way.start_moved),
        goal_moved=axes.length_to_wire(way.goal_moved),
        version=way.scene_version,
    )


def outlines(found: runtime.Outlines, axes: Axes) -> schema.SceneOutlines:
    """A scene for drawing. Takes long for a large scene."""
    return schema.SceneOutlines(
        walkable=tuple(
            schema.Polygon(
                outline=_flat(rings[0], axes),
                holes=tuple(schema.Ring(points=_flat(ring, axes)) for ring in rings[1:]),
            )
            for rings in found.walkable
        ),
        vertices=_flat(found.vertices, axes),
        triangles=tuple(index for triangle in found.triangles for index in triangle),
        solids=tuple(_block(block, axes) for block in found.solids),
        obstacles=tuple(_block(block, axes, name) for name, block in found.obstacles.items()),
        version=found.version,
    )


@contextmanager
def fields_named(
    solids: Sequence[schema.Solid] = (), obstacle: schema.Obstacle | None = None
) -> Iterator[None]:
    """Names fields as the client does: the runtime knows `center`, `yaw` and world axes."""
    try:
        yield
    except InvalidArgument as error:
        field = _client_field(error.field, solids, obstacle)
        text = str(error).replace(error.field, field) if error.field else str(error)
        raise InvalidArgument(text, field) from None


_SOLID = re.compile(r"(solids\[(\d+)\]|obstacle)\.(\w+)(\[\d+\])?.*")
_RENAMED: Mapping[type, Mapping[str, str]] = {
    schema.Box: {"center": "position", "bottom": "position", "height": "size", "yaw": "heading"},
    schema.Ramp: {"center": "position", "bottom": "position", "height": "size", "yaw": "heading"},
    schema.Cylinder: {"center": "position", "bottom": "position"},
    schema.Prism: {},
}


def _client_field(
    field: str, solids: Sequence[schema.Solid], obstacle: schema.Obstacle | None
) -> str:
    """Renames fields: `solids[3].yaw` → `solids[3].box.heading`, `entries[0][1]` → `entries[0]`."""
    if field == "mesh.data":
        return "data"
    found = _SOLID.fullmatch(field)
    if found is None:
        field = re.sub(r"(\.holes\[\d+\])", r"\1.points", field)
        return re.sub(r"(\]|start|goal)\[\d+\]$", r"\1", field)
    solid = obstacle if found[1] == "obstacle" else solids[int(found[2])]
    if solid is None:
        return field
    kind, shape = solid.given
    name = _RENAMED[type(shape)].get(found[3], found[3])
    place = found[4] if name == "outline" and found[4] else ""
    return f"{found[1]}.{kind}.{name}{place}"


def _floor(floor: schema.Floor, axes: Axes) -> world.Floor:
    return world.Floor(
        outline=_ring(floor.outline, axes),
        holes=tuple(_ring(hole.points, axes) for hole in floor.holes),
        height=axes.length_to_core(floor.height),
    )


def _ring(points: Iterable[schema.Vector3], axes: Axes) -> world.Ring:
    found = axes.points_to_core(np.array([(p.x, p.y, p.z) for p in points]))
    return tuple((x, y) for x, y, _ in found.tolist())


def _solid(shape: Shape, axes: Axes) -> world.Solid:
    if isinstance(shape, schema.Prism):
        height, bottom = axes.length_to_core(shape.height), axes.length_to_core(shape.bottom)
        return world.Prism(_ring(shape.outline, axes), height, bottom)
    x, y, bottom = place(shape.position, axes)
    if isinstance(shape, schema.Cylinder):
        radius, height = axes.length_to_core(shape.radius), axes.length_to_core(shape.height)
        return world.Cylinder((x, y), radius, height, bottom)
    size = np.array([shape.size.x, shape.size.y, shape.size.z])
    width, depth, height = (float(v) for v in np.abs(axes.points_to_core(size)))
    kind = world.Box if isinstance(shape, schema.Box) else world.Ramp
    return kind((x, y), (width, depth), height, axes.heading_to_core(shape.heading), bottom)


def _walkable(walkable: schema.Walkable, axes: Axes) -> world.Walkable:
    return in_world(world.Walkable, walkable, axes)


def _obstacle_to_wire(found: world.Obstacle, axes: Axes) -> schema.Obstacle:
    height, bottom = axes.length_to_wire(found.height), found.bottom
    if isinstance(found, world.Prism):
        ring = axes.points_to_wire(np.array([(x, y, bottom) for x, y in found.outline]))
        outline, foot = tuple(vector(p) for p in ring), axes.length_to_wire(bottom)
        return schema.Obstacle(prism=schema.Prism(outline=outline, bottom=foot, height=height))
    position = vector(axes.points_to_wire(np.array([*found.center, bottom])))
    if isinstance(found, world.Cylinder):
        radius = axes.length_to_wire(found.radius)
        made = schema.Cylinder(position=position, radius=radius, height=height)
        return schema.Obstacle(cylinder=made)
    x, y, z = (float(v) for v in np.abs(axes.points_to_wire(np.array([*found.size, found.height]))))
    heading = axes.heading_to_wire(found.yaw)
    size = schema.Extents(x=x, y=y, z=z)
    return schema.Obstacle(box=schema.Box(position=position, size=size, heading=heading))


def _block(block: runtime.Block, axes: Axes, name: str = "") -> schema.Block:
    return schema.Block(
        top=_flat(block.top, axes), bottom=axes.length_to_wire(block.bottom), name=name
    )


def _flat(points: Sequence[Sequence[float]], axes: Axes) -> tuple[float, ...]:
    """Points of two or three coordinates as a flat list, three numbers for each."""
    if not points:
        return ()
    found = np.array(points, dtype=float)
    found = np.pad(found, ((0, 0), (0, 3 - found.shape[1])))
    wire = np.round(axes.points_to_wire(found), DECIMALS) + 0.0  # + 0.0: no negative zero
    return tuple(wire.ravel().tolist())
