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


@dataclass(eq=False)
class Authenticator:
    """Identifies callers by API key, JWT or client certificate, whichever are configured."""

    keys: KeyFile | None = None
    tokens: "TokenCheck | None" = None
    certificate_scopes: frozenset[Scope] | None = None  # None: no certificates are asked for

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
        return self.keys is None and self.tokens is None and self.certificate_scopes is None

    def reload(self) -> None:
        """Reads the keys again, even if the file seems unchanged. A bad file changes nothing."""
        if self.keys:
            self.keys.reload()

    async def caller(self, shown: Credentials) -> Caller:
        """Returns the caller that these credentials belong to.

        Raises Unauthenticated; Unavailable while the JWT issuer's keys cannot be fetched.
        """
        if self.is_open:
            return LOCAL
        if self.certificate_scopes is not None and not shown.certificate:
            raise Unauthenticated("a client certificate is required; connect with one")
        secret = shown.api_key or shown.bearer
        if len(secret) > MAX_BYTES:
            raise Unauthenticated(f"a key or token has {MAX_BYTES} characters at most")
        if secret.startswith(KEY_PREFIX) and self.keys:
            return self.keys.caller(secret)
        if shown.bearer and self.tokens:
            return await self.tokens.caller(shown.bearer)
        if secret:
            raise Unauthenticated(f"unknown credentials; accepted are {self._accepted()}")
        if self.certificate_scopes:
            return Caller("certificate:" + shown.certificate, self.certificate_scopes)
        raise Unauthenticated(f"credentials are missing; accepted are {self._accepted()}")

    def is_good(self, caller: Caller) -> bool:
        """Whether an authenticated caller is still valid: its API key has not been revoked.

        Tokens and certificates are valid until they expire; calls that began with them continue.
        """
        return not caller.key or self.keys is None or self.keys.is_good(caller)

    def _accepted(self) -> str:
        ways = []
        if self.keys:
            ways.append(f"an API key ({KEY_PREFIX}…) in 'x-api-key' or 'authorization: Bearer'")
        if self.tokens:
            ways.append("a JWT in 'authorization: Bearer'")
        if self.certificate_scopes:
            ways.append("a client certificate with neither")
        return ", ".join(ways)
