"""The people of a server as a model of MMCP.

python -m wayfarer_client.mmcp [address] [--host 127.0.0.1] [--port 8000] [--tls]
"""

import argparse
import asyncio
import contextlib
import os
import sys

from wayfarer_client.errors import WayfarerError


def main() -> None:
    """Answers until Ctrl-C."""
    parser = argparse.ArgumentParser(
        "wayfarer_client.mmcp",
        description="The people of a server as a model of MMCP. An API key for the server is taken "
        "from WAYFARER_API_KEY. Whoever reaches this port uses it.",
    )
    parser.add_argument("address", nargs="?", default="localhost:50051", help="of the server: gRPC")
    parser.add_argument("--host", default="127.0.0.1", help="where it listens; 0.0.0.0: everywhere")
    parser.add_argument("--port", type=int, default=8000, help="where it listens; 0: any free one")
    parser.add_argument("--tls", action="store_true", help="call the server over TLS")
    given = parser.parse_args()
    try:
        from wayfarer_client.mmcp.server import serve
    except ModuleNotFoundError as error:
        sys.exit(f"no module {error.name!r}; it comes with pip install 'wayfarer-client[mmcp]'")
    key = os.environ.get("WAYFARER_API_KEY", "")
    try:
        asyncio.run(serve(given.address, given.host, given.port, key, given.tls))
    except WayfarerError as error:
        sys.exit(str(error))


if __name__ == "__main__":
    with contextlib.suppress(KeyboardInterrupt):
        main()
