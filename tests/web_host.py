"""A web host on this machine, beside the server: files for pages of other origins."""

import functools
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread


class Files(SimpleHTTPRequestHandler):
    """The files of a folder, without a log."""

    def log_message(self, *_: object) -> None:
        """Say nothing."""


@contextmanager
def web_host(folder: Path, files: type[Files] = Files, address: str = "127.0.0.1") -> Iterator[str]:
    """The URL of a host of a folder's files, without a final slash; it ends with the block."""
    handler = functools.partial(files, directory=str(folder))
    with ThreadingHTTPServer((address, 0), handler) as server:
        Thread(target=server.serve_forever, daemon=True).start()
        try:
            yield f"http://{address}:{server.server_port}"
        finally:
            server.shutdown()
