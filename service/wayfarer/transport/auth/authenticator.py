"""The one place that decides who a caller is."""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from wayfarer.config.settings import Settings
from wayfarer.errors import Unauthenticated
from wayfarer.transport.auth.keys import KEY_PREFIX, KeyFile
from wayfarer.transport.edge.caller import LOCAL, Caller, Scope

if TYPE_CHECKING:
    from wayfarer.transport.auth.tokens import TokenCheck

MAX_BYTES = 8192
"""Maximum length of a key or token in characters; longer ones are refused unread."""


@dataclass(frozen=True, slots=True)
class Credentials:
    """The credentials of a call."""

    bearer: str = field(default="", repr=False)  # key or JWT of `authorization: Bearer …`
    api_key: str = field(default="", repr=False)  # of `x-api-key`
    certificate: str = ""  # common name of the verified client certificate; no secret


class Authenticator:
    """Identifies callers by API key, JWT or client certificate, whichever are configured."""

    def __init__(
        self,
        keys: KeyFile | None = None,
        tokens: "TokenCheck | None" = None,
        certificate_scopes: frozenset[Scope] | None = None,
    ) -> None:
        """`certificate_scopes`: None if the server asks for no client certificates."""
        self._keys = keys
        self._tokens = tokens
        self._certificate_scopes = certificate_scopes

    @classmethod
    def from_settings(cls, settings: Settings) -> "Authenticator":
        """Reads the files that the settings name. Raises InvalidArgument with the line at fault."""
        auth = settings.auth
        tokens = None
        if auth.jwt_keys:
            # 10 MB, which a server without tokens does not need
            from wayfarer.transport.auth.tokens import IssuerKeys, TokenCheck

            issuer = IssuerKeys.of(auth.jwt_keys)
            tokens = TokenCheck(
                issuer, auth.jwt_issuer, auth.jwt_audience, auth.jwt_algorithms, auth.jwt_leeway_s
            )
        return cls(
            KeyFile(auth.keys_file) if auth.keys_file else None,
            tokens,
            frozenset(map(Scope, auth.certificate_scopes)) if settings.tls_client_ca else None,
        )

    @property
    def is_open(self) -> bool:
        """Whether the server asks for no credentials."""
        return self._keys is None and self._tokens is None and self._certificate_scopes is None

    def reload(self) -> None:
        """Reads the keys again, even if the file seems unchanged. A bad file changes nothing."""
        if self._keys:
            self._keys.reload()

    async def caller(self, shown: Credentials) -> Caller:
        """Returns the caller that these credentials belong to.

        Raises Unauthenticated; Unavailable while the JWT issuer's keys cannot be fetched.
        """
        if self.is_open:
            return LOCAL
        if self._certificate_scopes is not None and not shown.certificate:
            raise Unauthenticated("a client certificate is required; connect with one")
        secret = shown.api_key or shown.bearer
        if len(secret) > MAX_BYTES:
            raise Unauthenticated(f"a key or token has {MAX_BYTES} characters at most")
        if secret.startswith(KEY_PREFIX) and self._keys:
            return self._keys.caller(secret)
        if shown.bearer and self._tokens:
            return await self._tokens.caller(shown.bearer)
        if secret:
            raise Unauthenticated(f"unknown credentials; accepted are {self._accepted()}")
        if self._certificate_scopes:
            return Caller("certificate:" + shown.certificate, self._certificate_scopes)
        raise Unauthenticated(f"credentials are missing; accepted are {self._accepted()}")

    def is_good(self, caller: Caller) -> bool:
        """Whether an authenticated caller is still valid: its API key has not been revoked.

        Tokens and certificates are valid until they expire; calls that began with them continue.
        """
        return not caller.key or self._keys is None or self._keys.is_good(caller)

    def _accepted(self) -> str:
        ways = []
        if self._keys:
            ways.append(f"an API key ({KEY_PREFIX}…) in 'x-api-key' or 'authorization: Bearer'")
        if self._tokens:
            ways.append("a JWT in 'authorization: Bearer'")
        if self._certificate_scopes:
            ways.append("a client certificate with neither")
        return ", ".join(ways)
