"""Modules of the page, without a browser: the *.test.mjs beside this file."""

import shutil
from pathlib import Path

import pytest

from tests.programs import run_program

FOLDER = Path(__file__).parent


@pytest.mark.skipif(not shutil.which("node"), reason="needs node: apt-get install nodejs")
def test_their_own_tests_pass():
    files = sorted(FOLDER.glob("*.test.mjs"))
    said = run_program("node", "--test", "--test-reporter=tap", *files).stdout
    assert "# fail 0" in said and "# skipped 0" in said
