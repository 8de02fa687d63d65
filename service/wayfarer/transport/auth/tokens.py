"""JSON Web Tokens of one issuer, checked against its public keys (JWKS)."""

import asyncio
import contextlib
import json
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, Final

import jwt
import structlog

from wayfarer.errors import InvalidArgument, Unauthenticated, Unavailable
from wayfarer.transport.edge.caller import Caller, Scope

log = structlog.get_logger(__name__)

FRESH_S: Final = 300.0
"""Seconds after which keys are fetched again; the old ones stay valid until that succeeds."""

PAUSE_S: Final = 30.0
"""Minimum seconds between fetches, however many tokens name unknown keys."""

FETCH_TIMEOUT_S: Final = 5.0
NAME_LENGTH: Final = 128

_REASONS: Final[tuple[tuple[type[Exception], str], ...]] = (
    (jwt.ExpiredSignatureError, "has expired"),
    (jwt.ImmatureSignatureError, "is not valid yet"),
    (jwt.InvalidAudienceError, "is for another audience"),
    (jwt.InvalidIssuerError, "is of another issuer"),
    (jwt.MissingRequiredClaimError, "lacks one of the claims exp, iss, aud, sub"),
    (jwt.InvalidAlgorithmError, "is signed with an algorithm that is not allowed here"),
    (jwt.InvalidSignatureError, "has a signature that does not hold"),
)
"""Reasons in our own words, since the library's may quote the token."""


class IssuerKeys:
    """The public keys of an issuer by `kid`; fetched off the event loop, one fetch at a time."""

    def __init__(
        self, fetch: Callable[[], dict[str, Any]], clock: Callable[[], float] = time.monotonic
    ) -> None:
        """`fetch` returns a JWKS document and may block. `clock` gives seconds."""
        self._fetch = fetch
        self._clock = clock
        self._keys: dict[str, jwt.PyJWK] = {}
        self._tried_at = float("-inf")
        self._got_at = float("-inf")
        self._fetching: asyncio.Task[None] | None = None
        # a separate thread: an issuer that does not answer must not hold up other work
        self._thread = ThreadPoolExecutor(1, "jwks")

    @classmethod
    def of(cls, source: str) -> "IssuerKeys":
        """The keys of a file, read at once, or of an https:// URL. Raises InvalidArgument."""
        if source.startswith("https://"):
            client = jwt.PyJWKClient(source, cache_jwk_set=False, timeout=FETCH_TIMEOUT_S)
            return cls(client.fetch_data)
        read = lambda: json.loads(Path(source).read_text("utf-8"))  # noqa: E731
        try:
            _parsed(read())
        except (OSError, ValueError, jwt.PyJWTError) as error:
            raise InvalidArgument(f"auth.jwt_keys: {source}: {error}", "auth.jwt_keys") from None
        return cls(read)

    async def find(self, kid: str) -> jwt.PyJWK:
        """Returns the key. Raises Unauthenticated; Unavailable if no keys were ever fetched."""
        now = self._clock()
        if now - self._got_at > FRESH_S or kid not in self._keys:
            fetching = self._refresh(now)
            if fetching and kid not in self._keys:
                await asyncio.shield(fetching)
        if kid in self._keys:
            return self._keys[kid]
        if self._got_at == float("-inf"):
            raise Unavailable("the keys of the token issuer cannot be had; try again")
        raise Unauthenticated("the token is signed with a key that its issuer does not have")

    def _refresh(self, now: float) -> asyncio.Task[None] | None:
        """Returns the fetch in progress, or starts one unless the last was just now."""
        if self._fetching and not self._fetching.done():
            return self._fetching
        if now - self._tried_at < PAUSE_S:
            return None
        self._tried_at = now
        self._fetching = asyncio.create_task(self._load(), name="jwks")
        return self._fetching

    async def _load(self) -> None:
        loop = asyncio.get_running_loop()
        try:
            self._keys = _parsed(await loop.run_in_executor(self._thread, self._fetch))
            self._got_at = self._clock()
        except (OSError, ValueError, jwt.PyJWTError) as error:
            log.warning("keys of the token issuer not fetched", error=str(error))


class TokenCheck:
    """The conditions under which a token identifies a caller."""

    def __init__(
        self,
        keys: IssuerKeys,
        issuer: str,
        audience: str,
        algorithms: tuple[str, ...],
        leeway_s: float,
    ) -> None:
        """`algorithms`: public-key algorithms only."""
        self._keys = keys
        self._claims: dict[str, Any] = {
            "issuer": issuer,
            "audience": audience,
            "algorithms": list(algorithms),
            "leeway": leeway_s,
            "options": {"require": ["exp", "iss", "aud", "sub"]},
        }

    async def caller(self, token: str) -> Caller:
        """Returns the owner of a token. Raises Unauthenticated, Unavailable."""
        try:
            kid = jwt.get_unverified_header(token).get("kid")
            if not isinstance(kid, str):
                raise Unauthenticated("the token's header names no key (kid)")
            key = await self._keys.find(kid)
            claims = jwt.decode(token, key, **self._claims)
        except (jwt.PyJWTError, ValueError, TypeError) as error:
            why = next((text for kind, text in _REASONS if isinstance(error, kind)), "is malformed")
            raise Unauthenticated(f"the token {why}") from None
        subject = str(claims["sub"])
        if not 0 < len(subject) <= NAME_LENGTH or not subject.isprintable():
            raise Unauthenticated(f"the token's sub is not a name of 1 to {NAME_LENGTH} characters")
        return Caller("jwt:" + subject, _scopes(claims))


def _scopes(claims: dict[str, Any]) -> frozenset[Scope]:
    """Scopes in `scope` ("read control") or `scp` (a list); those of other services are ignored."""
    found = claims.get("scope", claims.get("scp", ""))
    names = found.split() if isinstance(found, str) else found if isinstance(found, list) else []
    scopes = set()
    for name in names:
        with contextlib.suppress(ValueError):
            scopes.add(Scope(name))
    return frozenset(scopes)


def _parsed(document: dict[str, Any]) -> dict[str, jwt.PyJWK]:
    """Public keys by name. Raises ValueError or PyJWTError if there are none."""
    try:
        keys = jwt.PyJWKSet.from_dict(document).keys
    except (AttributeError, KeyError, TypeError):  # the library does not check their shape
        raise ValueError("it is no JWKS document") from None
    found = {
        key.key_id: key
        for key in keys
        if key.key_id and key.public_key_use in ("sig", None) and key.key_type != "oct"
    }
    if not found:
        raise ValueError("it holds no public key that has a 'kid'")
    return found
