"""Modules of the page, without a browser: tests/viewer/*.test.mjs."""

import shutil
from pathlib import Path

import pytest

from tests.programs import run_program

FOLDER = Path(__file__).parent / "viewer"


@pytest.mark.skipif(not shutil.which("node"), reason="needs node: apt-get install nodejs")
def test_their_own_tests_pass():
    said = run_program("node", "--test", *sorted(FOLDER.glob("*.test.mjs"))).stdout
    assert "# fail 0" in said and "# skipped 0" in said
