"""Three nodes on Ray: what clients see of a cluster."""

import asyncio
import shutil
import subprocess
import time
from pathlib import Path

import httpx
import numpy as np
import pytest

from tests.cluster.local import LocalCluster
from tests.serving import needs_ray
from wayfarer.ids import group_of
from wayfarer_client import AgentSpec, Box, Client, Flag, Floor, Goal

pytestmark = [pytest.mark.slow, needs_ray]


class Watcher:
    """Follows one person who walks, over whatever happens."""

    def __init__(self, session, agent):
        self.session, self.agent = session, agent
        self.events, self.flags = [], []
        self.seqs = []  # of the chunks
        self.places = []  # of the hips at these
        self.heard_at = []
        self.failed = None
        self.task = asyncio.create_task(self._follow())

    @classmethod
    async def of(cls, client, scene=""):
        session = await client.create_session(lease=900, scene=scene)
        (agent,) = await session.create_agents(AgentSpec())
        await session.set_goal(agent, Goal((0.0, 0.0, 300.0)))
        return cls(session, agent)

    async def _follow(self):
        async with self.session.stream(deadline=30) as self.stream:
            async for batch in self.stream:
                self.events += [event.kind for event in batch.events]
                for frames in batch.frames:
                    self.flags.append(frames.flags)
                    self.seqs.append(frames.seq)
                    self.places.append(frames.translation[0])
                    self.heard_at.append(time.monotonic())

    @property
    def group(self):
        return group_of(self.session.session_id)

    async def goes_on(self, chunks=5):
        """Wait until so many more have come."""
        wanted = len(self.seqs) + chunks
        ends_at = time.monotonic() + 30
        while len(self.seqs) < wanted:
            if self.task.done():
                self.task.result()
                pytest.fail("the stream has ended as if the session had")
            if time.monotonic() > ends_at:
                agent = await self.session.agent(self.agent)
                pytest.fail(
                    f"{wanted - len(self.seqs)} chunks of {agent} are missing, after "
                    f"{self.seqs[-1:]}, {self.events}, {self.stream.resume_token}"
                )
            await asyncio.sleep(0.02)

    def clear(self):
        for seen in (self.events, self.flags, self.seqs, self.places, self.heard_at):
            seen.clear()

    async def close(self):
        self.task.cancel()
        await asyncio.gather(self.task, return_exceptions=True)


class Stepped:
    """Two people in lock-step, in a scene; what they do is what the same people do elsewhere."""

    @classmethod
    async def of(cls, client, scene):
        self = cls()
        self.twins = [
            await client.create_session(lease=900, lock_step=True, scene=where)
            for where in (scene, scene)
        ]
        for session in self.twins:
            people = [AgentSpec(seed=seed, position=(2, 0, 3 * seed)) for seed in (1, 2)]
            for agent in await session.create_agents(*people):
                await session.set_goal(agent, Goal((2.0, 0.0, 200.0)))
        self.steps = []
        return self

    async def goes_on(self):
        """Both make the same step, and it is the next one."""
        (batch,), (other,) = [await session.step() for session in self.twins]
        for one, same in zip(batch.frames, other.frames, strict=True):
            assert np.array_equal(one.rotations, same.rotations)
            assert np.array_equal(one.times, same.times)
        self.steps.append([(frames.seq, frames.times[0]) for frames in batch.frames])
        assert np.allclose(np.diff(self.steps, axis=0), (1, 0.2)), self.steps


async def test_people_live_on_whatever_happens_to_a_node(record_testsuite_property):
    async with LocalCluster() as cluster, Client(cluster.entry.grpc_address) as client:
        corners = [(-3, 0, -3), (3, 0, -3), (3, 0, 310), (-3, 0, 310)]
        field = await client.scenes.create([Floor(corners)])
        version = field.message.version
        stepped = await Stepped.of(client, field.scene_id)
        idle = [await client.create_session(lease=900) for _ in range(52)]
        watched = [await Watcher.of(client) for _ in range(5)]
        watched.append(await Watcher.of(client, field.scene_id))
        everybody = [*idle, *stepped.twins, *(one.session for one in watched)]
        # those in lock-step are no load in real time
        status = await cluster.until(lambda s: sum(n.load.sessions for n in s.nodes) == 58)
        counts = [node.load.sessions for node in status.nodes]
        assert all(16 <= count <= 24 for count in counts), counts
        for one in watched:
            await one.goes_on()
        await asyncio.to_thread(javascript_follows, cluster.entry.http_url)

        async def all_go_on():
            nonlocal version
            for session in everybody:
                assert await session.renew() > 0
            await stepped.goes_on()
            crate = Box(position=(-2, 0, 100 + version), size=(0.5, 0.5, 0.5))
            version += 1
            assert await field.put("crate", crate) == version

        async def settle():
            """All go on, and the scene has been copied by the node that has it now."""
            await all_go_on()
            name, ends_at = await with_the_scene(cluster, watched), time.monotonic() + 120
            while time.monotonic() < ends_at:
                copied = [(line["timestamp"], line["node"]) for line in cluster.said()
                          if line.get("event") == "scene copied"]  # fmt: skip
                if name == max(copied, default=("", ""))[1]:
                    return
                await asyncio.sleep(0.2)
            pytest.fail(f"{name} has not copied its scene")

        await settle()
        await kill(cluster, watched, record_testsuite_property)
        await settle()
        await stop_for_long(cluster, watched)
        await settle()
        await drain(cluster, watched, record_testsuite_property)
        await all_go_on()
        await restart_entry(cluster, watched)
        for one in watched:
            await one.close()


JAVASCRIPT = """
import { Api } from "%s/clients/web/src/index.js";
const api = new Api(process.argv[1]);
const { session_id: id } = await api.createSession(60);
const agents = await api.createAgents(id, [{}]);
if (agents.length !== 1 || api.homeOf(id) === process.argv[1]) throw new Error(api.homeOf(id));
const other = new Api(process.argv[1]);
if ((await other.session(id)).session_id !== id) throw new Error("not found through the entry");
api.abandonSession(id);
"""


def javascript_follows(url):
    """As the Python client does, above."""
    if shutil.which("node") is None:
        return
    code = JAVASCRIPT % Path(__file__).parents[2]
    done = subprocess.run(
        ["node", "--input-type=module", "--eval", code, url], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr


def living_on(cluster, name, watched):
    """Those of the watched who live on this node."""
    view = cluster.entry.finder._view
    return [one for one in watched if view.owner(one.session.session_id).name == name]


async def with_the_scene(cluster, watched):
    """Name of the node that has the last of the watched, in a scene with those in lock-step."""
    await asyncio.sleep(0.5)  # the entry's view
    return cluster.entry.finder._view.owner(watched[-1].session.session_id).name


async def kill(cluster, watched, record_testsuite_property):
    name = await with_the_scene(cluster, watched)
    there = living_on(cluster, name, watched)
    await asyncio.sleep(1.5)  # all have been copied to the neighbour since they began to walk
    for one in watched:
        one.clear()
    victim = await cluster.process(name)
    killed_at = time.monotonic()
    victim.kill()
    for one in watched:
        await one.goes_on(10)
    for one in there:
        assert "gap" in one.events, "it is said that something was lost"
        assert any(flag & Flag.FIRST for flag in one.flags)
        steps = np.linalg.norm(np.diff(one.places, axis=0), axis=1)
        assert steps.max() < 4.0, "who walks on begins where they were a second or two ago"
    for one in watched:
        if one not in there:
            assert not one.events, "others do not notice"
    worst = max(np.diff([killed_at, *one.heard_at]).max() for one in there)
    record_testsuite_property("seconds_without_motion_after_a_kill", round(worst, 2))


def settled(status):
    return status.counters.get("adopted", 0) + status.counters.get("lost", 0)


async def stop_for_long(cluster, watched):
    name = await with_the_scene(cluster, watched)
    there = living_on(cluster, name, watched)
    process = await cluster.process(name)
    assert there
    process.suspend()
    # its groups are adopted; one in which a session came and went at once has nobody ("lost")
    status = await cluster.status()
    wanted = settled(status) + next(n.groups for n in status.nodes if n.node.name == name)
    await cluster.until(lambda s: settled(s) == wanted)
    process.resume()
    await cluster.until(lambda s: name in [n.node.name for n in s.nodes])
    for one in there:
        one.clear()
    for one in watched:
        await one.goes_on()
    logged = list(cluster.said())
    ended = [line["until"] for line in logged
             if line.get("event") == "lease ended" and line["node"] == name]  # fmt: skip
    assert ended, "it knows that its lease has ended"
    begun = {line["session_id"]: line["at"] for line in logged
             if line.get("event") == "session adopted"}  # fmt: skip
    for one in there:
        assert begun[one.session.session_id] >= ended[-1], "two owners at once"


async def drain(cluster, watched, record_testsuite_property):
    name = await with_the_scene(cluster, watched)
    there = living_on(cluster, name, watched)
    assert there
    for one in watched:
        one.clear()
    async with httpx.AsyncClient(base_url=cluster.entry.http_url) as http:
        answer = await http.post(f"/v1/cluster/nodes/{name}/drain")
        assert answer.status_code == 202, answer.text
    await cluster.until(lambda status: name not in [one.node.name for one in status.nodes])
    for one in watched:
        await one.goes_on(10)
        assert one.events == [], "nothing was lost"
        assert set(np.diff(one.seqs)) == {1}, "every primitive came, and once"
    worst = max(np.diff(one.heard_at).max() for one in there)
    record_testsuite_property("longest_wait_of_a_stream_during_a_drain_s", round(worst, 3))


async def restart_entry(cluster, watched):
    port = int(cluster.entry.grpc_address.rpartition(":")[2])
    for one in watched:
        one.clear()
    await cluster.entry.stop()
    for one in watched:
        await one.goes_on()
    settings = cluster.settings.model_copy(update={"grpc_port": port})
    cluster.entry = cluster.new_entry(settings)
    await cluster.entry.start()
    for one in watched:
        await one.goes_on()
        assert not one.events
        assert set(np.diff(one.seqs)) == {1}
    async with Client(cluster.entry.grpc_address) as client:
        joined = await client.session(watched[0].session.session_id)
        assert len(await joined.agents()) == 1
