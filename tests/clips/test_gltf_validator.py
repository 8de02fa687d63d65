"""Khronos' glTF validator finds nothing to warn of in files for users."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.programs import run_program
from wayfarer.body.glb import body_glb
from wayfarer.body.library import load_body
from wayfarer.clips.clip import Clip
from wayfarer.clips.files import (
    BodyDetail,
    FileFormat,
    FileOptions,
    Performance,
    RootMotion,
    encode,
)

TESTS = Path(__file__).parents[1]

SCRIPT = """
const { validateBytes } = require("gltf-validator");
const { readFileSync } = require("fs");
const validate = (file) => validateBytes(new Uint8Array(readFileSync(file)), { maxIssues: 20 });
Promise.all(process.argv.slice(1).map(validate))
  .then((reports) => console.log(JSON.stringify(reports.map(({ issues }) => issues))));
"""

NOTES = {"UNUSED_OBJECT", "UNSUPPORTED_EXTENSION", "NODE_EMPTY", "BUFFER_VIEW_TARGET_MISSING"}
"""Hints: no texture for the texture coordinates, VRM's extension, bones without a mesh,
buffer views of a foreign file, which are kept as they are."""

pytestmark = pytest.mark.skipif(
    not (shutil.which("node") and (TESTS / "node_modules" / "gltf-validator").is_dir()),
    reason="no glTF validator: make tests/node_modules/.package-lock.json (needs npm)",
)


def issues(*paths: Path) -> list[str]:
    """Errors and warnings of all files."""
    done = run_program("node", "-e", SCRIPT, *paths, cwd=TESTS)
    wrong = []
    for path, found in zip(paths, json.loads(done.stdout), strict=True):
        assert {m["code"] for m in found["messages"] if m["severity"] > 1} <= NOTES
        mine = [m for m in found["messages"] if m["severity"] <= 1]
        assert len(mine) == found["numErrors"] + found["numWarnings"] or found["truncated"]
        wrong += [f"{path.stem}: {m['code']} {m.get('pointer', '')}" for m in mine]
    return wrong


@pytest.mark.parametrize("gender", ["female", "male"])
@pytest.mark.parametrize("detail", ["high", "low"])
def test_bodies(tmp_path: Path, gender: str, detail: str) -> None:
    """As the viewer loads them."""
    betas = np.random.default_rng(1).normal(size=10)
    (tmp_path / "body.glb").write_bytes(body_glb(load_body("anny52", gender, detail), betas, 7))
    assert issues(tmp_path / "body.glb") == []


@pytest.mark.parametrize("gender", ["female", "male"])
@pytest.mark.parametrize("root", RootMotion)
def test_clips(tmp_path: Path, clip: Clip, gender: str, root: RootMotion) -> None:
    """As `wayfarer generate` writes them, and several people in a scene."""
    options = FileOptions(root=root, detail=BodyDetail.LOW, fps=30)
    people = [Performance("Ada", replace(clip, gender=gender)), Performance("Bob", clip, style=2)]
    ground = np.array([[[-2, -2, 0], [5, -2, 0], [5, 9, 0]], [[0, 0, 0]] * 3], float)
    (tmp_path / "clip.glb").write_bytes(encode(people, options, scene=ground))
    assert issues(tmp_path / "clip.glb") == []


def test_vrm_animations(tmp_path: Path, clip: Clip) -> None:
    options = FileOptions(FileFormat.VRMA)
    (tmp_path / "clip.glb").write_bytes(encode([Performance("Ada", clip)], options))
    assert issues(tmp_path / "clip.glb") == []


def test_what_is_wrong_is_found(tmp_path: Path) -> None:
    data = body_glb(load_body("anny52", "female", "low"), np.zeros(10))
    (tmp_path / "cut.glb").write_bytes(data[:-100])
    assert issues(tmp_path / "cut.glb")
