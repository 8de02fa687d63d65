"""A scene for the web client's local mode: where one may walk, and how far walls are."""

import json
from pathlib import Path
from typing import Any, Final

import numpy as np

from wayfarer.errors import InvalidArgument
from wayfarer.navigation.examples import EXAMPLES
from wayfarer.navigation.scene import Scene, bake
from wayfarer.navigation.scene_spec import MeshFile, MeshFormat, SceneSpec
from wayfarer.world.scenes.grounding import is_level

SCHEMA: Final = 1
ABOUT: Final = "scene.json"
FIELD: Final = "scene.bin"
FORMATS: Final[dict[str, MeshFormat]] = {".glb": "glb", ".obj": "obj", ".ply": "ply"}


def read_scene(name: str) -> SceneSpec:
    """An example scene, or a level's file. Raises InvalidArgument."""
    if make := EXAMPLES.get(name):
        return make()
    file = Path(name)
    if (kind := FORMATS.get(file.suffix.lower())) is None or not file.is_file():
        allowed = f"{', '.join(EXAMPLES)}, or a file that ends with {', '.join(FORMATS)}"
        raise InvalidArgument(f"there is no scene {name!r}; allowed: {allowed}", "scene")
    return SceneSpec(mesh=MeshFile(file.read_bytes(), kind))


def write_scene(spec: SceneSpec, out: Path) -> Scene:
    """Bakes a scene and writes `scene.json` and `scene.bin` to the folder `out`.

    scene.json: `radius`; `corners` [T, 3, 2] of the navigation mesh's triangles, anticlockwise;
    `neighbours` [T, 3], the triangle behind the edge from corner k to k + 1, or -1; `island` [T];
    `field`, the grid of scene.bin: float32, little-endian, [rows, columns], metres to the nearest
    wall. World space: metres, Z up. Raises InvalidArgument: local mode walks on one level floor.
    """
    scene = bake(spec)
    if len(scene.ground.layers) > 1 or not is_level(scene):
        raise InvalidArgument("local mode walks on one level floor; this scene has more", "scene")
    if level := scene.ground.layers[0].heights.level:
        raise InvalidArgument(f"the floor is {level:g} m high; local mode's is at 0", "scene")
    field = scene.fields[0]
    about: dict[str, Any] = {
        "schema": SCHEMA,
        "frame": "world: metres, right-handed, Z up",
        "radius": spec.walkable.radius,
        "corners": scene.mesh.corners.tolist(),
        "neighbours": _neighbours(scene),
        "island": scene.mesh.island.tolist(),
        "field": {
            "file": FIELD,
            "origin": field.grid.origin,
            "cell": field.grid.cell,
            "rows": field.grid.rows,
            "columns": field.grid.columns,
        },
    }
    out.mkdir(parents=True, exist_ok=True)
    (out / ABOUT).write_text(json.dumps(about, separators=(",", ":")), "utf-8")
    (out / FIELD).write_bytes(field.distance.astype("<f4").tobytes())
    return scene


def _neighbours(scene: Scene) -> list[list[int]]:
    """Triangles [T, 3] behind the edges, from the portals: each starts at its right end."""
    found = np.full((len(scene.mesh.corners), 3), -1)
    first, others, ends = scene.mesh.portals
    owners = np.repeat(np.arange(len(found)), np.diff(first)).tolist()
    for triangle, other, right in zip(owners, others.tolist(), ends[:, 2:].tolist(), strict=True):
        found[triangle, scene.mesh.corners[triangle].tolist().index(right)] = other
    behind: list[list[int]] = found.tolist()
    return behind
