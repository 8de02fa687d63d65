"""`make demo`: a static folder in which people walk without a server; any web host serves it.

The files that the local mode reads are packed with gzip, under their own names. Otherwise a page
downloads twice as much from a host that does not pack.
"""

import gzip
import json
import shutil
import sys
from pathlib import Path
from typing import Any, Final

import numpy as np

from wayfarer.body.glb import body_glb
from wayfarer.body.library import SHIPPED, load_body
from wayfarer.errors import ArtifactError, InvalidArgument
from wayfarer.models.artifacts import ASSETS
from wayfarer.navigation.examples import EXAMPLES
from wayfarer.spec import BETAS
from wayfarer.transport.conversion import scene_convert
from wayfarer.transport.conversion.basis import Basis
from wayfarer.world.scenes.outlines import outlines
from wayfarer_lab.engine_export.export import export_for_engines
from wayfarer_lab.engine_export.scene import write_scene

ROOT: Final = Path(__file__).parents[2]
WEB: Final = ROOT / "clients" / "web"
VIEWER: Final = ROOT / "service" / "wayfarer" / "transport" / "viewer"
RUNTIME: Final = WEB / "node_modules" / "onnxruntime-web" / "dist"

PAGE: Final = ("index.html", "demo.js")
STAGE: Final = (
    "bodies.js", "character.js", "dressing.js", "facets.js", "files.js", "furniture.js", "glb.js",
    "ground.js", "latest_call.js",
    "scene_level.js", "packed.js", "rig.js", "scene.js", "scenes.js", "shapes.js", "textures.js",
    "vantage.js",
    "vendor/three.min.js", "vendor/three.LICENSE", "vendor/meshopt.min.js", "vendor/draco.min.js",
)  # fmt: skip
WASM: Final = "ort-wasm-simd-threaded.wasm"
RUNTIME_FILES: Final = ("ort.wasm.min.mjs", "ort-wasm-simd-threaded.mjs", WASM)
CLIENT: Final = (
    "core", "local", "access.js", "api.js", "character.js", "index.js", "lease.js", "session.js",
    "stream.js", "three.js",
)  # fmt: skip
SCENE: Final = "town_square"

VARIANTS: Final = 8
"""People who look and are built differently; more are alike."""


def write_demo(out: Path) -> None:
    """Writes the folder. Raises InvalidArgument when `out` is somebody else's, ArtifactError."""
    if out.exists() and not (out / "people" / "wayfarer.json").exists() and any(out.iterdir()):
        raise InvalidArgument(f"{out} holds other files; name another folder", "out")
    if not RUNTIME.is_dir():
        raise ArtifactError(f"{RUNTIME}: is missing: cd clients/web && npm ci")
    for name in PAGE:
        _copy(WEB / "demo" / name, out / name)
    for name in STAGE:
        _copy(VIEWER / name, out / "viewer" / name)
    for name in RUNTIME_FILES:
        _copy(RUNTIME / name, out / "onnxruntime" / name)
    for name in CLIENT:
        _copy(WEB / "src" / name, out / "viewer" / "client" / name)
    shutil.rmtree(out / "people", ignore_errors=True)  # an older export has other files
    export_for_engines(ASSETS / "models" / "gamma-anny52", out / "people", 1, _say, halves=True)
    scene = write_scene(EXAMPLES[SCENE](), out / "scene")
    drawn = scene_convert.outlines(outlines(scene), Basis.GLTF.axes)
    for file in (out / "onnxruntime" / WASM, *_read_by_local_mode(out)):
        file.write_bytes(gzip.compress(file.read_bytes(), mtime=0))
    (out / "scene" / "outlines.json").write_text(drawn.model_dump_json(), "utf-8")
    _write_bodies(out / "bodies")
    size = sum(file.stat().st_size for file in out.rglob("*") if file.is_file())
    _say(f"{out}: {size / 1e6:.0f} MB; to look at it: python3 -m http.server --directory {out}")


def _write_bodies(folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    generator = np.random.default_rng(7)
    looks: list[dict[str, Any]] = []
    for number in range(VARIANTS):
        gender = ("female", "male")[number % 2]
        betas = generator.normal(size=BETAS).clip(-1.5, 1.5).round(3)
        file = f"{gender}-{number}.glb"
        (folder / file).write_bytes(body_glb(load_body(SHIPPED, gender, "low"), betas, number))
        looks.append({"gender": gender, "betas": betas.tolist(), "file": file})
    (folder / "looks.json").write_text(json.dumps(looks))


def _read_by_local_mode(out: Path) -> list[Path]:
    """Files of the export and of the scene."""
    folders = (out / "people", out / "scene")
    return [file for folder in folders for file in folder.iterdir() if file.suffix != ".md"]


def _copy(source: Path, target: Path) -> None:
    target.parent.mkdir(parents=True, exist_ok=True)
    if source.is_dir():
        shutil.copytree(source, target, dirs_exist_ok=True)
    else:
        shutil.copyfile(source, target)


def _say(line: str) -> None:
    sys.stdout.write(line + "\n")


if __name__ == "__main__":
    try:
        write_demo(Path(sys.argv[1]))
    except (InvalidArgument, ArtifactError) as error:
        sys.exit(f"demo: {error}")
