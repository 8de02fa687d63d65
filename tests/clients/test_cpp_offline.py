"""clients/cpp/local: people walk without a server, in C++, as on the server and in the browser.

The trace of the server that checks local mode of the web client is walked in C++ on an export for
engines: three people, 30 s, with foot lock and postures and without. The JavaScript port then
follows the trace of the C++ port, on the same export.
"""

import csv
import io
import json
import logging
import os
import shutil
from pathlib import Path

import numpy as np
import onnxruntime
import pytest

from tests.clients.local_traces import PEOPLE, SECONDS
from tests.programs import run_program
from wayfarer.spec import FPS, STEP_SECONDS

LOG = logging.getLogger(__name__)
FOLDER = Path(__file__).parents[2] / "clients" / "cpp" / "examples"
INCLUDE = next(
    (
        folder
        for name in (os.environ.get("ONNXRUNTIME_INCLUDE"), "/usr/include/onnxruntime")
        if name and (folder := Path(name), folder / "onnxruntime_c_api.h")[1].exists()
    ),
    None,
)
LIBRARY = next(Path(onnxruntime.__file__).parent.glob("capi/libonnxruntime.so.*"), None)

missing = [tool for tool in ("cmake", "ninja", "g++") if not shutil.which(tool)]
if not Path("/usr/include/nlohmann/json.hpp").exists():
    missing.append("nlohmann-json3-dev")
if INCLUDE is None:
    missing.append("ONNXRUNTIME_INCLUDE (tests/clients/get_onnxruntime.sh FOLDER, or Debian 13's "
                   "libonnxruntime-dev)")  # fmt: skip
if LIBRARY is None:
    missing.append("a pip package of onnxruntime with its library")
pytestmark = pytest.mark.skipif(bool(missing), reason=f"needs {', '.join(missing)}")


@pytest.fixture(scope="module")
def exported(engines_export):
    return engines_export.folder


@pytest.fixture(scope="module")
def programs(tmp_path_factory):
    """Built as its CMakeLists.txt describes, with the library of the pip package."""
    folder = tmp_path_factory.mktemp("build")
    (folder / "libonnxruntime.so.1").symlink_to(LIBRARY)  # the name that it is linked by
    said = [
        f"-DONNXRUNTIME_INCLUDE={INCLUDE}",
        f"-DONNXRUNTIME_LIBRARY={folder}/libonnxruntime.so.1",
        "-DWAYFARER_TRACE=ON",
    ]
    # -O1 for the warnings of the optimizer; more of it would double the time of the build
    flags = "-DCMAKE_CXX_FLAGS_RELEASE=-O1 -DNDEBUG -Wall -Wextra -Wpedantic -Werror"
    commands = (["-S", FOLDER, "-B", folder, "-G", "Ninja", flags, *said], ["--build", folder])
    for words in commands:
        run_program("cmake", *words)
    return folder


@pytest.fixture(scope="module")
def walked(programs, exported, drawn, tmp_path_factory):
    """A file with the same commands, and this program's results."""
    folder = tmp_path_factory.mktemp("traces")
    (folder / "server.json").write_text(json.dumps(drawn))
    out = run(programs / "trace", exported, folder / "server.json")
    (folder / "cpp.json").write_text(out)
    return folder / "cpp.json"


def run(*words: object) -> str:
    return run_program(*words).stdout


def test_its_trace_is_the_servers(drawn, walked):
    found = json.loads(walked.read_text())["chunks"]
    assert len(found) == len(drawn["chunks"]) == 2 * len(PEOPLE)
    for person, (own, theirs) in enumerate(zip(found, drawn["chunks"], strict=True)):
        assert len(own) == len(theirs) >= (SECONDS - 1) / STEP_SECONDS
        for name in ("seq", "flags", "state", "waypoint"):
            assert [chunk[name] for chunk in own] == [chunk[name] for chunk in theirs], name
        off, turned = (apart(own, theirs, name) for name in ("translation", "rotations"))
        LOG.info("%d: hips %.4f mm, turns %.1e", person, 1000 * off, turned)
        assert off < 1e-3 and turned < 1e-3
        others = sum(a["contacts"] != b["contacts"] for a, b in zip(own, theirs, strict=True))
        assert others <= 1  # the last digit may cross thresholds


def apart(own: list[dict], theirs: list[dict], name: str) -> float:
    numbers = ([chunk[name] for chunk in chunks] for chunks in (own, theirs))
    return float(np.abs(np.subtract(*numbers)).max())


@pytest.mark.parametrize("gender", ["female", "male"])
def test_the_example_walks_to_a_goal(programs, exported, gender):
    words = [
        "--goal",
        "2,-1.5",
        "--gender",
        gender,
        "--heading",
        "0.4",
        "--seed",
        2**64 - 1,
        "--seconds",
        12,
    ]
    rows = list(csv.DictReader(io.StringIO(run(programs / "offline", exported, *words))))
    assert rows[0]["state"] == "standing" and rows[0]["done"] == "0"
    assert rows[-1]["state"] == "standing" and rows[-1]["done"] == "1"
    assert len(rows) >= 11 * FPS
    assert np.hypot(float(rows[0]["x"]), float(rows[0]["y"])) < 0.05
    assert np.hypot(float(rows[-1]["x"]) - 2, float(rows[-1]["y"]) + 1.5) < 0.3
    assert all(row["left"] == row["right"] == "1" for row in rows[-FPS:])


def test_it_says_what_is_wrong(programs, exported, tmp_path):
    def refused(*words: object) -> str:
        return run_program(programs / "offline", *words, code=1).stderr

    assert "usage: offline FOLDER" in refused()
    assert "wayfarer.json: cannot be read" in refused(tmp_path)
    assert "--goal 3: not X,Y" in refused(exported, "--goal", "3")
    assert "--speed fast: no number" in refused(exported, "--speed", "fast")
    assert "other: the model has no such body" in refused(exported, "--gender", "other")
    for file in exported.iterdir():
        (tmp_path / file.name).write_bytes(file.read_bytes()[:9000])
    assert "wayfarer.json: " in refused(tmp_path)
    (tmp_path / "wayfarer.json").write_bytes((exported / "wayfarer.json").read_bytes())
    assert ".bin: is cut short" in refused(tmp_path)
    for gender in ("female", "male"):
        name = f"body_{gender}.bin"
        (tmp_path / name).write_bytes((exported / name).read_bytes())
    assert "onnxruntime: " in refused(tmp_path)
