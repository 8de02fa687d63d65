"""Certificates of a cluster: their files, and the settings of Ray for them (a cluster with them:
test_on_ray.py).
"""

import os

import pytest

from tests.certificates import Authority
from wayfarer.cluster.ray_environment import encrypt_ray
from wayfarer.commands import cluster as cluster_command
from wayfarer.config.settings import PeerTls, Settings
from wayfarer.errors import InvalidArgument
from wayfarer.transport.edge.tls import peer_tls


def issued(folder, name="node"):
    """Settings with the certificate of a separate authority."""
    authority = Authority(folder)
    cert, key = authority.issue(name)
    return PeerTls(cert=cert, key=key, ca=authority.path)


@pytest.fixture
def own(tmp_path):
    return issued(tmp_path / "own")


@pytest.fixture
def other(tmp_path):
    return issued(tmp_path / "other")


def test_a_bad_file_is_named(own, other, tmp_path):
    with pytest.raises(InvalidArgument, match=r"setting peer_tls\.key: .* is not the private key"):
        peer_tls(own.model_copy(update={"key": other.key}))
    with pytest.raises(InvalidArgument, match=r"setting peer_tls\.ca: .*none\.pem: No such file"):
        peer_tls(own.model_copy(update={"ca": tmp_path / "none.pem"}))
    assert peer_tls(PeerTls()) is None


def test_plain_text_leaves_a_machine_only_when_told(own):
    check = cluster_command._check_links
    check(Settings(), "127.0.0.2")
    with pytest.raises(InvalidArgument, match=r"10\.0\.0\.7 .* peer_tls\.cert"):
        check(Settings(), "10.0.0.7")
    check(Settings(insecure_peers=True), "10.0.0.7")
    check(Settings(peer_tls=own), "10.0.0.7")


def test_rays_links_have_the_same_files(own, monkeypatch):
    for name in [name for name in os.environ if name.startswith("RAY_")]:
        monkeypatch.delenv(name)
    monkeypatch.setattr(os, "environ", dict(os.environ))
    encrypt_ray(PeerTls())
    assert "RAY_USE_TLS" not in os.environ
    encrypt_ray(own)
    assert os.environ["RAY_USE_TLS"] == "1"
    assert os.environ["RAY_TLS_CA_CERT"] == str(own.ca)
