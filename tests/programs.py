"""Programs that tests run to their end."""

import subprocess
from typing import Any


def run_program(
    *words: object, code: int = 0, timeout: float = 300, **options: Any
) -> subprocess.CompletedProcess[str]:
    """The output of a program. Raises AssertionError if it ends with another code."""
    command = [str(word) for word in words]
    done = subprocess.run(command, capture_output=True, text=True, timeout=timeout, **options)
    assert done.returncode == code, done.stdout + done.stderr
    return done
