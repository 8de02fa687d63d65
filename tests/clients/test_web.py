"""The npm package: its own tests, its types, and its use by a user."""

import json
import shutil
from pathlib import Path

import pytest

from tests.programs import run_program

FOLDER = Path(__file__).parents[2] / "clients" / "web"

pytestmark = pytest.mark.skipif(
    not shutil.which("node"), reason="needs node: apt-get install nodejs"
)
with_tools = pytest.mark.skipif(
    not (FOLDER / "node_modules").is_dir(), reason="needs its tools: cd clients/web && npm ci"
)


def run(*command: str, cwd: Path = FOLDER) -> str:
    return run_program(*command, cwd=cwd).stdout


def test_its_own_tests_pass():
    """Golden vectors and traces, messages, stream, calls, and that nothing is allocated."""
    said = run("node", "--test", *sorted(map(str, FOLDER.glob("test/*.test.js"))))
    assert "# fail 0" in said and "# skipped 0" in said


@with_tools
def test_an_agent_walks_to_its_goal_on_characters_of_each_engine(real_server):
    said = run("node", "--experimental-websocket", "test/live.js", real_server.url)
    walked = [line.partition(":")[0] for line in said.splitlines() if ": walked to " in line]
    assert walked == ["three", "vrm", "babylon", "glb"]


@pytest.fixture(scope="module")
def packed(tmp_path_factory) -> tuple[str, set[str]]:
    """The file that `npm pack` makes, which writes the types first, and what is in it."""
    shutil.rmtree(FOLDER / "types", ignore_errors=True)
    folder = tmp_path_factory.mktemp("packed")
    (made,) = json.loads(run("npm", "pack", "--json", "--pack-destination", str(folder)))
    return str(folder / made["filename"]), {entry["path"] for entry in made["files"]}


@with_tools
def test_its_types_are_right_and_it_is_fit_to_publish(packed, tmp_path):
    """The packed file is written without a check of types; two tools check the package."""
    run("node_modules/.bin/tsc", "--project", "tsconfig.json", "--outDir", str(tmp_path / "types"))
    file, files = packed
    assert {"README.md", "LICENSE", "src/index.js", "types/index.d.ts"} <= files
    assert not any(path.startswith(("test/", "node_modules/")) for path in files)
    assert "All good!" in run("node_modules/.bin/publint", "--strict", file)
    run("node_modules/.bin/attw", "--profile", "esm-only", file)


@with_tools
def test_an_empty_typescript_project_uses_it(packed, tmp_path):
    """Installed from the packed file, checked by tsc in strict mode, and run."""
    (tmp_path / "package.json").write_text('{"private": true, "type": "module"}')
    (tmp_path / "use.ts").write_text(
        'import { MotionPlayer, type PlayedAgent, Session } from "wayfarer-client";\n'
        'import { BONES, Retarget } from "wayfarer-client/core";\n'
        "const shown = (played: PlayedAgent): number => played.frame.length;\n"
        "const player = new MotionPlayer({ added: (played) => shown(played) });\n"
        "console.log(BONES.length, player.agents.size, typeof Session.open, typeof Retarget);\n"
    )
    run(
        "npm",
        "install",
        "--offline",
        "--no-audit",
        packed[0],
        cwd=tmp_path,
    )
    tsc = str(FOLDER / "node_modules" / ".bin" / "tsc")
    options = ("--strict", "--module", "nodenext", "--target", "es2022", "--lib", "es2022,dom")
    run(tsc, *options, "--types", "", "--typeRoots", str(tmp_path / "none"), "use.ts", cwd=tmp_path)
    assert run("node", "use.js", cwd=tmp_path).split() == ["22", "0", "function", "function"]
