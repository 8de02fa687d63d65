"""Credentials that the Python client shows, and certificates that it trusts."""

import grpc
import pytest

import wayfarer_client as wf
from tests.certificates import Authority
from tests.clients.fake_server import ASKED, FakeServer
from tests.clients.replies import HEADER, batch, moved, new_session


@pytest.mark.parametrize(
    ("access", "headers"),
    [
        ({}, {}),
        ({"api_key": "wf_secret"}, {"x-api-key": "wf_secret"}),
        ({"token": "eyJ"}, {"authorization": "Bearer eyJ"}),
        ({"token": lambda: "fresh"}, {"authorization": "Bearer fresh"}),
    ],
)
async def test_credentials_go_with_every_call_and_stream(server, access, headers):
    async with wf.Client(server.address, **access) as client:
        session = await client.create_session()
        server.scripts["StreamMotion"] = [[HEADER, batch("t0")]]
        server.scripts["Control"] = [[ASKED, moved(HEADER), moved(batch("t0")), ASKED]]
        assert [found async for found in session.stream()]
        async with session.control() as control:
            await anext(control)
        assert "secret" not in repr(client.connection._access)
    assert len(server.metadata) == 3
    for found in server.metadata:
        shown = {key: found[key] for key in ("x-api-key", "authorization") if key in found}
        assert shown == headers


def test_tls_files_are_checked(tmp_path):
    with pytest.raises(wf.InvalidArgument, match="belong together"):
        wf.Tls(certificate=tmp_path / "a").credentials()
    with pytest.raises(wf.InvalidArgument, match=r"missing\.pem: No such file"):
        wf.Tls(ca=tmp_path / "missing.pem").credentials()


async def test_mutual_tls(tmp_path):
    authority = Authority(tmp_path)
    cert, key = authority.issue("server")
    credentials = grpc.ssl_server_credentials(
        [(key.read_bytes(), cert.read_bytes())],
        authority.path.read_bytes(),
        require_client_auth=True,
    )
    certificate, private = authority.issue("client")
    async with FakeServer(credentials) as server:
        server.answers["CreateSession"] = new_session
        tls = wf.Tls(authority.path, certificate, private)
        async with wf.Client(server.address, tls=tls, api_key="wf_k") as client:
            await client.create_session()
        assert server.metadata[0]["x-api-key"] == "wf_k"
        named = wf.Tls(authority.path, certificate, private, server_name="localhost")
        async with wf.Client(server.address, tls=named) as client:
            await client.create_session()
        for tls in (None, wf.Tls(), wf.Tls(authority.path)):
            with pytest.raises(wf.Unavailable, match="no gRPC server at"):
                await wf.Client(server.address, timeout=0.5, tls=tls).connect()
