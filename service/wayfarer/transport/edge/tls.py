"""TLS for the public ports and between nodes, from PEM files that are checked at start."""

import ssl
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Final

import grpc
import structlog

from wayfarer.config.settings import PeerTls
from wayfarer.errors import InvalidArgument

log = structlog.get_logger(__name__)

EXPIRY_WARNING: Final = timedelta(days=14)


@dataclass(frozen=True, slots=True)
class Tls:
    """Certificate chain and key of the server; the authority of client certificates, if used."""

    cert: Path
    key: Path
    client_ca: Path | None = None
    settings: tuple[str, str, str] = ("tls_cert", "tls_key", "tls_client_ca")  # that name the files

    def check(self) -> None:
        """Raises InvalidArgument that names the setting whose file is not valid."""
        cert, _, client_ca = self.settings
        _dated(cert, self.cert)
        if self.client_ca:
            _dated(client_ca, self.client_ca)
        self.http()

    def http(self) -> ssl.SSLContext:
        """TLS of HTTP. A client without a certificate reaches only what needs no credentials."""
        context = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH)
        context.minimum_version = ssl.TLSVersion.TLSv1_2
        setting = self.settings[1]
        try:
            context.load_cert_chain(self.cert, self.key, password=lambda: _no_password(setting))
        except ssl.SSLError as error:
            why = error.reason or str(error)
            raise InvalidArgument(
                f"setting {setting}: {self.key} is not the private key, in PEM, of "
                f"{self.cert}: {why.replace('_', ' ').lower()}",
                setting,
            ) from None
        except OSError as error:
            raise _unreadable(setting, self.key, error) from None
        if self.client_ca:
            context.load_verify_locations(self.client_ca)
            context.verify_mode = ssl.CERT_OPTIONAL
        return context

    def grpc(self) -> grpc.ServerCredentials:
        """TLS of gRPC. If client certificates are required, there is no connection without one."""
        return grpc.ssl_server_credentials(
            [(self.key.read_bytes(), self.cert.read_bytes())],
            self.client_ca.read_bytes() if self.client_ca else None,
            require_client_auth=self.client_ca is not None,
        )


def peer_tls(settings: PeerTls) -> Tls | None:
    """TLS between nodes, and between entries and nodes. Raises InvalidArgument as `Tls.check`."""
    if not (settings.cert and settings.key and settings.ca):
        return None
    names = ("peer_tls.cert", "peer_tls.key", "peer_tls.ca")
    tls = Tls(settings.cert, settings.key, settings.ca, names)
    tls.check()
    return tls


def _dated(setting: str, path: Path) -> None:
    """Refuses an invalid or expired certificate; warns before one expires."""
    # 9 MB that a server without TLS does not need
    from cryptography import x509

    try:
        found = x509.load_pem_x509_certificates(path.read_bytes())
    except OSError as error:
        raise _unreadable(setting, path, error) from None
    except ValueError:
        raise InvalidArgument(
            f"setting {setting}: {path} holds no certificate in PEM", setting
        ) from None
    now = datetime.now(UTC)
    ends = min(certificate.not_valid_after_utc for certificate in found)
    if ends < now:
        raise InvalidArgument(f"setting {setting}: {path} has expired on {ends:%Y-%m-%d}", setting)
    if ends < now + EXPIRY_WARNING:
        log.warning("certificate expires soon", setting=setting, on=f"{ends:%Y-%m-%d}")


def _unreadable(setting: str, path: Path, error: OSError) -> InvalidArgument:
    return InvalidArgument(f"setting {setting}: {path}: {error.strerror}", setting)


def _no_password(setting: str) -> str:
    """Raises an error; otherwise the library would ask for a password on the terminal."""
    raise InvalidArgument(
        f"setting {setting}: the private key is encrypted; a server needs it in the clear, in a "
        "file that only its user can read",
        setting,
    )
