"""Settings of all tests: slow ones, ones that are tried twice, logging. Speed is never judged.

Tests that share an expensive server, browser or export also share a worker.
"""

import os
import sys
from functools import cache
from pathlib import Path
from typing import NamedTuple

os.environ.setdefault("OMP_NUM_THREADS", "1")  # tests run side by side; torch reads it once

import pytest
from hypothesis import settings
from xdist.scheduler import LoadFileScheduling

import wayfarer  # noqa: F401  switches telemetry of the engines off before they are imported
from tests.programs import run_program
from wayfarer.process.logs import configure_logging

settings.register_profile("steady", deadline=None)  # the machines are shared
settings.load_profile("steady")

# as the service logs; `caplog` reads it. structlog's default draws traces with all local variables
configure_logging("info", "json")

HERE = Path(__file__).parent
SLOW = (
    "integration",  # starts the real server
    "viewer",  # a browser
    "clients/test_examples.py",  # real servers
    "clients/test_page_cluster.py",
    "lab/evaluation/commands",  # whole tables, over the shipped model
    "lab/evaluation/maneuvers/test_run.py",
    "lab/training/test_export.py",  # traces and optimises whole graphs
    "lab/test_onnx_files.py",
    "lab/training/test_pose_graphs.py",
    "lab/training/test_predictor.py",
    "engines/test_openvino_engine.py",  # compiles networks
    "runtime/persistence/test_journal.py",  # kills servers
    "transport/test_reference.py",  # a browser
    "world/behaviours",  # minutes of a crowd's time
    "world/scenes/test_bake_queue.py",  # processes that hang, and are killed
    "world/scenes/test_populate.py",
    "world/scenes/test_world_scenes.py",
)
"""Folders and files of tests that get the mark `slow`, in addition to tests that carry it."""

SLOW_FIXTURES = frozenset({"real_server"})

BROWSER = (
    "viewer",
    "clients/test_page_cluster.py",
    "clients/test_web.py",
    "clients/test_web_local.py",
    "transport/test_reference.py",
)
"""Tests in a real browser, which are tried a second time; the summary lists them (`RERUN`).

Chromium without a graphics card shares two cores with another test, so its picture in a given
second depends on the machine. Playwright advises the same (`retries`). A test that is listed there
in two runs has a bug.
"""

ONE_WORKER = {
    "tests/viewer/": "viewer",  # a browser and its server
    "tests/clients/test_cpp.py": "clients",  # a server and a cluster
    "tests/clients/test_examples.py": "clients",
    "tests/clients/test_files.py": "clients",
    "tests/clients/test_fit.py": "clients",
    "tests/clients/test_godot.py": "clients",
    "tests/clients/test_mmcp.py": "clients",
    "tests/clients/test_page_cluster.py": "clients",
    "tests/clients/test_unity.py": "clients",
    "tests/clients/test_web.py": "clients",
    "tests/clients/test_cpp_offline.py": "local",  # an export and a trace
    "tests/clients/test_web_local.py": "local",
    "tests/lab/engine_export/test_export.py": "local",
}
"""Beginnings of the ids of tests that run in one worker, with its group's name.

They begin first, so that they do not run alone at the end.
"""


def group(nodeid: str) -> str | None:
    """The group of a test; None: its file is its group."""
    return next((name for start, name in ONE_WORKER.items() if nodeid.startswith(start)), None)


class Groups(LoadFileScheduling):
    """`--dist loadfile`, with the files of a group as one."""

    def _split_scope(self, nodeid: str) -> str:
        return group(nodeid) or super()._split_scope(nodeid)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: object) -> Groups | None:
    """Where files are dealt out."""
    return Groups(config, log) if config.getvalue("dist") == "loadfile" else None


class Exported(NamedTuple):
    """The folder that a command has written, and what it printed."""

    folder: Path
    said: str


@pytest.fixture(scope="session")
def engines_export(tmp_path_factory: pytest.TempPathFactory) -> Exported:
    """`wayfarer export --for engines` as its user runs it, where onnx is installed, not torch."""
    pytest.importorskip("onnx", reason="needs onnx: pip install './lab[engines]'")
    out = tmp_path_factory.mktemp("engines") / "made"
    command = (
        "import sys; sys.modules['torch'] = None; from wayfarer.commands.cli import main; "
        "sys.argv[0] = 'wayfarer'; main()"
    )
    words = ("export", "--for", "engines", "--out", out)
    return Exported(out, run_program(sys.executable, "-c", command, *words).stdout)


@cache
def lies_in(path: Path, names: tuple[str, ...]) -> bool:
    """Whether a file is one of these, or in one of these folders. Asked once for each file: for
    each test it was a quarter of the time to collect them.
    """
    return any(path.is_relative_to(HERE / name) for name in names)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Puts groups first, and marks tests that take more than a second or two of processor time."""
    items.sort(key=lambda item: group(item.nodeid) is None)
    if gone := [name for name in SLOW if not (HERE / name).exists()]:
        raise pytest.UsageError(f"{__file__} names tests that are no more: {', '.join(gone)}")
    for item in items:
        if lies_in(item.path, BROWSER):
            item.add_marker(pytest.mark.flaky(reruns=1))
        fixtures = SLOW_FIXTURES.intersection(getattr(item, "fixturenames", ()))
        if fixtures or lies_in(item.path, SLOW):
            item.add_marker(pytest.mark.slow)


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Show why tests were tried again."""
    for report in terminalreporter.stats.get("rerun", ()):
        terminalreporter.write_sep("_", f"tried again: {report.nodeid}")
        terminalreporter.write_line(report.longreprtext)
