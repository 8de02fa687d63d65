"""API keys: random texts of which the server stores only the SHA-256, in a TOML file.

    [keys.studio]
    sha256 = "9f86d0…"                 # of the key; `wayfarer keys new studio` makes both
    scopes = ["read", "control"]
    [keys.studio.quota]                # all optional; otherwise the server's limits apply
    agents = 16

The file is read again when it changes, and on SIGHUP. A bad file is logged, and the previous keys
stay valid.
"""

import hmac
import secrets
import time
import tomllib
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path
from typing import Annotated, Final

import structlog
from pydantic import BaseModel, ConfigDict, Field, StringConstraints, ValidationError

from wayfarer.errors import InvalidArgument, Unauthenticated
from wayfarer.transport.edge.caller import Caller, Quota, Scope

log = structlog.get_logger(__name__)

KEY_PREFIX: Final = "wf_"
POLL_S: Final = 1.0
"""Seconds between checks for changes of the file."""

Name = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9][A-Za-z0-9._@-]{0,63}$")]


class _Quota(BaseModel):
    model_config = ConfigDict(extra="forbid")
    sessions: Annotated[int, Field(ge=0)] | None = None
    agents: Annotated[int, Field(ge=0)] | None = None
    streams: Annotated[int, Field(ge=0)] | None = None
    calls_per_second: Annotated[int, Field(ge=1)] | None = None


class _Entry(BaseModel):
    model_config = ConfigDict(extra="forbid")
    sha256: Annotated[str, StringConstraints(pattern=r"^[0-9a-f]{64}$")]
    scopes: Annotated[list[Scope], Field(min_length=1)]
    quota: _Quota = _Quota()


class _File(BaseModel):
    model_config = ConfigDict(extra="forbid")
    keys: Annotated[dict[Name, _Entry], Field(max_length=1000)] = {}


class KeyFile:
    """The keys of a file. `clock` returns seconds; it need not be the time of day."""

    def __init__(self, path: Path, clock: Callable[[], float] = time.monotonic) -> None:
        """Raises InvalidArgument that names the entry at fault."""
        self._path = path
        self._clock = clock
        self._looked_at = clock()
        self._mark = _mark(path)
        self._known = read_keys(path)

    def caller(self, key: str) -> Caller:
        """Returns the owner of a key. Raises Unauthenticated."""
        self._look()
        digest = sha256(key.encode()).digest()
        found = None
        for caller in self._known:  # always all of them, so that the time taken reveals nothing
            if hmac.compare_digest(caller.key, digest):
                found = caller
        if found is None:
            raise Unauthenticated("unknown API key: it was mistyped, or taken out of the keys file")
        return found

    def is_good(self, caller: Caller) -> bool:
        """Whether the key of a caller from this file is still valid, with the same rights."""
        self._look()
        return any(
            known.key == caller.key and known.name == caller.name and known.scopes >= caller.scopes
            for known in self._known
        )

    def reload(self) -> None:
        """Reads the file again."""
        self._mark = _mark(self._path)
        try:
            self._known = read_keys(self._path)
        except InvalidArgument as error:
            log.error("keys file not taken; the keys read before stay good", error=str(error))
        else:
            log.info("keys read", keys=len(self._known))

    def _look(self) -> None:
        now = self._clock()
        if now - self._looked_at >= POLL_S:
            self._looked_at = now
            if _mark(self._path) != self._mark:
                self.reload()


def read_keys(path: Path) -> list[Caller]:
    """Reads the caller of each key. Raises InvalidArgument."""
    where = f"keys file {path}"
    try:
        content = _File.model_validate(tomllib.loads(path.read_text("utf-8")))
    except OSError as error:
        raise InvalidArgument(f"{where}: {error.strerror}", "auth.keys_file") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InvalidArgument(f"{where} is not TOML: {error}", "auth.keys_file") from None
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        place = ".".join(str(part) for part in first["loc"])
        raise InvalidArgument(f"{where}: {place}: {first['msg']}", "auth.keys_file") from None
    return [
        Caller(
            "key:" + name,
            frozenset(entry.scopes),
            Quota(**entry.quota.model_dump()),
            bytes.fromhex(entry.sha256),
        )
        for name, entry in content.keys.items()
    ]


def new_key() -> tuple[str, str]:
    """A new key of 256 random bits, and its SHA-256 in hexadecimal."""
    key = KEY_PREFIX + secrets.token_urlsafe(32)
    return key, sha256(key.encode()).hexdigest()


def _mark(path: Path) -> tuple[int, int, int] | None:
    """A value that changes when the file does."""
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_mtime_ns, found.st_size, found.st_ino
