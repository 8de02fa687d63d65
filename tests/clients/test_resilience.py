"""The Python client under lost connections, refusals, and quicker clients."""

import asyncio
import copy

import grpc
import pytest
from google.protobuf.duration_pb2 import Duration
from google.rpc.error_details_pb2 import QuotaFailure, RetryInfo

import wayfarer_client as wf
from tests.clients.fake_server import ASKED, FOREVER, Refusal
from tests.clients.replies import GONE, HEADER, HEARTBEAT, batch, event, moved, new_session, resumed
from wayfarer_client.v1 import goal_pb2, motion_pb2, session_pb2

# streams


async def test_a_lost_stream_goes_on_where_it_was(server, client):
    session = await client.create_session()
    server.scripts["StreamMotion"] = [
        [HEADER, batch("t0", 0, flags=1), batch("t1", 1, added=False), GONE],
        [GONE],
        [resumed(), batch("t2", 2, added=False), batch("t3", 3, added=False)],
    ]
    stream = session.stream(format=wf.PoseFormat("smallest_three", fps=20), slow_reader="hold")
    batches = [found async for found in stream]
    assert [found.resume_token for found in batches] == ["t0", "t1", "t2", "t3"]
    assert [frames.seq for found in batches for frames in found] == [0, 1, 2, 3]
    assert [len(found.added) for found in batches] == [1, 0, 0, 0]
    asked = server.asked("StreamMotion")
    assert [request.resume_token for request in asked] == ["", "t1", "t1"]
    assert asked[2].format.encoding == motion_pb2.POSE_ENCODING_SMALLEST_THREE
    assert (asked[2].format.fps, asked[2].slow_reader) == (20, motion_pb2.SLOW_READER_HOLD)
    assert stream.reconnections == 2 and stream.resume_token == "t3"
    assert [found.resumed_at is None for found in batches] == [True, True, False, False]
    assert stream.info.resumed and stream.info.bones == ("pelvis", "left_hip")


async def test_a_gap_is_told(server, client):
    session = await client.create_session()
    told = event(motion_pb2.EVENT_KIND_GAP, at_us=2_000_000, detail="3.2 s are lost")
    server.scripts["StreamMotion"] = [
        [HEADER, batch("t0"), GONE],
        [HEADER, told, batch("t9", 16, flags=8)],
    ]
    first, gap, later = [found async for found in session.stream()]
    assert first.events == () and gap.frames == ()
    assert (gap.events[0].kind, gap.events[0].detail) == ("gap", "3.2 s are lost")
    assert gap.events[0].at == 2.0 and gap.events[0].agent is None
    assert later.frames[0].flags == wf.Flag.GAP
    assert len(later.added) == 1  # the stream began again: agents are introduced again


async def test_events_name_their_agent(server, client):
    session = await client.create_session()
    kind = motion_pb2.EVENT_KIND_GOAL_REACHED
    server.scripts["StreamMotion"] = [
        [
            HEADER,
            batch("t0"),
            event(kind, agent_id="a-1", alias=1, goal_revision=4, waypoint=2),
            event(99),
        ]
    ]
    _, reached, unknown = [found async for found in session.stream()]
    (found,) = reached.events
    assert (found.kind, found.agent.name) == ("goal_reached", "Ada")
    assert (found.goal_revision, found.waypoint) == (4, 2)
    assert unknown.events[0].kind == ""  # of a later version: no reason to stop


async def test_a_session_that_is_no_more_is_told(server, client):
    session = await client.create_session()
    server.scripts["StreamMotion"] = [
        [HEADER, batch("t0"), GONE],
        [Refusal(grpc.StatusCode.NOT_FOUND, "no session 's'")],
    ]
    stream = session.stream()
    await anext(stream)
    with pytest.raises(wf.NotFound, match="no session 's'"):
        await anext(stream)


async def test_a_reader_that_was_cut_off_comes_back(server, client):
    """This works also while the server still counts the lost stream."""
    session = await client.create_session()
    full = Refusal(grpc.StatusCode.RESOURCE_EXHAUSTED, "too slow, or too many streams")
    server.scripts["StreamMotion"] = [[HEADER, batch("t0"), full], [full], [resumed(), batch("t1")]]
    stream = session.stream(slow_reader="disconnect")
    assert [found.resume_token async for found in stream] == ["t0", "t1"]
    server.scripts["StreamMotion"] = [[full]]
    with pytest.raises(wf.ResourceExhausted):  # the first time it is an answer
        await anext(session.stream())


async def test_a_silent_stream_is_given_up_a_speaking_one_is_kept(server, client, monkeypatch):
    monkeypatch.setattr("wayfarer_client.stream.SILENCE_S", 0.3)
    session = await client.create_session()

    def slowly(_):
        return HEARTBEAT

    server.scripts["StreamMotion"] = [
        [HEADER, batch("t0"), slowly, FOREVER],
        [resumed(), batch("t1")],
    ]
    assert [found.resume_token async for found in session.stream()] == ["t0", "t1"]


async def test_a_stream_gives_up_after_its_deadline(server, client):
    session = await client.create_session()
    server.scripts["StreamMotion"] = [[GONE] for _ in range(50)]
    with pytest.raises(wf.Unavailable, match=r"no stream for 0\.5 s: the server is shutting down"):
        await anext(session.stream(deadline=0.5))


async def test_an_encoding_of_the_future_is_refused(server, client):
    session = await client.create_session()
    strange = motion_pb2.StreamMotionResponse(header=motion_pb2.StreamHeader(pose_encoding=77))
    server.scripts["StreamMotion"] = [[strange]]
    with pytest.raises(wf.WayfarerError, match="pose encoding 77"):
        await anext(session.stream())


# control


async def test_batches_that_nobody_takes_are_bounded_and_told(server, client):
    session = await client.create_session()
    sent = [moved(batch(f"t{seq}", seq)) for seq in range(100)]
    server.scripts["Control"] = [[ASKED, moved(HEADER), *sent]]
    async with session.control() as control:
        while control.resume_token != "t99":
            await asyncio.sleep(0.01)
        found = [batch async for batch in control]
    assert len(found) <= 65 and found[-1].frames[0].seq == 99
    assert any(event.kind == "gap" for batch in found for event in batch.events)


# sessions, creation, refusals


async def test_the_lease_is_renewed_until_the_end(server, client):
    async with await client.create_session(lease=0.3) as session:
        while len(server.asked("RenewSession")) < 2:
            await asyncio.sleep(0.01)
    renewed = len(server.asked("RenewSession"))
    assert [request.session_id for request in server.asked("DeleteSession")] == ["s"]
    await asyncio.sleep(0.25)
    assert len(server.asked("RenewSession")) == renewed
    assert session.lease_s == pytest.approx(0.3)


async def test_renewing_outlives_refusals_but_not_the_session(server, client):
    busy = Refusal(grpc.StatusCode.RESOURCE_EXHAUSTED, "100 calls per second")
    refusals = [GONE, busy, Refusal(grpc.StatusCode.NOT_FOUND, "no session")]

    def renew(_):
        raise refusals.pop(0)

    server.answers["RenewSession"] = renew
    async with await client.create_session(lease=0.15):
        while refusals:
            await asyncio.sleep(0.01)
        await asyncio.sleep(0.2)
    assert len(server.asked("RenewSession")) == 3


async def test_a_session_that_was_joined_lives_on(server, client):
    session = session_pb2.Session(session_id="s", lease_s=60)
    server.answers["GetSession"] = lambda _: session_pb2.GetSessionResponse(session=session)
    async with await client.session("s") as joined:
        assert not joined.owned
    assert server.asked("DeleteSession") == []


async def test_a_create_is_sent_again_under_the_same_id(server, client):
    failing = [GONE, GONE]

    def create(request):
        if failing:
            raise failing.pop()
        return new_session(request)

    server.answers["CreateSession"] = create
    await client.create_session("unity", seed=0, record=True, lock_step=True)
    ids = [request.request_id for request in server.asked("CreateSession")]
    assert len(ids) == 3 and len(set(ids)) == 1 and len(ids[0]) == 36
    request = server.asked("CreateSession")[0]
    assert request.HasField("seed") and request.record and request.lock_step
    assert not request.HasField("lease_s")


async def test_other_calls_are_not_sent_again(server, client):
    def refuse(_):
        raise GONE

    server.answers["SetGoal"] = refuse
    session = await client.create_session()
    with pytest.raises(wf.Unavailable):
        await session.set_goal("a", (0, 0, 0))
    assert len(server.asked("SetGoal")) == 1


# temporary refusals


def busy(seconds: float) -> Refusal:
    delay = Duration()
    delay.FromMilliseconds(round(1000 * seconds))
    details = (QuotaFailure(), RetryInfo(retry_delay=delay))
    return Refusal(grpc.StatusCode.RESOURCE_EXHAUSTED, "no room", details)


def refusing(server, method: str, refusals: list[Refusal]) -> None:
    """The first calls are refused."""

    def answer(_):
        if refusals:
            raise refusals.pop(0)
        return getattr(goal_pb2, f"{method}Response")(revision=3)

    server.answers[method] = answer


async def test_a_call_that_is_refused_for_now_is_sent_again(server, client):
    session = await client.create_session()
    refusing(server, "SetGoal", [busy(0.1), busy(0.2)])
    started = asyncio.get_running_loop().time()
    assert await session.set_goal("a", (0, 0, 0)) == 3
    assert asyncio.get_running_loop().time() - started >= 0.3
    assert len(server.asked("SetGoal")) == 3


async def test_but_not_for_longer_than_the_timeout_nor_without_a_time(server):
    async with wf.Client(server.address, timeout=1.0) as client:
        session = await client.create_session()
        for refusals, most in (
            ([busy(0.3)] * 20, 4),
            ([busy(60.0)], 1),
            ([Refusal(grpc.StatusCode.RESOURCE_EXHAUSTED, "too many agents")], 1),
        ):
            server.requests.clear()
            refusing(server, "SetGoal", refusals)
            with pytest.raises(wf.ResourceExhausted):
                await session.set_goal("a", (0, 0, 0))
            assert 1 <= len(server.asked("SetGoal")) <= most


async def test_a_first_stream_and_a_clip_come_again_too(server, client):
    session = await client.create_session()
    server.scripts["StreamMotion"] = [[busy(0.1)], [HEADER, batch("t0")]]
    assert [found.resume_token async for found in session.stream()] == ["t0"]
    clip = motion_pb2.GenerateClipResponse(header=HEADER.header)
    server.scripts["GenerateClip"] = [[busy(0.1)], [clip]]
    assert [found async for found in client.generate_clip(wf.AgentSpec(), (), 1.0)] == []
    assert len(server.asked("GenerateClip")) == 2


async def test_the_synchronous_client_comes_again(server):
    refusing(server, "SetGoal", [busy(0.1)])

    def use() -> int:
        with wf.SyncClient(server.address) as client:
            return client.create_session().set_goal("a", (0, 0, 0))

    assert await asyncio.to_thread(use) == 3
    assert len(server.asked("SetGoal")) == 2


# errors before anything is sent


@pytest.mark.parametrize("place", [(1.0, 2.0), (), (1, 2, 3, 4), [1.0]])
async def test_a_place_has_three_numbers(server, client, place):
    session = await client.create_session()
    for call in (
        lambda: session.set_goal("a", place),
        lambda: session.set_path("a", [wf.Goal(place)]),
        lambda: session.wander("a", place, 2.0),
        lambda: session.create_agents(wf.AgentSpec(position=place)),
    ):
        with pytest.raises(wf.InvalidArgument, match=rf"has {len(place)} numbers; a place has"):
            await call()
    assert [name for name, _ in server.requests] == ["CreateSession"]


async def test_a_goal_and_loose_fields_are_not_mixed(client):
    session = await client.create_session()
    with pytest.raises(wf.InvalidArgument, match="speed, dwell: a Goal says itself"):
        await session.set_goal("a", wf.Goal((0, 0, 0)), speed=1.0, dwell=2.0)
    with pytest.raises(TypeError, match=r"no sped; beside its place it has radius, speed, heading"):
        await session.set_goal("a", (0, 0, 0), sped=1.0)


def test_a_goal_is_its_message():
    """A goal takes all fields of the contract, by position or name."""
    goal = wf.Goal((1, 2, 3), 0.5, speed=1.25)
    assert (goal.position, goal.radius, goal.speed, goal.dwell) == ((1, 2, 3), 0.5, 1.25, None)
    assert goal == copy.deepcopy(goal) and hash(goal) == hash(copy.copy(goal))
    assert (
        goal != wf.Goal((1, 2, 3)) and repr(goal) == "Goal((1.0, 2.0, 3.0), radius=0.5, speed=1.25)"
    )
    with pytest.raises(AttributeError, match="sped"):
        goal.sped  # noqa: B018
    with pytest.raises(AttributeError, match="speed"):
        goal.speed = 1.0


async def test_wandering_all_over_or_in_a_disc(server, client):
    session = await client.create_session()
    await session.wander("a", dwell=1.0)
    await session.wander("a", (1, 0, 2), 3.0)
    roam, disc = server.asked("Wander")
    assert not roam.HasField("area") and roam.dwell == 1.0
    assert disc.area.radius == 3.0
    with pytest.raises(wf.InvalidArgument, match="center and radius belong together"):
        await session.wander("a", (1, 0, 2))
