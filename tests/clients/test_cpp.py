"""The C++ client: its own tests under two compilers, and what a user gets of it."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "clients" / "cpp"
LIBRARIES = {
    "doctest-dev": "/usr/include/doctest/doctest.h",
    "nlohmann-json3-dev": "/usr/include/nlohmann/json.hpp",
    "libboost-dev": "/usr/include/boost/beast.hpp",
}
BUILDS = {
    "g++": ("gcc", "-DCMAKE_BUILD_TYPE=Debug", "-DWAYFARER_SANITIZE=ON"),
    "clang++": ("clang", "-DCMAKE_BUILD_TYPE=Release"),
}

missing = [tool for tool in ("cmake", "ninja", "g++", "clang++") if not shutil.which(tool)]
missing += [name for name, header in LIBRARIES.items() if not Path(header).exists()]
pytestmark = pytest.mark.skipif(
    bool(missing),
    reason=f"needs {', '.join(missing)}: apt-get install cmake ninja-build g++ clang "
    + " ".join(LIBRARIES),
)


def run(*command: object, cwd: Path = FOLDER) -> str:
    done = subprocess.run(
        [str(word) for word in command], cwd=cwd, capture_output=True, text=True, timeout=900
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def build(compiler: str, *options: str) -> Path:
    """The tests, in a folder that is kept: nothing is compiled twice."""
    c, *settings = BUILDS[compiler]
    folder = ROOT / "build" / f"cpp-{c}"
    settings += [f"-DCMAKE_CXX_COMPILER={compiler}", f"-DCMAKE_C_COMPILER={c}"]
    run("cmake", "-S", FOLDER, "-B", folder, "-G", "Ninja", "-DWAYFARER_TESTS=ON", *settings)
    run("cmake", "--build", folder, "--parallel", os.cpu_count() or 1)
    return folder


@pytest.mark.parametrize("compiler", BUILDS)
def test_its_own_tests_pass(compiler):
    """Golden vectors and traces, messages, malformed bytes, the C ABI; warnings are errors."""
    folder = build(compiler)
    said = run("ctest", "--test-dir", folder, "--output-on-failure")
    assert "100% tests passed" in said and "core" in said and "fuzz" in said
    assert ("allocation" in said) == (compiler == "clang++")
