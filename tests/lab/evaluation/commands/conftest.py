"""Commands of `wayfarer eval` as a test calls them."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from typer.testing import CliRunner

from wayfarer_lab.evaluation.commands import app

Evaluate = Callable[..., dict]


@pytest.fixture
def evaluate(tmp_path: Path) -> Evaluate:
    """Runs a command that succeeds; the content of the table that it writes, `out/table.json`."""

    def run(*arguments: str) -> dict:
        path = tmp_path / "out" / "table.json"
        answer = CliRunner().invoke(app, [*arguments, "--json", str(path)])
        assert answer.exit_code == 0, answer.output
        return json.loads(path.read_text())

    return run
