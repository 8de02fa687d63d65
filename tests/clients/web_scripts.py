"""Scripts of the web client, in Node."""

import subprocess
from pathlib import Path

FOLDER = Path(__file__).parents[2] / "clients" / "web"


def node(script: str, *words: object) -> str:
    """Output of clients/web/test/`script` with these words. Raises AssertionError if it fails."""
    command = ["node", FOLDER / "test" / script, *words]
    done = subprocess.run(
        list(map(str, command)), cwd=FOLDER, capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout
