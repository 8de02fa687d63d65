import asyncio

import pytest

from tests.transport.fakes import FakeService, gateway, opened
from tests.transport.gateway.calls import (
    GOAL,
    TWO,
    called_by,
    caller,
    session,
    session_of_two,
    stream,
)
from tests.transport.samples import NOW
from tests.world.fakes import ManualClock
from wayfarer.config.limits import Limits
from wayfarer.errors import InvalidArgument, NotFound, ResourceExhausted, Unavailable
from wayfarer.transport import schema
from wayfarer.transport.conversion.basis import Basis
from wayfarer.transport.edge.caller import Quota, Scope
from wayfarer.world.agents.agent import SessionSpec


async def test_each_session_keeps_its_basis(service, api):
    for basis in Basis:
        session_id = await session(api, basis)
        one = basis.axes.points_to_wire(basis.axes.points_to_core(basis.axes.forward))
        place = schema.Vector3(**dict(zip("xyz", one, strict=True)))
        request = schema.NewAgents(agents=[schema.AgentSpec(position=place)])
        (agent,) = (await api.agents.create(session_id, request)).agents
        expected = basis.axes.metres_per_unit  # one unit forward
        assert service.specs[-1].position == pytest.approx((0.0, expected))
        assert agent.position.model_dump() == pytest.approx(
            {**place.model_dump(), "xyz"[list(basis.axes.up).index(1)]: 0.9 / expected}
        )
        await api.goals.set_goal(agent.agent_id, schema.Goal(position=place))
        assert service.commands[-1][1].position == pytest.approx((0.0, expected, 0.0))
        assert (await api.sessions.get(session_id)).basis.basis == basis


async def test_unknown_ids_are_not_found(api):
    for call in (
        api.sessions.get("x"),
        api.sessions.renew("x"),
        api.sessions.delete("x"),
        api.agents.create("x", TWO),
        api.agents.list_of("x"),
        api.agents.get("x"),
        api.agents.update("x", schema.AgentUpdate()),
        api.agents.delete("x"),
        api.goals.set_goal("x", GOAL),
        api.motion.step("x", schema.StepRequest()),
        api.snapshots.export_session("x"),
        api.snapshots.export_log("x"),
        anext(stream(api, "x")),
    ):
        with pytest.raises(NotFound, match="'x'") as caught:
            await call
        assert (caught.value.kind, caught.value.name) in (("session", "x"), ("agent", "x"))


async def test_a_session_says_what_was_asked_for(api):
    request = schema.NewSession(basis="ros", seed=7, lease_s=5.5, lock_step=True, record=True)
    made = await api.sessions.create(request)
    assert (made.seed, made.lease_s, made.lock_step, made.record) == (7, 5.5, True, True)
    assert made.scene == "" and made.basis.basis == "ros"
    assert made.expires_at_us == round((NOW + 5.5) * 1e6)
    assert await api.sessions.get(made.session_id) == made


async def test_what_is_not_asked_for_has_a_default():
    made = [await (await opened()).sessions.create(schema.NewSession()) for _ in range(2)]
    assert made[0].lease_s == 60.0 and not made[0].record and not made[0].lock_step
    assert made[0].seed != made[1].seed  # drawn
    short = await opened(limits=Limits(lease_s=5))
    assert (await short.sessions.create(schema.NewSession())).lease_s == 5


async def test_a_lease_has_an_upper_limit_and_scenes_are_unknown():
    api = await opened(limits=Limits(lease_s=100))
    with pytest.raises(InvalidArgument, match="1 to 100 s, not 101") as caught:
        await session(api, lease_s=101)
    assert caught.value.field == "lease_s"
    with pytest.raises(NotFound, match="'flat'") as missing:
        await session(api, scene="flat")
    assert (missing.value.kind, missing.value.name) == ("scene", "flat")


async def test_nothing_starts_before_the_runtime_is_ready(service, api):
    session_id = await session(api)
    service.ready = False
    assert not api.ready
    for call in (
        api.sessions.create(schema.NewSession()),
        api.agents.create(session_id, TWO),
        api.snapshots.import_session(b""),
        anext(stream(api, session_id)),
    ):
        with pytest.raises(Unavailable, match="not ready"):
            await call


# leases


async def test_a_session_ends_a_lease_after_its_last_call(clock, api):
    idle, called, renewed = [await session(api, lease_s=60) for _ in range(3)]
    clock.now += 59
    await api.sessions.get(called)
    renewal = await api.sessions.renew(renewed)
    assert renewal.expires_at_us == round((clock.now + 60) * 1e6)
    clock.now += 2
    assert await api.end_expired_sessions() == [idle]
    with pytest.raises(NotFound):
        await api.sessions.get(idle)
    assert {s.session_id for s in (await api.sessions.list_own()).sessions} == {called, renewed}


async def test_calls_on_an_agent_renew_its_session(clock, api):
    session_id, (agent, _) = await session_of_two(api, lease_s=10)
    for call in (api.goals.set_goal, lambda a, _: api.agents.get(a)):
        clock.now += 9
        await call(agent.agent_id, GOAL)
    assert (await api.sessions.get(session_id)).expires_at_us == round((clock.now + 10) * 1e6)


async def test_listing_renews_nothing(clock, api):
    session_id = await session(api, lease_s=10)
    clock.now += 9
    await api.sessions.list_own()
    clock.now += 2
    assert await api.end_expired_sessions() == [session_id]


async def test_an_ended_lease_cannot_be_renewed_though_nobody_has_looked_yet(clock, api):
    session_id, (agent, _) = await session_of_two(api, lease_s=10)
    clock.now += 11
    for call in (api.sessions.renew(session_id), api.agents.get(agent.agent_id)):
        with pytest.raises(NotFound):
            await call


async def test_a_session_that_cannot_be_ended_now_is_kept_and_ended_later(service, clock, api):
    session_id = await session(api, lease_s=10)
    service.fail_with = Unavailable("the session is being moved; try again")
    with pytest.raises(Unavailable):
        await api.sessions.delete(session_id)
    assert api.moves.sessions == [session_id]
    await api.sessions.get(session_id)
    clock.now += 11
    service.fail_with = Unavailable("4096 commands are waiting already; try again")
    assert await api.end_expired_sessions() == []
    assert await api.end_expired_sessions() == [session_id]
    assert await service.list_sessions() == [] == api.moves.sessions


async def test_calls_may_come_while_a_session_ends(service, api):
    session_id, _ = await session_of_two(api)
    delete, going = service.delete_session, asyncio.Event()

    async def slowly(name: str) -> None:
        await going.wait()
        await delete(name)

    service.delete_session = slowly
    deletes = [asyncio.create_task(api.sessions.delete(session_id)) for _ in range(2)]
    await asyncio.sleep(0.01)
    service.slow = asyncio.Event()
    coming = asyncio.create_task(api.agents.create(session_id, TWO))
    await asyncio.sleep(0.01)
    going.set()
    first, second = await asyncio.gather(*deletes, return_exceptions=True)
    assert first is None and isinstance(second, NotFound)
    service.slow.set()
    late = (await coming).agents[0]
    for call in (api.sessions.get(session_id), api.goals.set_goal(late.agent_id, GOAL)):
        with pytest.raises(NotFound):
            await call
    assert not api._context.sessions._by_agent


async def test_a_session_may_come_again_before_its_end_is_known(service, api):
    session_id, (agent, _) = await session_of_two(api)
    snapshot = await api.snapshots.export_session(session_id)
    delete = service.delete_session

    async def known_late(name: str) -> None:
        await delete(name)
        service.delete_session = delete
        await api.snapshots.import_session(snapshot)

    service.delete_session = known_late
    await api.sessions.delete(session_id)
    assert (await api.sessions.get(session_id)).session_id == session_id
    assert (await api.agents.get(agent.agent_id)).agent_id == agent.agent_id


async def test_a_stream_keeps_its_session_and_its_end_begins_the_lease(clock, api):
    session_id = await session(api, lease_s=10)
    messages = stream(api, session_id)
    await anext(messages)
    clock.now += 1000
    assert await api.end_expired_sessions() == []
    (shown,) = (await api.sessions.list_own()).sessions
    assert shown.expires_at_us == round((clock.now + 10) * 1e6)
    await messages.aclose()
    clock.now += 9
    assert await api.end_expired_sessions() == []
    clock.now += 2
    assert await api.end_expired_sessions() == [session_id]


# callers


async def test_a_session_belongs_to_its_creator(api):
    with called_by(caller("ada")):
        session_id, (agent, _) = await session_of_two(api)
    with called_by(caller("eve")):
        for call in (
            api.sessions.get(session_id),
            api.sessions.delete(session_id),
            api.agents.get(agent.agent_id),
            api.goals.set_goal(agent.agent_id, GOAL),
            anext(stream(api, session_id)),
        ):
            with pytest.raises(NotFound):
                await call
        assert (await api.sessions.list_own()).sessions == ()
    for who in (caller("ada"), caller("root", *Scope)):
        with called_by(who):
            assert [s.session_id for s in (await api.sessions.list_own()).sessions] == [session_id]
            assert (await api.agents.get(agent.agent_id)).agent_id == agent.agent_id


async def test_a_caller_has_so_many_sessions_and_no_more():
    api = await opened(limits=Limits(sessions_per_caller=2))
    with called_by(caller("ada")):
        kept = [await session(api) for _ in range(2)]
        with pytest.raises(ResourceExhausted, match="'ada' has 2 sessions and may have 2"):
            await session(api)
        await api.sessions.delete(kept[0])
        await session(api)
    with called_by(caller("bob")):
        await session(api)
    who = caller("carl", quota=Quota(sessions=0))
    with called_by(who), pytest.raises(ResourceExhausted, match="may have 0"):
        await session(api)


async def test_quotas_of_agents_and_streams(api):
    with called_by(caller("ada", quota=Quota(agents=3, streams=1))):
        session_id, _ = await session_of_two(api)
        other = await session(api)
        with pytest.raises(ResourceExhausted, match="has 2 agents and may have 3; 2 more"):
            await api.agents.create(other, TWO)
        messages = stream(api, session_id)
        await anext(messages)
        with pytest.raises(ResourceExhausted, match="may have 1 streams"):
            await anext(stream(api, other))
        await messages.aclose()


async def test_limits_hold_for_calls_that_are_made_at_once(service, api):
    who = caller("ada", quota=Quota(sessions=2, agents=3))
    with called_by(who):
        service.slow = asyncio.Event()
        calls = [asyncio.create_task(session(api)) for _ in range(5)]
        await asyncio.sleep(0.01)
        service.slow.set()
        made = await asyncio.gather(*calls, return_exceptions=True)
        one, other = (each for each in made if isinstance(each, str))
        service.slow = asyncio.Event()
        calls = [asyncio.create_task(api.agents.create(s, TWO)) for s in (one, other, one)]
        await asyncio.sleep(0.01)
        service.slow.set()
        made = await asyncio.gather(*calls, return_exceptions=True)
        assert [isinstance(each, ResourceExhausted) for each in made] == [False, True, True]
        assert "has 2 agents and may have 3; 2 more" in str(made[1])


async def test_a_session_that_could_not_be_made_leaves_its_room(service):
    api = await opened(service, Limits(sessions_per_caller=1))
    create = service.create_session

    async def refuse(_: object) -> None:
        raise ResourceExhausted("full")

    for service.create_session in (refuse, refuse):
        with pytest.raises(ResourceExhausted, match="full"):
            await session(api)
    service.create_session = create
    await session(api)


async def test_limits_hold_for_sessions_that_are_imported_at_once(service, api):
    who = caller("ada", quota=Quota(sessions=1, agents=2))
    with called_by(who):
        session_id, _ = await session_of_two(api)
        snapshot = await api.snapshots.export_session(session_id)
        await api.sessions.delete(session_id)
        importing, going = service.import_session, asyncio.Event()

        async def slowly(*parts: object):
            await going.wait()
            return await importing(*parts)

        service.import_session = slowly
        calls = [asyncio.create_task(api.snapshots.import_session(snapshot)) for _ in range(2)]
        await asyncio.sleep(0.01)
        going.set()
        one, other = await asyncio.gather(*calls, return_exceptions=True)
        assert one.session_id == session_id
        assert "has 1 sessions and may have 1" in str(other)


# over a restart


async def test_sessions_of_the_journal_are_taken_over_with_a_fresh_lease():
    clock, service = ManualClock(NOW), FakeService()
    before = await opened(service, clock=clock)
    with called_by(caller("ada")):
        session_id, (agent, _) = await session_of_two(
            before, basis=Basis.UNREAL, lease_s=30, lock_step=True
        )
        then = await before.sessions.get(session_id)
    clock.now += 1000  # down for longer than the lease
    after = gateway(service, clock=clock)
    assert not after.ready
    await after.take_over()
    assert after.ready
    with called_by(caller("ada")):
        now = await after.sessions.get(session_id)
        assert now == then.model_copy(update={"expires_at_us": round((clock.now + 30) * 1e6)})
        await after.goals.set_goal(agent.agent_id, GOAL)
    with called_by(caller("eve")), pytest.raises(NotFound):
        await after.agents.get(agent.agent_id)


async def test_a_kept_session_that_is_not_the_transports_is_ended():
    service = FakeService()
    await service.create_session(SessionSpec(attributes={"basis": "maya"}))
    api = await opened(service)
    assert api.ready and await service.list_sessions() == []


async def test_a_caller_that_goes_away_leaves_no_session_behind_that_nobody_knows(service, api):
    service.slow = asyncio.Event()
    call = asyncio.create_task(session(api))
    await asyncio.sleep(0)
    await asyncio.sleep(0)
    call.cancel()
    with pytest.raises(asyncio.CancelledError):
        await call
    service.slow.set()
    async with asyncio.timeout(5):
        while not (await api.sessions.list_own()).sessions:
            await asyncio.sleep(0)
    (known,) = (await api.sessions.list_own()).sessions
    await api.sessions.delete(known.session_id)
    assert await service.list_sessions() == []
