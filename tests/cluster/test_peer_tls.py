"""Certificates between nodes: three processes that have them, and strangers that are refused."""

import asyncio
import os

import grpc
import pytest

from tests.certificates import Authority
from tests.cluster.local import SECRET, LocalCluster
from tests.cluster.nodes import info
from tests.serving import needs_ray
from wayfarer import cluster_command
from wayfarer.cluster.peer import Peers, PeerServer, Replicas
from wayfarer.cluster.ray_environment import encrypt_ray
from wayfarer.config import PeerTls, Settings
from wayfarer.errors import InvalidArgument, Unavailable
from wayfarer.transport.tls import peer_tls
from wayfarer_client import AgentSpec, Client


def issued(folder, name="node"):
    """Certificate of an authority of its own; its settings."""
    authority = Authority(folder)
    cert, key = authority.issue(name)
    return PeerTls(cert=cert, key=key, ca=authority.path)


@pytest.fixture
def own(tmp_path):
    return issued(tmp_path / "own")


@pytest.fixture
def other(tmp_path):
    return issued(tmp_path / "other")


async def refused(node, secret, tls, why):
    peers = Peers(secret, tls)
    with pytest.raises(Unavailable, match=why):
        await peers.ask(node, b"{}", 5)
    await peers.forget_others(set())


class OnlyTheAuthority:
    """Trusts the nodes, and has no certificate to show."""

    def __init__(self, ca):
        self.ca = ca

    def grpc_channel(self):
        return grpc.ssl_channel_credentials(self.ca.read_bytes())


@pytest.mark.slow
@needs_ray
async def test_three_nodes_with_certificates(own, other):
    async with (
        LocalCluster(peer_tls=own.model_dump()) as cluster,
        Client(cluster.entry.grpc_address) as client,
    ):
        session = await client.create_session(lease=900)
        await session.create_agents(AgentSpec())
        assert [one.session_id for one in await client.sessions()] == [session.session_id]

        status = await cluster.until(lambda s: sum(one.load.sessions for one in s.nodes) == 1)
        node = next(one.node for one in status.nodes if one.load.sessions)
        handshake = "connect|handshake|Socket closed|unavailable"
        await refused(node, SECRET, None, handshake)
        await refused(node, SECRET, peer_tls(other), handshake)
        await refused(node, SECRET, OnlyTheAuthority(own.ca), handshake)
        await refused(node, "x" * 32, peer_tls(own), "not a node of this cluster")

        await asyncio.sleep(2)  # it has been copied, over TLS
        (await cluster.process(node.name)).kill()
        await cluster.until(lambda status: status.counters.get("adopted", 0) == 1)
        assert len(await session.agents()) == 1


async def test_a_node_of_another_authority_gets_nothing(own, other):
    """Nobody sends people, or the secret, to a machine that only has the address."""
    asked = []

    async def ask(question):
        asked.append(question)
        return b"{}"

    for theirs, why in ((other, "CERTIFICATE_VERIFY_FAILED|connect"), (None, "connect|handshake")):
        tls = peer_tls(theirs) if theirs else None
        server = PeerServer("127.0.0.1", SECRET, Replicas(), None, None, ask, tls)
        await server.start()
        await refused(node_at("127.0.0.1", server.port), SECRET, peer_tls(own), why)
        await server.stop()
    assert not asked


async def test_a_certificate_is_for_an_address(own):
    async def ask(question):
        return question

    server = PeerServer("127.0.0.2", SECRET, Replicas(), None, None, ask, peer_tls(own))
    await server.start()
    await refused(node_at("127.0.0.2", server.port), SECRET, peer_tls(own), "127.0.0.2|connect")
    await server.stop()
    server = PeerServer("127.0.0.1", SECRET, Replicas(), None, None, ask, peer_tls(own))
    await server.start()
    peers = Peers(SECRET, peer_tls(own))
    assert await peers.ask(node_at("127.0.0.1", server.port), b"hello", 5) == b"hello"
    await peers.forget_others(set())
    await server.stop()


def node_at(host, port):
    return info("n1").model_copy(update={"host": host, "peer_port": port})


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
