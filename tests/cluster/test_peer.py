"""What nodes send each other arrives, however many sessions share a group."""

import pytest

from tests.cluster.nodes import info
from wayfarer.cluster.peer import Peers, PeerServer, Replicas
from wayfarer.errors import InvalidArgument, PermissionDenied

SECRET = "s" * 64


async def test_a_group_of_many_sessions_arrives():
    taken = []

    async def take(owner, group, epoch, live):
        taken.append((owner, group, epoch, live))

    live = {f"session-00ff{i:012x}": b"%d" % i for i in range(2000)}
    server, peers = PeerServer("127.0.0.1", SECRET, Replicas(), take, None, None), Peers(SECRET)
    await server.start()
    node = info("n2").model_copy(update={"peer_port": server.port})
    await peers.take(node, "n1", "00ff", 7, live)
    assert taken == [("n1", "00ff", 7, live)]
    await peers.forget_others(set())
    await server.stop()


@pytest.mark.parametrize(
    "body", [b"", b"\x02\0\0", b"\xff\0\0\0{}", b"\x02\0\0\0[]", b"\x02\0\0\0{}"]
)
async def test_what_is_no_call_is_refused(body):
    server = PeerServer("127.0.0.1", SECRET, Replicas(), None, None, None)
    shown = {"authorization": f"Bearer {SECRET}"}
    with pytest.raises(InvalidArgument, match="not a call of a node"):
        await server.handle("Take", body, shown)
    with pytest.raises(PermissionDenied):
        await server.handle("Take", body, {})
    await server.stop()
