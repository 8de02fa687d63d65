import pytest

from tests.transport.fakes import FakeService, opened
from tests.transport.gateway.calls import GOAL, called_by, caller, session, session_of_two
from wayfarer.config.limits import Limits
from wayfarer.errors import AlreadyExists, InvalidArgument, ResourceExhausted
from wayfarer.transport import schema
from wayfarer.transport.conversion.basis import Basis
from wayfarer.transport.edge.caller import Quota
from wayfarer.transport.gateway.snapshots import MARK


async def test_a_session_moves_to_another_server_and_to_another_owner():
    here, there = await opened(), await opened()
    with called_by(caller("ada")):
        session_id, (agent, _) = await session_of_two(here, basis=Basis.ROS, lease_s=7)
        snapshot = await here.snapshots.export_session(session_id)
    with called_by(caller("bob")):
        moved = await there.snapshots.import_session(snapshot)
        assert moved.session_id == session_id and moved.basis.basis == "ros"
        assert moved.lease_s == 7 and agent.agent_id in moved.agent_ids
        await there.goals.set_goal(agent.agent_id, GOAL)
        with pytest.raises(AlreadyExists):
            await there.snapshots.import_session(snapshot)
    assert len(await names(there, "bob")) == 1 and await names(there, "ada") == []


async def names(api, who: str) -> list[str]:
    with called_by(caller(who)):
        return [s.session_id for s in (await api.sessions.list_own()).sessions]


async def test_an_import_counts_against_the_limits_of_its_caller():
    here = await opened()
    session_id, _ = await session_of_two(here)
    snapshot = await here.snapshots.export_session(session_id)
    service = FakeService()
    there = await opened(service, Limits(sessions_per_caller=1))
    who = caller("bob", quota=Quota(agents=1))
    with called_by(who), pytest.raises(ResourceExhausted, match="may have 1; 2 more"):
        await there.snapshots.import_session(snapshot)
    assert await service.list_sessions() == []
    await session(there)
    with pytest.raises(ResourceExhausted, match="1 sessions"):
        await there.snapshots.import_session(snapshot)


async def test_a_log_is_replayed_in_the_basis_of_its_session(api):
    session_id, _ = await session_of_two(api, basis=Basis.UNREAL, record=True)
    log = await api.snapshots.export_log(session_id)
    pose_format = schema.PoseFormat(profile="full")
    header, *batches = [m async for m in api.snapshots.replay(log, pose_format)]
    assert header.header.basis.metres_per_unit == 0.01 and len(header.header.bones) == 52
    assert [seq for b in batches for seq in b.batch.chunks.seqs] == [0, 1]
    assert len(batches[0].batch.added) == 1


@pytest.mark.parametrize(
    "log", [b"", b"x", MARK, MARK + b"maya\nlog of x", MARK + b"gltf\nx", b"\xff"]
)
async def test_a_malformed_log_is_refused(log, api):
    with pytest.raises(InvalidArgument) as caught:
        await anext(api.snapshots.replay(log, schema.PoseFormat()))
    assert caught.value.field == "log"
