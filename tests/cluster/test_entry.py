"""The entry alone: the directory and the nodes are in this process."""

import asyncio
import socket
from contextlib import closing

import httpx
import pytest
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed

from tests.cluster.nodes import Link, info
from tests.runtime.running import until
from tests.transport.auth.test_keys import FILE, STUDIO
from tests.transport.fakes import opened
from tests.transport.samples import MODEL
from wayfarer import errors
from wayfarer.cluster.directory import LeaseRules
from wayfarer.cluster.entry import Entry
from wayfarer.cluster.messages import SILENT_S, LeaseRenewal
from wayfarer.cluster.node_agent import NodeAgent
from wayfarer.config.settings import Settings
from wayfarer.ids import session_id
from wayfarer.transport import schema
from wayfarer.transport.server_options import ServerOptions
from wayfarer_client import Client, NotFound, PermissionDenied, Unavailable

GROUP = "0123456789ab"


class Rig:
    """An entry with two nodes of whom the directory only has heard."""

    async def __aenter__(self):
        self.link = Link(LeaseRules(600.0))
        self.link.directory._settled_at = 0.0
        self.nodes = [await self.node(name) for name in ("n1", "n2")]
        self.stopped_nodes = set()
        self._renewing = asyncio.create_task(self._renew())
        settings = Settings(http_port=0, grpc_port=0, drain_s=0.2)
        self.stopped = asyncio.Event()
        self.entry = Entry(settings, self.link, self, self.stopped.set)
        await self.entry.start()
        self.http = httpx.AsyncClient(base_url=self.entry.http_url)
        await until(lambda: self.entry.finder.ready)
        return self

    async def _renew(self):
        count, told = 0, {node.name: {"node": node} for node in self.nodes}
        while True:
            for name in told.keys() - self.stopped_nodes:
                self.link.directory.renew(LeaseRenewal(name=name, count=count + 1, **told[name]))
                told[name] = {}
            count += 2  # `owned` has the numbers between
            await asyncio.sleep(0.1)

    async def node(self, name):
        """Nobody listens at its ports, unless a test starts something there."""
        return info(name)

    async def __aexit__(self, *_):
        self._renewing.cancel()
        await self.http.aclose()
        await self.entry.stop()

    async def owned(self, node):
        """Id of a session of this node."""
        count = self.link.directory._nodes[node.name].count + 1
        self.link.directory.renew(LeaseRenewal(name=node.name, count=count, held={GROUP: 0}))
        return session_id(GROUP)


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

        page = await rig.http.get("/client/index.js?a=b")
        assert page.status_code == 307, "browsers open the viewer of a node"
        assert page.headers["location"].endswith("/client/index.js?a=b")
        stats = await rig.http.get("/v1/stats")
        assert stats.status_code == 409
        assert "/v1/cluster" in stats.json()["detail"]

        url = rig.entry.http_url.replace("http", "ws")
        async with connect(f"{url}/v1/stream?session={name}") as socket:
            with pytest.raises(ConnectionClosed) as closed:
                await socket.recv()
        assert closed.value.rcvd.code == 4421
        assert str(node.http_port) in closed.value.rcvd.reason

        async with Client(rig.entry.grpc_address, timeout=5) as client:
            with pytest.raises(Unavailable):  # it followed; nobody listens there
                await client.session(name)


async def test_a_port_in_use_is_told():
    with closing(socket.create_server(("127.0.0.1", 0))) as taken:
        settings = Settings(http_port=0, grpc_port=taken.getsockname()[1])
        with pytest.raises(errors.Unavailable, match=r"cannot listen for gRPC on 127"):
            Entry(settings, Link(LeaseRules()), None, print)


async def test_who_was_made_a_moment_ago_is_found():
    """The entry looks at the directory every quarter of a second, and again for an unknown id."""
    async with Rig() as rig:
        name = session_id("f" * 12)
        assert (await rig.http.get(f"/v1/sessions/{name}")).status_code == 421, "to some node"
        for count, node in enumerate(rig.nodes, start=2):
            group = f"{count:012x}"
            told = LeaseRenewal(name=node.name, count=count, held={group: 0})
            rig.link.directory.renew(told)
            found = await rig.http.get(f"/v1/sessions/{session_id(group)}")
            assert found.json()["endpoint"]["grpc_port"] == node.grpc_port


class AnsweringRig(Rig):
    """Its nodes answer what concerns all of them, over a fake service."""

    async def __aenter__(self):
        self.gateways, self.gone = [], set()
        return await super().__aenter__()

    async def node(self, name):
        gateway = await opened()
        self.gateways.append(gateway)
        return info(name).model_copy(update={"host": ""})

    async def call(self, node, verb, *told, seconds=0):
        assert verb == "ask"
        if node.name in self.gone:
            raise errors.Unavailable(f"node {node.name} does not answer")
        gateway = self.gateways[self.nodes.index(node)]
        # each in a separate context, as in another process
        agent = NodeAgent(None, gateway, None, None, None, None, None)
        return await asyncio.create_task(agent.ask(*told))


async def test_what_concerns_all_nodes_is_asked_of_all():
    async with AnsweringRig() as rig, Client(rig.entry.grpc_address, timeout=5) as client:
        for gateway in (*rig.gateways, rig.gateways[0]):
            await gateway.sessions.create(schema.NewSession())
        scenes = [
            await gateway.scenes.create_example("corridor", schema.NewExampleScene())
            for gateway in rig.gateways
        ]
        made = ["session-1", "session-1", "session-2"]  # each numbers its own
        listed = (await rig.http.get("/v1/sessions")).json()["sessions"]
        assert sorted(one["session_id"] for one in listed) == made
        assert sorted(one.session_id for one in await client.sessions()) == made
        listed = (await rig.http.get("/v1/scenes")).json()["scenes"]
        assert {one["scene_id"] for one in listed} == {one.scene_id for one in scenes}
        assert len(await client.scenes.all()) == 2

        model = (await rig.http.post("/v1/admin/models", json={"name": "v2"})).json()
        assert model["name"] == "v2"
        for gateway in rig.gateways:
            assert "v2" in [one.name for one in (await gateway.catalogue.models()).models]
        await client.admin.use_model("v2", move_agents=True)
        with pytest.raises(NotFound, match="v9"):
            await client.admin.use_model("v9")
        wrong = await rig.http.post("/v1/admin/models", json={"name": "../v2"})
        assert wrong.status_code == 422 and wrong.json()["errors"][0]["field"] == "name"
        await client.admin.use_model(MODEL.name)
        assert (await rig.http.delete("/v1/admin/models/v2")).status_code == 204
        assert (await rig.http.delete("/v1/admin/models/v2")).status_code == 404

        assert not rig.stopped.is_set()
        await client.admin.drain()
        assert rig.stopped.is_set(), "as Ctrl-C"


async def test_nodes_know_who_asks_through_the_entry(tmp_path):
    keys = tmp_path / "keys.toml"
    keys.write_text(FILE)
    settings = Settings(http_port=0, grpc_port=0, auth={"keys_file": keys})
    async with AnsweringRig() as rig:
        guard = ServerOptions.from_settings(settings).guard
        object.__setattr__(rig.entry._guard, "authenticator", guard.authenticator)
        await rig.gateways[0].sessions.create(schema.NewSession())  # of `local`
        async with Client(rig.entry.grpc_address, timeout=5, api_key=STUDIO) as client:
            assert await client.sessions() == [], "somebody else's"
            with pytest.raises(PermissionDenied, match=r"'key:studio'"):
                await client.admin.load_model("v2")
            with pytest.raises(PermissionDenied, match="admin"):
                await client.admin.drain()
        assert (await rig.http.get("/v1/sessions")).status_code == 401
        assert not rig.stopped.is_set()


async def test_a_node_that_does_not_answer_is_told():
    async with AnsweringRig() as rig:
        rig.gone.add("n2")
        refused = await rig.http.get("/v1/sessions")
        assert refused.status_code == 503 and "n2" in refused.json()["detail"]


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
        assert (await rig.http.get(f"/v1/sessions/{name}")).status_code == 421
        rig.link.away = True
        async with asyncio.timeout(20):
            while (health := await rig.http.get("/v1/health/ready")).status_code == 200:
                await asyncio.sleep(0.1)
        assert health.json()["away"]
        assert (await rig.http.get("/v1/health/live")).status_code == 200
        assert (await rig.http.post("/v1/sessions", json={})).status_code == 503
        assert (await rig.http.get(f"/v1/sessions/{name}")).status_code == 421
        new = await rig.http.get("/v1/sessions/session-ffffffffffff000000000000")
        assert new.status_code == 503, "it may live all the same"
        assert "wayfarer_cluster_directory_up 0.0" in (await rig.http.get("/metrics")).text


async def test_an_operator_sees_the_nodes_and_drains_one():
    async with Rig() as rig:
        targets = (await rig.http.get("/v1/cluster/targets")).json()
        assert {one["targets"][0] for one in targets} == {"127.0.0.1:2001", "127.0.0.1:2002"}
        assert {one["labels"]["node"] for one in targets} == {"n1", "n2"}
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
    entry = Entry(settings, Link(LeaseRules()), None, lambda: None)
    await entry.start()
    async with httpx.AsyncClient(base_url=entry.http_url) as http:
        for verb, path in (
            ("GET", "/v1/cluster"),
            ("GET", "/v1/cluster/targets"),
            ("POST", "/v1/sessions"),
        ):
            assert (await http.request(verb, path)).status_code == 401
        assert (await http.post("/v1/cluster/nodes/n1/drain")).status_code == 401
    await entry.stop()


async def test_nobody_is_sent_to_a_silent_node():
    """A call waits until it renews its lease; if it does not, the call fails within seconds."""
    async with Rig() as rig:
        stopped, other = rig.nodes
        name = await rig.owned(stopped)
        rig.stopped_nodes.add(stopped.name)
        await asyncio.sleep(SILENT_S + 0.5)
        asked = asyncio.create_task(rig.http.get(f"/v1/sessions/{name}"))
        new = [await rig.http.post("/v1/sessions", json={}) for _ in range(8)]
        assert {one.json()["endpoint"]["http_port"] for one in new} == {other.http_port}
        assert not asked.done()
        rig.stopped_nodes.clear()
        answer = await asked
        assert answer.json()["endpoint"]["http_port"] == stopped.http_port
        rig.stopped_nodes.add(stopped.name)
        await asyncio.sleep(SILENT_S + 0.5)
        answer = await rig.http.get(f"/v1/sessions/{name}", timeout=30)
        assert answer.status_code == 503 and "is silent" in answer.text


async def test_a_call_about_what_is_being_adopted_waits_for_the_node_that_gets_it():
    async with Rig() as rig:
        gone, adopter = rig.nodes[1], rig.nodes[0]
        name = await rig.owned(gone)
        directory = rig.link.directory
        directory._nodes[gone.name].keepers = (adopter.name,)
        directory.ended(gone.name)
        await asyncio.sleep(0.4)  # the entry has seen it
        asked = asyncio.create_task(rig.http.get(f"/v1/sessions/{name}"))
        await asyncio.sleep(0.4)
        assert not asked.done()
        epoch = directory._groups[GROUP].epoch
        assert directory.claim(GROUP, adopter.name, epoch, adopter.name)
        answer = await asked
        assert answer.status_code == 421
        assert answer.json()["endpoint"]["http_port"] == adopter.http_port
