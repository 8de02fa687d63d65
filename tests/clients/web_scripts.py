"""Scripts of the web client, in Node."""

from pathlib import Path

from tests.programs import run_program

FOLDER = Path(__file__).parents[2] / "clients" / "web"


def node(script: str, *words: object) -> str:
    """Output of clients/web/test/`script` with these words. Raises AssertionError if it fails."""
    return run_program("node", FOLDER / "test" / script, *words, cwd=FOLDER).stdout
