"""A server below a proxy's path, as nginx passes it on, and as other proxies may."""

import asyncio
import shutil
from contextlib import asynccontextmanager
from ipaddress import ip_network

import httpx
import pytest
import websockets

from tests.runtime.running import until
from tests.transport.rig import Rig
from wayfarer.transport.edge.prefix import UnderPrefix, is_prefix
from wayfarer.v1 import motion_pb2

LOCAL = [ip_network("127.0.0.0/8")]


async def echo(scope, receive, send):
    """Answers with the requested path; redirects /old."""
    if scope["path"] == "/old":
        headers = [(b"location", b"http://inside:80/new?a=b")]
        await send({"type": "http.response.start", "status": 307, "headers": headers})
    else:
        await send({"type": "http.response.start", "status": 200, "headers": []})
    await send({"type": "http.response.body", "body": scope["path"].encode()})


async def asked(path, root_path="", told="", client="127.0.0.1"):
    app = UnderPrefix(echo, root_path, LOCAL)
    transport = httpx.ASGITransport(app, client=(client, 1))
    async with httpx.AsyncClient(transport=transport, base_url="http://outside") as http:
        return await http.get(path, headers={"X-Forwarded-Prefix": told} if told else {})


@pytest.mark.parametrize("path", ["/wf/v1/info", "/v1/info"])
@pytest.mark.parametrize("how", [{"root_path": "/wf"}, {"told": "/wf"}, {"told": "/wf/"}])
async def test_a_prefix_is_taken_off_where_the_proxy_left_it(path, how):
    assert (await asked(path, **how)).text == "/v1/info"


async def test_redirects_stay_below_it_and_the_bare_prefix_leads_there():
    assert (await asked("/wf/old", "/wf")).headers["location"] == "/wf/new?a=b"
    found = await asked("/wf?scene=park", "/wf")
    assert (found.status_code, found.headers["location"]) == (308, "/wf/?scene=park")


@pytest.mark.parametrize(
    ("told", "client"),
    [
        ("/wf", "10.0.0.1"),
        ("//evil.example", "127.0.0.1"),
        ("/..", "127.0.0.1"),
        ("http://x", "127.0.0.1"),
    ],
)
async def test_what_nobody_trusted_says_or_what_is_no_path_counts_for_nothing(told, client):
    assert (await asked("/old", "", told, client)).headers["location"].startswith("http://inside")
    assert not (client == "127.0.0.1" and is_prefix(told))


NGINX = """
daemon off; pid {folder}/pid; error_log {folder}/error.log; worker_processes 1;
events {{ }}
http {{
  access_log off;
  client_body_temp_path {folder}/body; proxy_temp_path {folder}/proxy;
  fastcgi_temp_path {folder}/f; uwsgi_temp_path {folder}/u; scgi_temp_path {folder}/s;
  map $http_upgrade $connection_upgrade {{ default upgrade; '' close; }}
  server {{
    listen 127.0.0.1:{port};
    location /wf/ {{
      proxy_pass {server}/;
      proxy_set_header Host $http_host;
      proxy_set_header X-Forwarded-Prefix /wf;
      proxy_http_version 1.1;
      proxy_set_header Upgrade $http_upgrade;
      proxy_set_header Connection $connection_upgrade;
      proxy_buffering off;
    }}
  }}
}}
"""


@asynccontextmanager
async def nginx(folder, server, port):
    (folder / "nginx.conf").write_text(NGINX.format(folder=folder, server=server, port=port))
    process = await asyncio.create_subprocess_exec("nginx", "-c", folder / "nginx.conf")
    try:
        await until((folder / "pid").exists)
        yield f"http://127.0.0.1:{port}/wf"
    finally:
        process.terminate()
        await process.wait()


@pytest.mark.skipif(not shutil.which("nginx"), reason="needs nginx (apt-get install nginx-light)")
async def test_behind_nginx_page_reference_calls_and_streams_work(tmp_path, unused_tcp_port):
    async with (
        Rig() as rig,
        nginx(tmp_path, rig.server.http_url, unused_tcp_port) as url,
        httpx.AsyncClient(timeout=10) as http,
    ):
        page = await http.get(f"{url}/")
        assert page.status_code == 200 and 'href="/' not in page.text
        assert (await http.get(f"{url}/docs", follow_redirects=True)).url.path == "/wf/docs/"
        assert (await http.get(f"{url}/docs/start.js")).status_code == 200
        made = await http.post(f"{url}/v1/sessions", json={})
        session_id = made.json()["session_id"]
        agents = await http.post(f"{url}/v1/sessions/{session_id}/agents", json={"agents": [{}]})
        assert agents.status_code == 201
        slash = await http.get(f"{url}/v1/sessions/", follow_redirects=True)
        assert slash.status_code in (200, 404) and slash.url.path.startswith("/wf/")
        stream = f"{url.replace('http', 'ws')}/v1/stream?session={session_id}"
        async with websockets.connect(stream) as socket:
            motion_pb2.StreamMotionResponse.FromString(await socket.recv())
            rig.service.emit(session_id)
            sent = motion_pb2.StreamMotionResponse.FromString(await socket.recv())
            assert len(sent.batch.chunks.aliases) == 1
