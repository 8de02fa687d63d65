"""Events to readers: goals reached, paths done, and others."""

import pytest

from tests.runtime.chunks import chunk, info, together
from tests.runtime.streams.stage import ARRIVED, Stage, kinds, take
from wayfarer.config.limits import Limits
from wayfarer.runtime.streams.publications import Resume
from wayfarer.world.agents.agent import AgentSpec, AgentState, SessionSpec
from wayfarer.world.agents.goal import Goal
from wayfarer.world.agents.records import AgentRecord, SessionRecord
from wayfarer.world.agents.slots import Mode, Motion
from wayfarer.world.events import Event, EventKind
from wayfarer.world.output.ground import Footing


def goal_chunk(seq, **values):
    return chunk(seq, **{"goal_revision": 1, "state": AgentState.WALKING, **values})


async def told(stage, *chunks):
    """Position, kind and waypoint of every event that goes with these chunks."""
    stage.settings = Limits(queue_s=10.0)
    reader = await stage.subscribe()
    for each in chunks:
        stage.publisher.publish("s", together(each))
    stage.publisher.flush()
    return [
        (p.position, e.kind, e.waypoint) for p in await take(reader, len(chunks)) for e in p.events
    ]


async def test_a_goal_to_stop_at_is_reached_and_its_path_done_at_the_stand():
    stopping = {"state": AgentState.STOPPING}
    standing = {"state": AgentState.STANDING}
    events = await told(
        Stage(),
        goal_chunk(0),
        goal_chunk(1, flags=ARRIVED),
        goal_chunk(2, **stopping),
        goal_chunk(3, **standing),
        goal_chunk(4, **standing),
    )
    assert events == [(2, EventKind.GOAL_REACHED, 0), (4, EventKind.PATH_DONE, 0)]


async def test_a_goal_reached_in_a_stand_is_done_at_once():
    events = await told(Stage(), goal_chunk(0, flags=ARRIVED, state=AgentState.STANDING))
    assert [kind for _, kind, _ in events] == [EventKind.GOAL_REACHED, EventKind.PATH_DONE]


async def test_the_last_goal_passed_ends_the_path_at_once_and_others_do_not():
    stage = Stage()
    path = tuple(Goal((x, 0.0, 0.0), stop=False) for x in (1.0, 2.0))
    stage.info = info(path=path, waypoint=1)
    events = await told(
        stage,
        goal_chunk(0, flags=ARRIVED, waypoint=0),
        goal_chunk(1, waypoint=1),
        goal_chunk(2, flags=ARRIVED, waypoint=1),
        goal_chunk(3, waypoint=1, state=AgentState.STANDING),
    )
    reached, done = EventKind.GOAL_REACHED, EventKind.PATH_DONE
    assert events == [(1, reached, 0), (3, reached, 1), (3, done, 1)]


async def test_a_goal_given_before_the_stand_leaves_the_old_path_undone():
    stage = Stage()
    reader = await stage.subscribe()
    stage.publisher.publish("s", together(goal_chunk(0, flags=ARRIVED)))
    stage.info = info(revision=2)
    stage.publisher.publish("s", together(goal_chunk(1, goal_revision=2)))
    stage.publisher.publish(
        "s", together(goal_chunk(2, goal_revision=2, state=AgentState.STANDING))
    )
    stage.publisher.flush()
    assert [kinds(p) for p in await take(reader, 3)] == [[EventKind.GOAL_REACHED], [], []]


def record(mode, arrived=True, stop=True):
    """The record of a session whose one agent, "a", is at its only goal, revision 1."""
    motion, goal = Motion.empty(1), Goal((1.0, 0.0, 0.0), stop=stop)
    motion.gait.mode[0], motion.gait.arrived[0] = mode, arrived
    agent = AgentRecord(
        agent_id="a",
        alias=1,
        spec=AgentSpec(),
        created_at=0.0,
        seq=7,
        motion=motion,
        footing=Footing.empty(1),
        goal_revision=1,
        path=(goal,),
        passed=0,
        path_start=(0.0, 0.0),
        behaviour=None,
    )
    return SessionRecord("s", SessionSpec(), 0.0, 1, (agent,))


@pytest.mark.parametrize(
    ("record", "done"),
    [
        (record(Mode.STOPPING), True),
        (record(Mode.TURNING), True),
        (record(Mode.STANDING), False),  # reported before it moved to this server
        (record(Mode.WALKING, arrived=False), False),
        (record(Mode.STOPPING, stop=False), False),
    ],
)
async def test_an_agent_that_came_on_its_last_steps_ends_its_path(record, done):
    stage = Stage()
    stage.publisher.adopt(record)
    events = await told(stage, goal_chunk(7), goal_chunk(8, state=AgentState.STANDING))
    assert events == [(2, EventKind.PATH_DONE, 0)] * done


async def test_events_of_other_origin_have_positions_and_are_resumed():
    stage = Stage()
    first = await stage.subscribe()
    event = Event(EventKind.MODEL_CHANGED, 5.0, "a", detail="moved")
    stage.publisher.tell("s", [event])
    await stage.walk(1)
    alone, walk = await take(first, 2)
    assert alone.events == (event,) and not alone.chunks and alone.scheduled_at == 5.0
    assert (alone.position, walk.position) == (1, 2)
    again = await stage.subscribe(resume=Resume(first.epoch, 0))
    assert (await take(again, 1))[0].events == (event,)
