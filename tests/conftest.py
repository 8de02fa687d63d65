"""Settings of all tests: slow ones, ones that are tried twice, logging. Speed is never judged."""

import os
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")  # tests run side by side; torch reads it once

import pytest
from hypothesis import settings

import wayfarer  # noqa: F401  switches telemetry of the engines off before they are imported
from wayfarer.logs import configure_logging

settings.register_profile("steady", deadline=None)  # the machines are shared
settings.load_profile("steady")

# as the service logs; `caplog` reads it. structlog's default draws traces with all local variables
configure_logging("info", "json")

HERE = Path(__file__).parent
SLOW = (
    "integration",  # starts the real server
    "viewer",  # a browser
    "clients/test_examples.py",  # real servers
    "lab/evaluation/commands",  # whole tables, over the shipped model
    "lab/evaluation/maneuvers/test_run.py",
    "lab/training/test_export.py",  # traces and optimises whole graphs
    "lab/test_onnx_files.py",
    "lab/training/test_pose_graphs.py",
    "lab/training/test_predictor.py",
    "engines/test_openvino_engine.py",  # compiles networks
    "service/persistence/test_journal.py",  # kills servers
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
    "clients/test_web.py",
    "clients/test_web_local.py",
    "transport/test_reference.py",
)
"""Tests in a real browser, which are tried a second time; the summary lists them (`RERUN`).

Chromium without a graphics card shares two cores with another test, so its picture in a given
second depends on the machine. Playwright advises the same (`retries`). A test that is listed there
in two runs has a bug.
"""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Marks tests that take more than a second or two of a processor's time."""
    slow = [HERE / name for name in SLOW]
    if gone := [str(path) for path in slow if not path.exists()]:
        raise pytest.UsageError(f"{__file__} names tests that are no more: {', '.join(gone)}")
    browser = [HERE / name for name in BROWSER]
    for item in items:
        if any(item.path.is_relative_to(path) for path in browser):
            item.add_marker(pytest.mark.flaky(reruns=1))
        fixtures = SLOW_FIXTURES.intersection(getattr(item, "fixturenames", ()))
        if fixtures or any(item.path.is_relative_to(path) for path in slow):
            item.add_marker(pytest.mark.slow)


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Show why tests were tried again."""
    for report in terminalreporter.stats.get("rerun", ()):
        terminalreporter.write_sep("_", f"tried again: {report.nodeid}")
        terminalreporter.write_line(report.longreprtext)
