"""`GET /v1/events`, as a browser's EventSource reads it."""

import json
from contextlib import asynccontextmanager

import pytest

from tests.runtime.running import until
from tests.transport.samples import NOW
from wayfarer.errors import Metres, Place
from wayfarer.world.events import Event, EventKind

REACHED = Event(EventKind.GOAL_REACHED, NOW, "agent-2", 1, 3, 4, "there")
DONE = Event(EventKind.PATH_DONE, NOW, "agent-2", 1, 3, 4)


@asynccontextmanager
async def reading(rig, session_id: str, **headers: str):
    """Blocks of a running answer, comments included."""

    async def blocks():
        block = []
        async for line in answer.aiter_lines():
            if line:
                block.append(line)
            elif block:
                yield block
                block = []

    path = f"/v1/events?session={session_id}"
    async with rig.http.stream("GET", path, headers=headers) as answer:
        assert answer.status_code == 200
        assert answer.headers["content-type"].startswith("text/event-stream")
        yield blocks()


def fields(block: list[str]) -> dict[str, str]:
    return dict(line.split(": ", 1) for line in block)


async def test_events_come_with_ids_that_resume(rig):
    session_id, _ = await rig.session()
    async with reading(rig, session_id) as blocks:
        assert await anext(blocks) == [":"]  # at once: the answer has begun
        rig.service.emit(session_id, REACHED, DONE)
        first = fields(await anext(blocks))
        assert first["event"] == "goal_reached"
        assert json.loads(first["data"]) == {
            "kind": "goal_reached",
            "agent_id": "agent-2",
            "alias": 1,
            "at_us": round(NOW * 1e6),
            "goal_revision": 3,
            "waypoint": 4,
            "detail": "there",
        }
    await until(lambda: rig.service.subscriptions[0].closed)  # the reader has left
    async with reading(rig, session_id, **{"last-event-id": first["id"]}) as blocks:
        assert await anext(blocks) == [":"]
        assert fields(await anext(blocks))["event"] == "path_done"


async def test_a_quiet_session_gives_signs_of_life(rig, monkeypatch):
    monkeypatch.setattr("wayfarer.transport.streams.stream.HEARTBEAT_S", 0.01)
    session_id, _ = await rig.session()
    async with reading(rig, session_id) as blocks:
        assert [await anext(blocks) for _ in range(3)] == [[":"]] * 3


async def test_a_session_whose_agents_move_without_events_gives_signs_of_life(rig, monkeypatch):
    monkeypatch.setattr("wayfarer.transport.streams.stream.HEARTBEAT_S", 10.0)
    session_id, _ = await rig.session()
    async with reading(rig, session_id) as blocks:
        assert await anext(blocks) == [":"]
        rig.clock.now += 10
        rig.service.emit(session_id)
        rig.service.emit(session_id, REACHED)
        assert await anext(blocks) == [":"]
        assert fields(await anext(blocks))["event"] == "goal_reached"
        rig.clock.now += 9
        rig.service.emit(session_id)
        rig.service.emit(session_id, DONE)
        assert fields(await anext(blocks))["event"] == "path_done"


async def test_events_end_with_their_session(rig):
    session_id, _ = await rig.session()
    async with reading(rig, session_id) as blocks:
        await anext(blocks)
        await rig.http.delete(f"/v1/sessions/{session_id}")
        assert [block async for block in blocks if block != [":"]] == []


async def test_why_events_end_is_told(rig):
    session_id, _ = await rig.session()
    async with reading(rig, session_id) as blocks:
        await anext(blocks)
        await rig.gateway.drain(5.0)
        draining, problem = [fields(block) async for block in blocks if block != [":"]]
    assert draining["event"] == "draining" and "id" not in draining
    assert problem["event"] == "problem" and json.loads(problem["data"])["status"] == 503


MOVED = Event(
    EventKind.GOAL_MOVED,
    NOW,
    "agent-2",
    1,
    3,
    4,
    "the nearest is {} from it: {}",
    (Metres(0.5), Place((-9.69, 2.0, 0.0))),
)


@pytest.mark.parametrize(
    ("basis", "text"),
    [
        ("gltf", "the nearest is 0.5 m from it: (9.69, 0, 2)"),
        ("unreal", "the nearest is 50 cm from it: (200, -969, 0)"),
        ("blender", "the nearest is 0.5 m from it: (9.69, -2, 0)"),
    ],
)
async def test_places_in_an_event_are_in_the_sessions_basis_and_unit(rig, basis, text):
    session = await rig.http.post("/v1/sessions", json={"basis": basis})
    session_id = session.json()["session_id"]
    async with reading(rig, session_id) as blocks:
        assert await anext(blocks) == [":"]
        rig.service.emit(session_id, MOVED)
        assert json.loads(fields(await anext(blocks))["data"])["detail"] == text
