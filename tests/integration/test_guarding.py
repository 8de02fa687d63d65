"""Keys, tokens, certificates and drain, of `wayfarer serve` as a process."""

import asyncio
import json
import signal
import ssl
import time
import tomllib
from pathlib import Path

import grpc
import httpx
import pytest
import websockets

from tests.certificates import Authority
from tests.integration.test_process import refused
from tests.programs import run_program
from tests.serving import ANY_PORTS, COMMAND, ENVIRONMENT, Service
from tests.transport.auth.issuer import AUDIENCE, ISSUER, Issuer
from wayfarer.transport.auth.keys import new_key
from wayfarer.v1 import (
    admin_pb2,
    admin_pb2_grpc,
    motion_pb2,
    motion_pb2_grpc,
    session_pb2,
    session_pb2_grpc,
)

LISTED = session_pb2.ListSessionsRequest()


class Keys:
    """A keys file with one key for each set of scopes."""

    def __init__(self, path: Path, **scopes: str) -> None:
        self.path = path
        self.keys: dict[str, str] = {}
        text = ""
        for name, listed in scopes.items():
            self.keys[name], digest = new_key()
            text += f'[keys.{name}]\nsha256 = "{digest}"\nscopes = {json.dumps(listed.split())}\n'
        path.write_text(text)

    def http(self, name: str) -> dict[str, str]:
        return {"authorization": f"Bearer {self.keys[name]}"}

    def grpc(self, name: str) -> tuple[tuple[str, str], ...]:
        return (("x-api-key", self.keys[name]),)


@pytest.fixture
def keys(tmp_path) -> Keys:
    return Keys(tmp_path / "keys.toml", ada="read control", bob="read", root="read control admin")


def guarded(keys: Keys, *options: str) -> Service:
    return Service("--keys-file", str(keys.path), *options)


def test_keys_tokens_scopes_keys_taken_back_and_nothing_secret_in_the_log(keys, tmp_path):
    issuer = Issuer()
    (tmp_path / "jwks.json").write_text(json.dumps(issuer.document()))
    file = tmp_path / "wayfarer.toml"
    file.write_text(
        f'access_log = true\n[auth]\njwt_keys = "{tmp_path}/jwks.json"\n'
        f'jwt_issuer = "{ISSUER}"\njwt_audience = "{AUDIENCE}"\n'
    )
    good = issuer.token()
    expired = issuer.token(exp=time.time() - 3600)
    wrong = new_key()[0]
    shown = [good, expired, wrong, *keys.keys.values()]

    with guarded(keys, "--config", str(file), "--log-level", "debug") as service:
        with httpx.Client(base_url=service.url) as http:

            def status(path: str, *, method: str = "GET", **headers: str) -> int:
                return http.request(method, path, headers=headers).status_code

            assert status("/v1/health/ready") == status("/") == 200
            assert status("/v1/sessions") == status("/metrics") == status("/v1/info") == 401
            assert status("/v1/sessions", authorization=f"Bearer {wrong}") == 401
            assert status("/v1/sessions", authorization=f"Bearer {expired}") == 401
            assert status("/v1/sessions", authorization=wrong) == 401
            assert status(f"/v1/sessions?token={wrong}", **{"x-api-key": wrong}) == 401
            assert status("/v1/sessions", authorization=f"Bearer {good}") == 200
            assert status("/v1/sessions", **keys.http("bob")) == 200
            assert status("/v1/sessions", method="POST", **keys.http("bob")) == 403
            assert status("/metrics", **keys.http("bob")) == 200
            made = http.post("/v1/sessions", headers=keys.http("ada"))
            assert made.status_code == 201
            session_id = made.json()["session_id"]
            # other callers do not even learn that it exists
            assert status(f"/v1/sessions/{session_id}", **keys.http("bob")) == 404
            assert status(f"/v1/sessions/{session_id}", **keys.http("root")) == 200
        asyncio.run(_the_same_over_grpc(service, keys, [wrong, expired]))
        asyncio.run(_the_same_over_a_socket(service, keys, session_id, wrong))
        asyncio.run(_take_back(service, keys))
        _read_again(service, keys)
        service.stop()
    log = json.dumps(service.log)
    for secret in shown:
        assert secret not in log and secret.rpartition(".")[2] not in log
    assert "key:ada" in log and "jwt:ada" in log and "request_id" in log
    assert "streams of revoked keys ended" in log


async def _the_same_over_grpc(service: Service, keys: Keys, bad: list[str]) -> None:
    async with grpc.aio.insecure_channel(service.grpc_address) as channel:
        sessions = session_pb2_grpc.SessionServiceStub(channel)
        assert await sessions.ListSessions(LISTED, metadata=keys.grpc("bob"))
        for metadata in ((), *((("authorization", f"Bearer {secret}"),) for secret in bad)):
            with pytest.raises(grpc.aio.AioRpcError) as caught:
                await sessions.ListSessions(LISTED, metadata=metadata)
            assert caught.value.code() == grpc.StatusCode.UNAUTHENTICATED
        admin = admin_pb2_grpc.AdminServiceStub(channel)
        with pytest.raises(grpc.aio.AioRpcError) as caught:
            await admin.Drain(admin_pb2.DrainRequest(), metadata=keys.grpc("ada"))
        assert caught.value.code() == grpc.StatusCode.PERMISSION_DENIED


async def _the_same_over_a_socket(
    service: Service, keys: Keys, session_id: str, wrong: str
) -> None:
    url = f"{service.url.replace('http', 'ws')}/v1/stream?session={session_id}"
    async with websockets.connect(url, additional_headers=keys.http("ada")) as socket:
        assert motion_pb2.StreamMotionResponse.FromString(await socket.recv()).header.session_id
    async with websockets.connect(f"{url}&token={wrong}") as socket:
        with pytest.raises(websockets.ConnectionClosed) as closed:
            await socket.recv()
    assert closed.value.rcvd.code == 4401


async def _take_back(service: Service, keys: Keys) -> None:
    """Streams end when their key is revoked; others continue."""
    async with grpc.aio.insecure_channel(service.grpc_address) as channel:
        stub = motion_pb2_grpc.MotionServiceStub(channel)

        async def followed(name: str) -> tuple[str, grpc.aio.UnaryStreamCall]:
            sessions = session_pb2_grpc.SessionServiceStub(channel)
            request, own = session_pb2.CreateSessionRequest(), keys.grpc(name)
            session_id = (await sessions.CreateSession(request, metadata=own)).session.session_id
            request = motion_pb2.StreamMotionRequest(session_id=session_id)
            stream = stub.StreamMotion(request, metadata=own)
            assert (await stream.read()).HasField("header")
            return session_id, stream

        session_id, revoked = await followed("ada")
        _, good = await followed("root")
        url = f"{service.url.replace('http', 'ws')}/v1/stream?session={session_id}"
        async with websockets.connect(url, additional_headers=keys.http("ada")) as socket:
            assert await socket.recv()
            text = keys.path.read_text()
            keys.path.write_text(text[text.index("[keys.bob]") :])  # ada's is the first
            async with asyncio.timeout(20):
                with pytest.raises(websockets.ConnectionClosed) as closed:
                    while True:
                        await socket.recv()
                with pytest.raises(grpc.aio.AioRpcError) as caught:
                    while True:
                        await revoked.read()
        assert closed.value.rcvd.code == 4401 and "taken back" in closed.value.rcvd.reason
        assert caught.value.code() == grpc.StatusCode.UNAUTHENTICATED
        for _ in range(3):
            assert (await good.read()) is not grpc.aio.EOF


def _read_again(service: Service, keys: Keys) -> None:
    """A signal makes the server read the file at once."""
    old = keys.http("root")
    Keys(keys.path, eve="read")
    service.process.send_signal(signal.SIGHUP)
    deadline = time.monotonic() + 10
    while httpx.get(f"{service.url}/v1/info", headers=old).status_code == 200:
        assert time.monotonic() < deadline
        time.sleep(0.05)


def test_tls_and_client_certificates(tmp_path):
    authority = Authority(tmp_path)
    cert, key = authority.issue("server")
    ada = authority.issue("ada")
    eve = Authority(tmp_path / "evil").issue("eve")
    options = ("--tls-cert", cert, "--tls-key", key, "--tls-client-ca", authority.path)
    with Service(*map(str, options)) as service:
        assert service.url.startswith("https://127.0.0.1:")

        def client(certificate: tuple[Path, Path] | None) -> httpx.Client:
            context = ssl.create_default_context(cafile=str(authority.path))
            if certificate:
                context.load_cert_chain(*certificate)
            return httpx.Client(base_url=service.url, verify=context)

        with client(ada) as http:
            assert http.get("/v1/info").status_code == 200
            assert http.post("/v1/sessions").status_code == 201
            assert http.post("/v1/admin/drain").status_code == 403  # no scope of certificates
        with client(None) as http:
            assert http.get("/v1/health/live").status_code == 200
            refusal = http.get("/v1/info")
            assert refusal.status_code == 401 and "client certificate" in refusal.json()["detail"]
        with client(eve) as http, pytest.raises(httpx.TransportError):
            http.get("/v1/health/live")
        with pytest.raises(httpx.TransportError):
            httpx.get(service.url.replace("https", "http") + "/v1/health/live")
        asyncio.run(_certificates_over_grpc(service, authority.path, ada, eve))


async def _certificates_over_grpc(service: Service, ca: Path, ada: tuple, eve: tuple) -> None:
    async def names(*certificate: Path) -> int:
        chain = [path.read_bytes() for path in reversed(certificate)] or [None, None]
        credentials = grpc.ssl_channel_credentials(ca.read_bytes(), *chain)
        async with grpc.aio.secure_channel(service.grpc_address, credentials) as channel:
            stub = session_pb2_grpc.SessionServiceStub(channel)
            answer = await stub.ListSessions(LISTED, timeout=10)
            return len(answer.sessions)

    assert await names(*ada) == 1  # the one it has made over HTTP
    for certificate in ((), eve):
        with pytest.raises(grpc.aio.AioRpcError) as caught:
            await names(*certificate)
        assert caught.value.code() == grpc.StatusCode.UNAVAILABLE


def test_a_guard_that_cannot_stand_stops_the_start_in_one_line():
    assert "--insecure-no-auth" in refused(*ANY_PORTS, "--host", "0.0.0.0")
    lost = ("--tls-cert", "nowhere.pem", "--tls-key", "nowhere.key")
    assert "tls_cert: nowhere.pem" in refused("--check-config", *lost)


def test_check_config(tmp_path):
    file = tmp_path / "wayfarer.toml"
    file.write_text("threads = 1")
    options = ("--check-config", "--config", file, "--http-port", "0")
    done = run_program(*COMMAND, *options, env=ENVIRONMENT)
    assert tomllib.loads(done.stdout)["threads"] == 1
    assert f"# {file}" in done.stdout and "# command line" in done.stdout


# Drain


@pytest.mark.parametrize("how", ["SIGTERM", "Drain"])
def test_drain_tells_streams_refuses_new_work_and_ends(keys, how):
    with guarded(keys) as service:
        asyncio.run(_drain(service, keys, how))
        assert service.ended() == 0
        assert [line["event"] for line in service.log[-2:]] == ["draining", "stopped"]


async def _drain(service: Service, keys: Keys, how: str) -> None:
    own = keys.grpc("root")
    async with grpc.aio.insecure_channel(service.grpc_address) as channel:
        sessions = session_pb2_grpc.SessionServiceStub(channel)
        made = await sessions.CreateSession(session_pb2.CreateSessionRequest(), metadata=own)
        request = motion_pb2.StreamMotionRequest(session_id=made.session.session_id)
        stream = motion_pb2_grpc.MotionServiceStub(channel).StreamMotion(request, metadata=own)
        assert (await stream.read()).HasField("header")
        if how == "SIGTERM":
            service.process.send_signal(signal.SIGTERM)
        else:
            admin = admin_pb2_grpc.AdminServiceStub(channel)
            await admin.Drain(admin_pb2.DrainRequest(), metadata=own)
        told = []
        with pytest.raises(grpc.aio.AioRpcError) as caught:
            while True:
                told.append(await stream.read())
                assert told[-1] is not grpc.aio.EOF
        assert caught.value.code() == grpc.StatusCode.UNAVAILABLE
        assert "shutting down" in caught.value.details()
        assert [m.event.kind for m in told if m.HasField("event")] == [
            motion_pb2.EVENT_KIND_DRAINING
        ]


def test_a_second_signal_ends_at_once(keys, tmp_path):
    file = tmp_path / "wayfarer.toml"
    file.write_text("drain_s = 300")

    async def hold(service: Service) -> None:
        """A call under way, so that the drain has something to wait for."""
        _, writer = await asyncio.open_connection("127.0.0.1", int(service.url[-5:]))
        head = "POST /v1/sessions HTTP/1.1\r\nHost: localhost\r\nContent-Length: 9\r\n"
        key = keys.keys["ada"]  # without one it would be answered at once
        writer.write(f"{head}Content-Type: application/json\r\nX-Api-Key: {key}\r\n\r\n{{".encode())
        await writer.drain()
        await asyncio.sleep(0.5)
        service.process.send_signal(signal.SIGTERM)
        await asyncio.sleep(1.0)
        assert service.process.poll() is None
        service.process.send_signal(signal.SIGTERM)
        assert await asyncio.to_thread(service.process.wait, 10) == -signal.SIGTERM
        writer.close()

    with guarded(keys, "--config", str(file)) as service:
        asyncio.run(hold(service))
