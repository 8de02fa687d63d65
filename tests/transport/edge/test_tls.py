import ssl
from datetime import timedelta

import pytest
from structlog.testing import capture_logs

from tests.certificates import DAY, Authority
from wayfarer.errors import InvalidArgument
from wayfarer.transport.edge.tls import Tls


@pytest.fixture
def authority(tmp_path):
    return Authority(tmp_path)


def test_good_files(authority):
    cert, key = authority.issue("server", 30 * DAY)
    tls = Tls(cert, key, authority.path)
    with capture_logs() as lines:
        tls.check()
    assert tls.http().verify_mode == ssl.CERT_OPTIONAL
    assert tls.http().minimum_version >= ssl.TLSVersion.TLSv1_2
    assert tls.grpc()
    assert [line["setting"] for line in lines] == ["tls_client_ca"]  # it ends tomorrow


def test_a_key_of_another_certificate(authority):
    cert, _ = authority.issue("server")
    _, other = authority.issue("other")
    with pytest.raises(InvalidArgument, match=r"tls_key: .*other\.key is not the private key"):
        Tls(cert, other).check()


def test_an_encrypted_key_asks_nobody(authority):
    with pytest.raises(InvalidArgument, match="tls_key: the private key is encrypted"):
        Tls(*authority.issue("server", password="sesame")).check()


def test_an_expired_certificate(authority):
    with pytest.raises(InvalidArgument, match=r"tls_cert: .*server\.pem has expired on 20"):
        Tls(*authority.issue("server", timedelta(seconds=-1))).check()


@pytest.mark.parametrize("name", ["cert", "key", "client_ca"])
@pytest.mark.parametrize("damage", ["missing", "no PEM"])
def test_a_bad_file_is_named(authority, tmp_path, name, damage):
    cert, key = authority.issue("server")
    files = {"cert": cert, "key": key, "client_ca": authority.path}
    files[name] = tmp_path / "bad.pem"
    if damage == "no PEM":
        files[name].write_text("hello")
    with pytest.raises(InvalidArgument, match=rf"setting tls_{name}: .*bad\.pem"):
        Tls(**files).check()
