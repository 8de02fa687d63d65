"""The files of a page, sent compressed; browsers keep them until one of them changes."""

import gzip
import hashlib
import mimetypes
import os
import posixpath
import re
from functools import lru_cache
from pathlib import Path
from typing import Final

from starlette.datastructures import Headers
from starlette.responses import Response
from starlette.staticfiles import NotModifiedResponse, PathLike, StaticFiles
from starlette.types import Scope

COMPRESSIBLE: Final = (".js", ".css", ".html", ".json", ".svg")
KEPT: Final = "kept"
"""Folder of `kept/VERSION/`, which has every file as it is in that version."""
FOR_EVER: Final = "public, max-age=31536000, immutable"
LINK: Final = re.compile(r'\b(href|src)="(?=\w[^":]*")')
"""A link of a page to another of its files."""
PRELOAD: Final = re.compile(r'^ *<link rel="modulepreload" href="([^"]+)">\n', re.M)
IMPORT: Final = re.compile(r'^(?:import|export)\b[^;"]*"(\.[^"]+)";', re.M)
VENDOR: Final = "vendor"
"""Folder of scripts that import nothing."""


class PageFiles(StaticFiles):
    """A folder with an index.html whose links are rewritten to `kept/VERSION/`.

    A browser keeps those files without asking again. For the page itself, and for files requested
    by their plain names, it asks (ETag) before it uses them again. An edited file makes a new
    version. If the page preloads a module, the modules that it imports are preloaded too; otherwise
    a browser would find them one after the other.
    """

    def __init__(self, directory: Path) -> None:
        super().__init__(directory=directory, html=True, follow_symlink=True)
        self._folder = directory
        self._version = ""  # of the page that was sent last

    async def get_response(self, path: str, scope: Scope) -> Response:
        """Like StaticFiles, with Cache-Control."""
        parts = path.replace(os.sep, "/").split("/", 2)
        versioned = parts[0] == KEPT and len(parts) == 3
        response = await super().get_response(parts[2] if versioned else path, scope)
        # a page of another version gets the present files, and does not keep them
        kept = versioned and parts[1] == self._version and response.status_code < 400
        response.headers["cache-control"] = FOR_EVER if kept else "no-cache"
        return response

    def file_response(
        self, full_path: PathLike, stat_result: os.stat_result, scope: Scope, status_code: int = 200
    ) -> Response:
        """Like StaticFiles; text is compressed if the browser accepts that."""
        file, requested = Path(full_path), Headers(scope=scope)
        if file.suffix not in COMPRESSIBLE:
            return super().file_response(full_path, stat_result, scope, status_code)
        zipped = "gzip" in requested.get("accept-encoding", "")
        if file.name == "index.html":
            self._version = _version(self._folder)
            page = PRELOAD.sub(lambda link: _preloads(file.parent, link), file.read_text("utf-8"))
            content = LINK.sub(rf'\1="{KEPT}/{self._version}/', page).encode()
            content = gzip.compress(content) if zipped else content
            tag = f"{self._version}-{zipped:d}"
        else:
            content = _content(file, stat_result.st_mtime_ns, zipped)
            tag = f"{stat_result.st_mtime_ns:x}-{stat_result.st_size:x}-{zipped:d}"
        headers = {"etag": f'"{tag}"', "vary": "accept-encoding"}
        if zipped:
            headers["content-encoding"] = "gzip"
        kind = mimetypes.guess_type(file.name)[0]
        response = Response(content, status_code, headers, kind)
        if self.is_not_modified(response.headers, requested):
            return NotModifiedResponse(response.headers)
        return response


def _version(folder: Path) -> str:
    digest = hashlib.sha256()
    for inside, _, names in sorted(os.walk(folder, followlinks=True)):
        for name in sorted(names):
            changed = Path(inside, name).stat().st_mtime_ns
            digest.update(f"{inside} {name} {changed}\n".encode())
    return digest.hexdigest()[:16]


def _preloads(folder: Path, link: re.Match[str]) -> str:
    """The link to a module, and such links to all modules that it imports."""
    known = [link[1]]
    for name in known:  # grows
        if name.startswith(VENDOR):
            continue
        for found in IMPORT.findall((folder / name).read_text("utf-8")):
            imported = posixpath.normpath(posixpath.join(posixpath.dirname(name), found))
            if imported not in known:
                known.append(imported)
    return "".join(link[0].replace(link[1], name) for name in known)


@lru_cache(maxsize=256)
def _content(file: Path, changed: int, zipped: bool) -> bytes:
    """`changed` is the file's time, so that an edited file has another cache entry."""
    return gzip.compress(file.read_bytes()) if zipped else file.read_bytes()
