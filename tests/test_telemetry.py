"""No telemetry: no host is looked up or called, nothing is written outside its own folders.

Two of the libraries do both unless they are kept from it, see `wayfarer/__init__.py`.
"""

import os
import re
import shutil
import sys
import time
from collections.abc import Mapping
from pathlib import Path

import pytest

from tests.programs import run_program
from tests.serving import Service, post
from tests.traced import Asked, asked, strace

ROOT = Path(__file__).parent.parent
ENGINE = re.compile(r"^ *(?:import|from) (?:onnxruntime|openvino)\b", re.MULTILINE)
SHARED_MEMORY = re.compile(r"/dev/shm/sem\.")  # locks of multiprocessing; gone when it ends
LATER_S = 7.0
"""ONNX Runtime would ask again 5 s after its start."""

traced = pytest.mark.skipif(
    shutil.which("strace") is None and not os.environ.get("CI"),
    reason="needs strace (apt-get install strace)",
)


@pytest.fixture
def environment(tmp_path: Path) -> dict[str, str]:
    """The environment of a user with no settings and an empty home folder."""
    (tmp_path / "home").mkdir()
    (tmp_path / "tmp").mkdir()
    named = {"PATH": os.environ["PATH"], "PYTHONDONTWRITEBYTECODE": "1"}  # CI would quieten some
    if path := os.environ.get("PYTHONPATH"):
        named["PYTHONPATH"] = path
    return {**named, "HOME": str(tmp_path / "home"), "TMPDIR": str(tmp_path / "tmp")}


def run(environment: Mapping[str, str], folder: Path, *arguments: str) -> Asked:
    """A Python command from its start to its end."""
    record = folder / "trace"
    run_program(*strace(record), sys.executable, *arguments, env=environment, cwd=folder)
    return asked(record)


def outside(found: Asked, *allowed: Path) -> list[str]:
    """Files written that are in none of the allowed folders."""
    return sorted(
        path
        for path in found.written
        if path != "/dev/null"
        and not SHARED_MEMORY.match(path)
        and not any(Path(path).is_relative_to(folder) for folder in allowed)
    )


@pytest.mark.parametrize("package", ["wayfarer", "wayfarer_lab", "benchmarks", "tests.conftest"])
def test_every_package_switches_telemetry_off_before_an_engine_is_imported(package, environment):
    """A package is imported before the modules in it, and conftest before all tests."""
    look = (
        f"import {package}, os, sys; assert not {{'onnxruntime', 'openvino'}} & set(sys.modules);"
        "print(os.environ['ORT_DISABLE_TELEMETRY'], sys.modules['openvino_telemetry'])"
    )
    done = run_program(sys.executable, "-c", look, env=environment, cwd=ROOT)
    assert done.stdout.split() == ["1", "None"]


def test_engines_are_imported_in_those_packages_only():
    roots = {"service", "lab", "benchmarks", "tests"}
    files = [path for path in ROOT.rglob("*.py") if path.relative_to(ROOT).parts[0][0] != "."]
    found = {path.relative_to(ROOT).parts[0] for path in files if ENGINE.search(path.read_text())}
    assert found == roots


def test_who_wants_onnxruntime_to_report_may_say_so(environment):
    look = "import wayfarer, os; print(os.environ['ORT_DISABLE_TELEMETRY'])"
    told = {**environment, "ORT_DISABLE_TELEMETRY": "0"}
    assert run_program(sys.executable, "-c", look, env=told).stdout.strip() == "0"


@traced
def test_a_command_that_does_it_is_found_out(environment, tmp_path):
    """The check itself: names looked up by a thread of a child, a call, and a file in HOME."""
    do = (
        "import os, pathlib, socket, threading\n"
        "pathlib.Path.home().joinpath('id').write_text('1')\n"
        "def ask():\n"
        "    try: socket.getaddrinfo('telemetry.example', 443)\n"
        "    except OSError: pass\n"
        "if (child := os.fork()) == 0:\n"
        "    thread = threading.Thread(target=ask); thread.start(); thread.join(); os._exit(0)\n"
        "os.waitpid(child, 0)\n"
        "socket.socket(type=socket.SOCK_DGRAM).connect(('192.0.2.1', 443))\n"
    )
    found = run(environment, tmp_path, "-c", do)
    assert any("192.0.2.1" in call for call in found.hosts)
    assert any("htons(53)" in call or "nscd" in call for call in found.hosts)
    assert outside(found) == [f"{environment['HOME']}/id"]


@traced
@pytest.mark.slow
def test_serve_tells_nobody_and_writes_into_its_state_folder_only(environment, tmp_path):
    record, state = tmp_path / "trace", tmp_path / "state"
    with Service(
        *("--state-dir", str(state), "--engine", "auto"),
        before=strace(record),
        environment=environment,
    ) as service:
        answer = post(service.url, "/v1/sessions", {})
        assert answer.is_success, answer.text
        agents = f"/v1/sessions/{answer.json()['session_id']}/agents"
        post(service.url, agents, {"agents": [{}]}).raise_for_status()
        time.sleep(LATER_S)
    found = asked(record)
    assert found.hosts == []
    assert any(Path(path).is_relative_to(state) for path in found.written)
    assert outside(found, state, tmp_path / "tmp") == []
    assert list((tmp_path / "tmp").iterdir()) == list((tmp_path / "home").iterdir()) == []


@traced
@pytest.mark.slow
def test_generate_writes_its_file_and_nothing_else(environment, tmp_path):
    walk = tmp_path / "walk.glb"
    command = ("-m", "wayfarer", "generate", str(walk), "--goal", "0,1", "--seconds", "2")
    found = run(environment, tmp_path, *command)
    assert found == Asked([], {str(walk)})


@traced
@pytest.mark.slow
def test_openvino_tells_nobody(environment, tmp_path):
    pytest.importorskip("openvino")
    use = "from wayfarer.engines.openvino_engine import open_core; open_core()"
    found = run(environment, tmp_path, "-c", use)
    assert (found.hosts, outside(found, tmp_path / "tmp")) == ([], [])
