"""schemathesis with all its checks against a separate server.

    python -m benchmarks.openapi --examples 20 --seed 1

Ends with 1 when it finds anything, or when the server logs an error. See tests/fuzz/openapi.py.
"""

import argparse
import asyncio
import sys
import tempfile
from pathlib import Path

from tests.fuzz.openapi import SETTINGS, schemathesis
from tests.serving import Service


async def main() -> int:
    """Runs it; returns 0 if all is well."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--examples", type=int, default=20, help="per operation and phase")
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as name, Service(settings=SETTINGS) as server:
        outcome = await schemathesis(server.url, asked.examples, asked.seed, Path(name))
        errors = server.errors
    print(outcome.text)
    print(f"{outcome.cases} cases, {outcome.failures} failures, {len(errors)} errors logged")
    for error in errors[:10]:
        print(error)
    return 1 if outcome.failures or outcome.errors or errors else 0


if __name__ == "__main__":
    sys.exit(asyncio.run(main()))
