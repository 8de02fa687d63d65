"""The Godot addon: parsed and linted, run in the engine, and against the real server."""

import os
import re
import shutil
import sys
from pathlib import Path

import pytest

from tests.programs import run_program

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "clients" / "godot"
GOLDEN = ROOT / "tests" / "golden"
SCRIPTS = sorted(FOLDER.rglob("*.gd"))
GODOT = os.environ.get("GODOT") or shutil.which("godot") or shutil.which("godot4")

with_godot = pytest.mark.skipif(
    not GODOT,
    reason="needs Godot 4.4+: set GODOT to it, or tests/clients/get_godot.sh FOLDER (Debian)",
)


def godot(*arguments: str, project: Path, seconds: int = 200) -> str:
    """Its output. A broken script does not end the engine, but reports it."""
    options = ("--headless", "--max-fps", "60", "--path", project)
    done = run_program(GODOT, *options, *arguments, timeout=seconds)
    said = done.stdout + done.stderr
    assert "SCRIPT ERROR" not in said and "Parse Error" not in said, said[-6000:]
    return said


@pytest.fixture(scope="module")
def project(tmp_path_factory) -> Path:
    """A copy that the engine has imported, as a user's first opening does."""
    copy = tmp_path_factory.mktemp("godot") / "project"
    shutil.copytree(FOLDER, copy, ignore=shutil.ignore_patterns(".godot"))
    godot("--import", project=copy)
    return copy


def test_the_addon_is_complete():
    """Every script has its UID, to which scenes refer; names of classes are its own."""
    assert all(script.with_name(script.name + ".uid").exists() for script in SCRIPTS)
    uids = [path.read_text() for path in FOLDER.rglob("*.uid")]
    assert len(set(uids)) == len(uids) == len(SCRIPTS)
    addon = FOLDER / "addons" / "wayfarer"
    config = (addon / "plugin.cfg").read_text()
    for key in ("name", "description", "author", "version", "script"):
        assert re.search(rf'^{key}="[^"]+"$', config, re.MULTILINE), key
    assert (addon / "plugin.gd").exists()
    names = [
        name
        for script in SCRIPTS
        for name in re.findall(r"^class_name (\w+)", script.read_text(), re.MULTILINE)
    ]
    assert len(set(names)) == len(names) and all(name.startswith("Wayfarer") for name in names)


def test_it_parses_and_lints():
    run_program(sys.executable, "-m", "gdtoolkit.linter", *SCRIPTS)  # it parses first


@with_godot
def test_its_own_tests_pass(project):
    """Golden vectors and traces, messages, the stream."""
    said = godot("-s", "tests/run.gd", "--", str(GOLDEN), project=project)
    counts = re.search(r"(\d+) tests, (\d+) checks, 0 failures", said)
    assert counts and int(counts[1]) >= 27 and int(counts[2]) > 10_000, said[-6000:]


@with_godot
def test_an_agent_walks_to_its_goal_on_its_nodes(project, cluster):
    """Through the entry of a cluster, a lost connection, and the drain of its node."""
    with cluster.drained_meanwhile():
        said = godot("-s", "tests/live.gd", "--", str(GOLDEN), cluster.url, project=project)
    walked = [line.partition(":")[0] for line in said.splitlines() if ": walked to " in line]
    assert walked == ["mixamo", "a_pose", "centimetres", "z_up", "missing_chest"]
    assert "crowd: 5 people walk about" in said
