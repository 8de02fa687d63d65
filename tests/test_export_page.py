"""Commands of docs/export.md and docs/faq.md do what they say."""

import re
import shlex
from pathlib import Path

import pytest
from typer.testing import CliRunner

from wayfarer.commands.cli import app

DOCS = Path(__file__).parent.parent / "docs"
PAGE = (DOCS / "export.md").read_text("utf-8")
COMMANDS = [
    shlex.split(line.partition(" #")[0])[1:]
    for block in re.findall(r"```bash\n(.*?)```", PAGE, re.DOTALL)
    for line in block.splitlines()
    if line.startswith("wayfarer ")
]
BEGINS = {".glb": b"glTF", ".vrma": b"glTF", ".bvh": b"HIERARCHY", ".npz": b"PK"}


def test_there_are_commands():
    assert len(COMMANDS) >= 7


@pytest.mark.slow
@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: command[1])
def test_each_command_writes_its_file(command, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result = CliRunner().invoke(app, [*command, "--threads", "1"])
    assert result.exit_code == 0, result.output
    made = tmp_path / command[1]
    assert made.read_bytes().startswith(BEGINS[made.suffix])


@pytest.mark.parametrize("page", ["export.md", "faq.md"])
def test_links_lead_somewhere(page):
    for target in re.findall(r"\]\(([^)#]*)(?:#[^)]*)?\)", (DOCS / page).read_text("utf-8")):
        assert target.startswith("http") or not target or (DOCS / target).exists(), target
