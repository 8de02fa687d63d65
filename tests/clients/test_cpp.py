"""The C++ client: its own tests under two compilers, and its use by a user."""

import contextlib
import os
import re
import select
import shutil
import socket
import ssl
import threading
from pathlib import Path
from urllib.parse import urlsplit

import pytest

from tests.certificates import Authority
from tests.programs import run_program

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "clients" / "cpp"
LIBRARIES = {
    "doctest-dev": "/usr/include/doctest/doctest.h",
    "nlohmann-json3-dev": "/usr/include/nlohmann/json.hpp",
    "libboost-dev": "/usr/include/boost/beast.hpp",
    "libssl-dev": "/usr/include/openssl/ssl.h",
}
QUICK = (
    ("CMAKE_BUILD_TYPE", "Debug"),
    ("CMAKE_CXX_FLAGS_DEBUG", ""),
    ("CMAKE_UNITY_BUILD", "ON"),  # test_cpp_offline.py compiles each file on its own
    ("CMAKE_UNITY_BUILD_BATCH_SIZE", "0"),
    ("WAYFARER_TESTS", "ON"),
)
SANITIZED = (
    *QUICK,
    ("CMAKE_CXX_COMPILER", "g++"),
    ("CMAKE_C_COMPILER", "gcc"),
    ("WAYFARER_SANITIZE", "ON"),
    ("WAYFARER_SESSION", "OFF"),  # clang compiles Boost.Beast, which costs most, in half the time
    ("WAYFARER_LOCAL", "OFF"),  # which test_cpp_offline.py compiles by gcc, and runs
)
README = (FOLDER / "README.md").read_text(encoding="utf-8")
PAGE = README.partition("## Five minutes")[2].partition("\n## ")[0]
INSTALL, USE = re.findall(r"```sh\n(.*?)```", PAGE, re.S)

missing = [tool for tool in ("cmake", "ninja", "g++", "clang++") if not shutil.which(tool)]
missing += [name for name, header in LIBRARIES.items() if not Path(header).exists()]
pytestmark = pytest.mark.skipif(
    bool(missing),
    reason=f"needs {', '.join(missing)}: apt-get install cmake ninja-build g++ clang "
    + " ".join(LIBRARIES),
)


def run(*command: object, cwd: Path = FOLDER, **environment: str) -> str:
    told = {**os.environ, **environment}
    return run_program(*command, cwd=cwd, env=told, timeout=900).stdout


def sanitized() -> Path:
    """The tests of the core by gcc, in a folder that is kept: nothing is compiled twice."""
    folder = ROOT / "build" / "cpp-gcc"
    settings = [f"-D{name}={value}" for name, value in SANITIZED]
    run("cmake", "-S", FOLDER, "-B", folder, "-G", "Ninja", *settings)
    run("cmake", "--build", folder, "--parallel", os.cpu_count() or 1)
    return folder


@pytest.fixture(scope="module")
def environment() -> dict[str, str]:
    """Variables for the readme's build, in a folder that is kept: clang, no optimizer, tests."""
    folder = ROOT / "build" / "cpp-clang"
    folder.mkdir(parents=True, exist_ok=True)
    quick = folder / "quick.cmake"
    text = "".join(f'set({name} "{value}" CACHE STRING "")\n' for name, value in QUICK)
    if not quick.exists() or quick.read_text() != text:
        quick.write_text(text)
    return {
        "HOME": str(folder),
        "CC": "clang",
        "CXX": "clang++",
        "CMAKE_GENERATOR": "Ninja",
        "CMAKE_TOOLCHAIN_FILE": str(quick),
    }


@pytest.fixture(scope="module")
def installed(environment) -> Path:
    """All that there is, built and installed by the readme's commands as printed."""
    clone = Path(environment["HOME"])
    if not (clone / "clients").exists():
        (clone / "clients").symlink_to(ROOT / "clients")
    run("sh", "-ec", INSTALL, cwd=clone, **environment)
    return clone / "build" / "wayfarer"


@pytest.mark.parametrize("compiler", ["g++", "clang++"])
def test_its_own_tests_pass(compiler, request):
    """Golden vectors and traces, messages, malformed bytes, the C ABI; warnings are errors."""
    folder = sanitized() if compiler == "g++" else request.getfixturevalue("installed")
    said = run("ctest", "--test-dir", folder, "--output-on-failure")
    assert "100% tests passed" in said and "core" in said and "fuzz" in said
    assert ("allocation" in said) == (compiler == "clang++")


class Relay:
    """Speaks TLS to a client and forwards everything to a server; breaks the first stream."""

    def __init__(self, server: str, folder: Path) -> None:
        authority = Authority(folder)
        self.trusted = authority.path
        self._tls = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        self._tls.load_cert_chain(*authority.issue("relay"))
        self._server = (urlsplit(server).hostname, urlsplit(server).port)
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.url = f"https://localhost:{self._listener.getsockname()[1]}"
        self.cut = False
        threading.Thread(target=self._accept, daemon=True).start()

    def close(self) -> None:
        self._listener.close()

    def _accept(self) -> None:
        with contextlib.suppress(OSError):  # closed
            while True:
                threading.Thread(
                    target=self._serve, args=(self._listener.accept()[0],), daemon=True
                ).start()

    def _serve(self, raw: socket.socket) -> None:
        with (
            contextlib.suppress(OSError),
            self._tls.wrap_socket(raw, server_side=True) as near,
            socket.create_connection(self._server) as far,
        ):
            request = near.recv(65536)
            far.sendall(request)
            once = request.startswith(b"GET /v1/stream") and not self.cut
            self.cut = self.cut or once
            left = 12_000 if once else 1 << 60  # bytes: some two seconds of motion
            while left > 0 and (ready := select.select([near, far], [], [], 30)[0]):
                for end in ready:
                    data = end.recv(65536)
                    if not data:
                        return
                    (far if end is near else near).sendall(data)
                    left -= len(data)


def walked(said: str) -> list[str]:
    return [line.partition(":")[0] for line in said.splitlines() if ": walked to " in line]


def test_an_agent_walks_to_its_goal_through_an_entry_though_its_node_is_drained(installed, cluster):
    live = installed / "tests" / "live"
    with cluster.drained_meanwhile():
        said = run(live, cluster.url, "lost")
    assert walked(said) == ["a_pose", "centimetres", "vrm1"]


def test_over_https_and_a_lost_connection_nothing_is_missing(installed, real_server, tmp_path):
    live = installed / "tests" / "live"
    relay = Relay(real_server.url, tmp_path)
    try:
        said = run(live, relay.url, "lost", SSL_CERT_FILE=str(relay.trusted))
        assert len(walked(said)) == 3 and "lost: " in said and relay.cut
        other = Authority(tmp_path / "evil").path
        told = {**os.environ, "SSL_CERT_FILE": str(other)}
        refused = run_program(live, relay.url, code=1, env=told)
        assert "certificate verify failed" in refused.stderr
    finally:
        relay.close()


@pytest.mark.slow
def test_an_empty_project_uses_it_by_the_readme_alone(
    installed, environment, real_server, tmp_path
):
    """Its commands and files as printed."""
    assert installed.is_dir()
    (cmake,) = re.findall(r"```cmake\n(.*?)```", PAGE, re.S)
    (code,) = re.findall(r"```cpp\n(.*?)```", PAGE, re.S)
    (tmp_path / "CMakeLists.txt").write_text(cmake)
    (tmp_path / "main.cpp").write_text(code)
    command = f"{USE.rstrip()} {real_server.url}"
    said = run("sh", "-ec", command, cwd=tmp_path, **environment).splitlines()
    assert said[-1] == "arrived"
    x, z = map(float, re.findall(r"-?[0-9.]+", said[-2]))
    assert abs(x - 2) < 0.5 and abs(z - 3) < 0.5


@pytest.mark.slow
def test_a_project_has_the_core_as_a_part(tmp_path):
    """By FetchContent, from a folder; nothing of it is installed with the project."""
    (tmp_path / "CMakeLists.txt").write_text(
        "cmake_minimum_required(VERSION 3.16)\nproject(part LANGUAGES CXX)\n"
        "include(FetchContent)\nset(WAYFARER_SESSION OFF)\nset(WAYFARER_LOCAL OFF)\n"
        f'FetchContent_Declare(wayfarer SOURCE_DIR "{FOLDER}")\n'
        "FetchContent_MakeAvailable(wayfarer)\nadd_executable(part main.cpp)\n"
        "target_link_libraries(part PRIVATE wayfarer::wayfarer)\n"
    )
    (tmp_path / "main.cpp").write_text(
        "#include <cstdio>\n#include <wayfarer/core.hpp>\n#include <wayfarer/wayfarer.h>\n"
        "int main() { wayfarer::MotionPlayer player; player.advance(0);\n"
        '  std::printf("%s %zu", wf_version(), wayfarer::BONES.size()); }\n'
    )
    quick = ("-DCMAKE_CXX_COMPILER=clang++", "-DCMAKE_UNITY_BUILD=ON")
    run("cmake", "-S", tmp_path, "-B", tmp_path / "build", "-G", "Ninja", *quick)
    run("cmake", "--build", tmp_path / "build")
    assert run(tmp_path / "build" / "part") == "0.2.0 22"
    assert not run("cmake", "--install", tmp_path / "build", "--prefix", tmp_path / "out").count(
        "wayfarer"
    )
