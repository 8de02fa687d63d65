"""The entry alone: a directory in this process, and nodes that are registered without a process."""

import asyncio

import httpx
import pytest
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed

from tests.cluster.local import LocalLink
from tests.cluster.nodes import info
from wayfarer.cluster.directory import LeaseRules
from wayfarer.cluster.directory_service import DirectoryClient
from wayfarer.cluster.entry import Entry
from wayfarer.cluster.messages import LeaseRenewal, NodeLoad, Registration
from wayfarer.config import Settings
from wayfarer.ids import session_id
from wayfarer_client import Client, FailedPrecondition, Misdirected, Unavailable


class Rig:
    """An entry with two nodes of whom the directory only has heard."""

    async def __aenter__(self):
        self.link = LocalLink(LeaseRules(600.0))
        self.link.service._directory._settled_at = 0.0
        directory = DirectoryClient(self.link)
        self.nodes = [info("n1"), info("n2")]
        for node in self.nodes:
            await directory.register(Registration(node=node, count=1))
        self.entry = Entry(Settings(http_port=0, grpc_port=0, drain_s=0.2), directory)
        await self.entry.start()
        self.http = httpx.AsyncClient(base_url=self.entry.http_url)
        async with asyncio.timeout(10):
            while not self.entry.finder.ready:
                await asyncio.sleep(0.01)
        return self

    async def __aexit__(self, *_):
        await self.http.aclose()
        await self.entry.stop()

    async def owned(self, node):
        """Id of a session of this node, of which the entry has heard."""
        directory = DirectoryClient(self.link)
        slot = next(
            s for s, entry in self.link.service._directory._slots.items()
            if entry.owner == node.name
        )  # fmt: skip
        await directory.renew(LeaseRenewal(name=node.name, count=2, load=NodeLoad(), used=(slot,)))
        await asyncio.sleep(0.6)
        return session_id(slot)


async def test_every_call_is_sent_to_a_node():
    async with Rig() as rig:
        ports = {node.http_port for node in rig.nodes}
        made = await rig.http.post("/v1/sessions", json={})
        assert made.status_code == 421
        assert made.json()["endpoint"]["http_port"] in ports
        assert made.json()["endpoint"]["host"] == "127.0.0.1"

        node = rig.nodes[1]
        name = await rig.owned(node)
        found = await rig.http.get(f"/v1/sessions/{name}")
        assert found.status_code == 421
        assert found.json()["endpoint"]["grpc_port"] == node.grpc_port

        page = await rig.http.get("/client/index.js")
        assert page.status_code == 307, "browsers open the viewer of a node"
        assert page.headers["location"].endswith("/client/index.js")
        all_of_them = await rig.http.get("/v1/sessions")
        assert all_of_them.status_code == 409
        assert "/v1/cluster" in all_of_them.json()["detail"]

        url = rig.entry.http_url.replace("http", "ws")
        async with connect(f"{url}/v1/stream?session={name}") as socket:
            with pytest.raises(ConnectionClosed) as closed:
                await socket.recv()
        assert closed.value.rcvd.code == 4421
        assert str(node.http_port) in closed.value.rcvd.reason

        async with Client(rig.entry.grpc_address, timeout=5) as client:
            with pytest.raises(Unavailable):  # it followed; nobody listens there
                await client.session(name)
            with pytest.raises(FailedPrecondition, match="each node") as refused:
                await client.sessions()
            assert not isinstance(refused.value, Misdirected)


async def test_the_same_request_is_sent_to_the_same_node():
    async with Rig() as rig:
        ports = set()
        for _ in range(8):
            made = await rig.http.post("/v1/sessions", json={"request_id": "one"})
            ports.add(made.json()["endpoint"]["http_port"])
        assert len(ports) == 1


async def test_without_the_directory_what_lives_is_found_and_nothing_is_made():
    async with Rig() as rig:
        name = await rig.owned(rig.nodes[0])
        assert (await rig.http.get("/v1/health/ready")).status_code == 200
        rig.link.away = True
        async with asyncio.timeout(20):
            while (health := await rig.http.get("/v1/health/ready")).status_code == 200:
                await asyncio.sleep(0.1)
        assert health.json()["away"]
        assert (await rig.http.get("/v1/health/live")).status_code == 200
        assert (await rig.http.post("/v1/sessions", json={})).status_code == 503
        assert (await rig.http.get(f"/v1/sessions/{name}")).status_code == 421
        assert "wayfarer_cluster_directory_up 0.0" in (await rig.http.get("/metrics")).text


async def test_an_operator_sees_the_nodes_and_drains_one():
    async with Rig() as rig:
        seen = (await rig.http.get("/v1/cluster")).json()
        assert [node["node"]["name"] for node in seen["nodes"]] == ["n1", "n2"]
        page = (await rig.http.get("/metrics")).text
        assert "wayfarer_cluster_nodes 2.0" in page
        assert "wayfarer_cluster_capacity 200.0" in page
        assert (await rig.http.post("/v1/cluster/nodes/n3/drain")).status_code == 404
        assert (await rig.http.post("/v1/cluster/nodes/n2/drain")).status_code == 202
        for _ in range(5):
            made = await rig.http.post("/v1/sessions", json={})
            assert made.json()["endpoint"]["http_port"] == rig.nodes[0].http_port


async def test_who_may_not_is_told_nothing(tmp_path):
    keys = tmp_path / "keys.toml"
    keys.write_text("")
    settings = Settings(http_port=0, grpc_port=0, auth={"keys_file": keys}, drain_s=0.2)
    entry = Entry(settings, DirectoryClient(LocalLink()))
    await entry.start()
    async with httpx.AsyncClient(base_url=entry.http_url) as http:
        for verb, path in (("GET", "/v1/cluster"), ("POST", "/v1/sessions")):
            assert (await http.request(verb, path)).status_code == 401
        assert (await http.post("/v1/cluster/nodes/n1/drain")).status_code == 401
    await entry.stop()
