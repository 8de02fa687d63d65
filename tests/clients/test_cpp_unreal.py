"""The Unreal plug-in, compiled and run against stub headers: Unreal itself is missing."""

import json
import re
from pathlib import Path

from tests.clients import test_cpp
from tests.clients.test_cpp import ROOT, run

FOLDER = ROOT / "clients" / "unreal"
CORE = ROOT / "clients" / "cpp"
SOURCE = FOLDER / "Source"
pytestmark = test_cpp.pytestmark


def test_it_compiles_and_puts_bones_where_the_traces_have_them(tmp_path):
    """Each header of the engine is a file that includes the stubs."""
    sources = [*SOURCE.rglob("*.h"), *SOURCE.rglob("*.cpp")]
    own = {path.name for path in sources}
    included = {
        name
        for path in sources
        if path.name != "WayfarerCore.cpp"
        for name in re.findall(r'#include "([^"]+)"', path.read_text())
        if name not in own and not name.startswith("wayfarer/")
    }
    for name in included:
        stub = tmp_path / "engine" / name
        stub.parent.mkdir(parents=True, exist_ok=True)
        stub.write_text("" if name.endswith(".generated.h") else '#include "UnrealStubs.h"\n')
    assert "CoreMinimal.h" in included and "WayfarerSubsystem.generated.h" in included
    folders = [
        tmp_path / "engine",
        FOLDER / "tests",
        *(SOURCE / "Wayfarer" / part for part in ("Public", "Private")),
        CORE / "include",
        CORE / "src",
        CORE / "tests",
    ]
    # together, as by Unreal's build tool, except for the core, which must not see the engine
    code = [path for path in sources if path.suffix == ".cpp" and path.name != "WayfarerCore.cpp"]
    together = tmp_path / "together.cpp"
    together.write_text(
        "".join(f'#include "{path}"\n' for path in [*code, FOLDER / "tests" / "plugin.cpp"])
    )
    golden = f'-DGOLDEN_FOLDER="{ROOT / "tests" / "golden"}"'
    run(
        *("clang++", "-std=c++17", "-Wall", "-Wextra", "-Werror", "-Wno-unused-parameter", golden),
        *("-fsanitize=undefined,local-bounds", "-fsanitize-trap=all"),
        *(f"-I{folder}" for folder in folders),
        *(together, SOURCE / "WayfarerCore" / "Private" / "WayfarerCore.cpp"),
        CORE / "tests" / "golden.cpp",
        *("-o", tmp_path / "plugin"),
    )
    assert run(tmp_path / "plugin").splitlines()[-1] == "the plug-in holds"


def test_modules_are_those_of_the_descriptor():
    described = json.loads((FOLDER / "Wayfarer.uplugin").read_text())
    named = {module["Name"] for module in described["Modules"]}
    assert named == {path.name.partition(".")[0] for path in SOURCE.rglob("*.Build.cs")}
    for name in named:
        (module,) = re.findall(r"IMPLEMENT_MODULE\(\w+, (\w+)\)", _text(SOURCE / name))
        assert module == name


def test_the_core_is_whole():
    """The plug-in compiles every source of the core."""
    listed = re.findall(r'#include "(\w+\.cpp)"', _text(SOURCE / "WayfarerCore"))
    assert sorted(listed) == sorted(path.name for path in (CORE / "src").glob("*.cpp"))


def _text(folder: Path) -> str:
    return "".join(path.read_text() for path in sorted(folder.rglob("*.cpp")))
