import threading
from http.server import BaseHTTPRequestHandler, HTTPServer

import pytest

from tests.certificates import Authority
from wayfarer.commands.probe import status
from wayfarer.config import settings as config
from wayfarer.config import sources
from wayfarer.errors import Unavailable
from wayfarer.transport.edge.tls import Tls


class Answer(BaseHTTPRequestHandler):
    code, body = 200, b'{"status": "ready"}'

    def do_GET(self) -> None:
        self.send_response(self.code if self.path == "/v1/health/ready" else 404)
        self.end_headers()
        self.wfile.write(self.body)

    def log_message(self, *_: object) -> None:
        pass


@pytest.fixture
def server():
    server = HTTPServer(("127.0.0.1", 0), type("Own", (Answer,), {}))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield server
    server.shutdown()
    server.server_close()


def settings(server: HTTPServer, **given: object) -> config.Settings:
    return sources.load({"http_port": server.server_port, **given})


@pytest.mark.parametrize("host", ["127.0.0.1", "localhost", "0.0.0.0"])
def test_ready(server, host):
    assert status(settings(server, host=host, insecure_no_auth=True)) == "ready"


def test_ready_over_tls(server, tmp_path):
    cert, key = Authority(tmp_path).issue("wayfarer.example")
    server.socket = Tls(cert, key).http().wrap_socket(server.socket, server_side=True)
    assert status(settings(server, tls_cert=str(cert), tls_key=str(key))) == "ready"


@pytest.mark.parametrize(("code", "body"), [(503, b'{"status": "not ready"}'), (200, b"hello")])
def test_not_ready(server, code, body):
    server.RequestHandlerClass.code, server.RequestHandlerClass.body = code, body
    with pytest.raises(Unavailable, match="/v1/health/ready"):
        status(settings(server))


def test_nobody_there(server):
    with pytest.raises(Unavailable):
        status(sources.load({"http_port": 1}))
