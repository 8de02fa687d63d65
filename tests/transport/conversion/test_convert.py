import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.transport.samples import NOW
from wayfarer.body.phenotype import height_of
from wayfarer.errors import InvalidArgument
from wayfarer.runtime.stats import LoopStats
from wayfarer.runtime.streams.publications import SlowReader
from wayfarer.transport import schema
from wayfarer.transport.codec import PoseEncoding, PoseProfile
from wayfarer.transport.conversion import convert, wire
from wayfarer.transport.conversion.basis import Basis
from wayfarer.transport.conversion.bodies import BodyLibrary
from wayfarer.transport.conversion.units import in_world
from wayfarer.v1 import (
    agent_pb2,
    common_pb2,
    goal_pb2,
    motion_pb2,
    scene_pb2,
)
from wayfarer.world.agents.agent import AgentInfo, AgentSpec, AgentState
from wayfarer.world.agents.goal import Goal
from wayfarer.world.agents.heading import facing_at
from wayfarer.world.events import EventKind

BODIES = BodyLibrary("anny52")


@pytest.mark.parametrize(
    ("names", "enum"),
    [
        (Basis, common_pb2.Basis),
        (schema.Gender, agent_pb2.Gender),
        (AgentState, agent_pb2.AgentState),
        (EventKind, motion_pb2.EventKind),
        (SlowReader, motion_pb2.SlowReader),
        (schema.MeshFormat, scene_pb2.MeshFormat),
        (PoseEncoding, motion_pb2.PoseEncoding),
        (PoseProfile, motion_pb2.PoseProfile),
    ],
)
def test_enums_have_the_same_values(names, enum):
    """Retired values (`deprecated` in the proto) are refused."""
    prefix = enum.keys()[0].removesuffix("UNSPECIFIED")
    kept = [value.name for value in enum.DESCRIPTOR.values if not value.GetOptions().deprecated]
    assert {prefix + name.value.upper() for name in names} == set(kept[1:])


def test_all_figures_of_the_loop_are_shown():
    assert set(schema.Stats.model_fields) == {field.name for field in dataclasses.fields(LoopStats)}


def spec(**fields) -> agent_pb2.AgentSpec:
    return agent_pb2.AgentSpec(**fields)


def test_zero_is_not_absent():
    parsed = wire.parse(schema.AgentSpec, spec(seed=0, position={}))
    assert parsed.seed == 0
    assert parsed.position == schema.Vector3(x=0, y=0, z=0)


@pytest.mark.parametrize(
    ("goal", "field"),
    [
        ({"position": {"x": math.nan}}, "position.x"),
        ({"position": {"x": math.inf}}, "position.x"),
        ({"position": {"x": -math.inf}}, "position.x"),
        ({"position": {}, "heading": math.nan}, "heading"),
        ({"position": {}, "heading": math.inf}, "heading"),
        ({"position": {}, "heading": -90}, "heading"),
    ],
)
def test_numbers_of_a_goal_are_finite_and_in_range(goal, field):
    with pytest.raises(InvalidArgument) as caught:
        wire.parse(schema.Goal, goal_pb2.Goal(**goal), "goals[2]")
    assert caught.value.field == f"goals[2].{field}"


def test_unknown_enum_values_are_refused():
    with pytest.raises(InvalidArgument, match="GENDER_MALE") as caught:
        wire.parse(schema.AgentSpec, spec(gender=7), "agents[1]")
    assert caught.value.field == "agents[1].gender"


@pytest.mark.parametrize(
    ("fields", "field"),
    [
        ({"betas": [0.0] * 10, "phenotype": {"weight": 0.5}}, ""),
        ({"phenotype": {"weight": math.nan}}, "phenotype.weight"),
        ({"phenotype": {"weight": 1.5}}, "phenotype.weight"),
        ({"phenotype": {"age": 5.0}}, "phenotype.age"),
        ({"phenotype": {"height_m": 3.0}}, "phenotype.height_m"),
    ],
)
def test_ranges_of_an_agent(fields, field):
    with pytest.raises(InvalidArgument) as caught:
        wire.parse(schema.AgentSpec, spec(**fields))
    assert caught.value.field == field


def test_agent_spec_in_unreal_is_in_centimetres_and_turns_clockwise():
    request = schema.AgentSpec(position=schema.Vector3(x=200, y=100, z=55), heading=0.5, seed=3)
    made = convert.agent_spec(request, Basis.UNREAL, BODIES, 0)
    assert made.position == pytest.approx((1.0, 2.0))  # Unreal x is forward, core +Y
    assert made.heading == -0.5
    assert made.betas == (0.0,) * 10


def test_a_body_in_everyday_words():
    tall = schema.AgentSpec(phenotype=schema.Phenotype(height_m=1.9))
    made = convert.agent_spec(tall, Basis.GLTF, BODIES, 0)
    assert height_of("female", made.betas) == pytest.approx(1.9, abs=2e-3)
    plain = schema.AgentSpec(phenotype=schema.Phenotype(weight=0.9))
    made = convert.agent_spec(plain, Basis.GLTF, BODIES, 0)
    assert height_of("female", made.betas) == pytest.approx(
        height_of("female", (0.0,) * 10), abs=2e-3
    )


@pytest.mark.parametrize(("sent", "wanted"), [({}, True), ({"foot_lock": False}, False)])
def test_feet_are_locked_unless_it_is_refused(sent, wanted):
    request = wire.parse(schema.AgentSpec, agent_pb2.AgentSpec(**sent))
    assert convert.agent_spec(request, Basis.GLTF, BODIES, 0).foot_lock is wanted


@given(st.integers(0, (1 << 32) - 1), st.integers(0, 1000))
def test_drawn_seeds_are_uint32_and_each_of_a_sessions_its_own(seed, number):
    drawn = convert.drawn_seed(seed, number)
    assert 0 <= drawn < 1 << 32 and drawn == convert.drawn_seed(seed, number)
    assert drawn != convert.drawn_seed(seed, number + 1)


def test_bytes_stand_as_base64_among_values():
    walking = ["AGENT_STATE_WALKING"]
    sent = motion_pb2.MotionChunks(states=walking, poses=b"\x00\xff", contacts=b"\x03")
    shown = wire.parse(schema.MotionChunks, sent)
    assert (shown.poses, shown.contacts, shown.states) == ("AP8=", "Aw==", ("walking",))
    assert wire.message(motion_pb2.MotionChunks, shown) == sent


@pytest.mark.parametrize("basis", Basis)
def test_goals_there_and_back(basis):
    """Goals as a client writes them, in each basis, and reads them in the agent's description."""
    axes = basis.axes
    place = dict(zip("xyz", axes.points_to_wire(np.array([3.0, -4.0, 0.0])), strict=True))
    radius = axes.length_to_wire(0.5)
    sent = goal_pb2.Goal(
        position=place, radius=radius, heading=0.5, stop=False, strafe=True, dwell=0.0
    )
    given = in_world(Goal, wire.parse(schema.Goal, sent, "goal"), axes)
    assert given.position == pytest.approx((3.0, -4.0, 0.0))
    assert (given.radius, given.speed) == (pytest.approx(0.5), 1.2)
    assert given.heading == axes.handedness * 0.5
    assert (given.stop, given.strafe, given.dwell) == (False, True, 0.0)
    shown = wire.message(agent_pb2.Agent, convert.agent(agent(goal=given), basis, BODIES)).goal
    assert (shown.heading, shown.stop, shown.strafe) == (0.5, False, True)
    assert shown.position.x == pytest.approx(place["x"])


@given(st.sampled_from(list(Basis)), st.floats(-3, 3))
def test_a_goal_heading_faces_what_the_basis_means_by_it(basis, heading):
    """The wire's own turn about its up axis takes its forward axis to where the body faces."""
    axes = basis.axes
    request = schema.Goal(position=schema.Vector3(x=0, y=0, z=0), heading=heading)
    facing = axes.matrix @ np.array([*facing_at(in_world(Goal, request, axes).heading), 0.0])
    side = np.cross(axes.up, axes.forward)  # where +90 degrees about +up points, either handedness
    np.testing.assert_allclose(
        facing, np.cos(heading) * axes.forward + np.sin(heading) * side, atol=1e-9
    )


def test_an_absent_heading_stays_absent():
    request = wire.parse(schema.Goal, goal_pb2.Goal(position={}))
    given = in_world(Goal, request, Basis.UNITY.axes)
    assert given == Goal((0.0, 0.0, 0.0))
    shown = wire.message(agent_pb2.Agent, convert.agent(agent(goal=given), Basis.UNITY, BODIES))
    assert not shown.goal.HasField("heading")
    assert shown.goal.stop and not shown.goal.strafe


def agent(**changes) -> AgentInfo:
    fields = {
        "agent_id": "agent-1",
        "alias": 1,
        "session_id": "session-1",
        "spec": AgentSpec(gender="male", betas=(1.0,) + (0.0,) * 9, noise_seed=7, name="Ada"),
        "state": AgentState.WALKING,
        "position": (1.0, 2.0, 0.9),
        "heading": 0.25,
        "goal": Goal((3.0, 4.0, 0.0)),
        "goal_revision": 2,
        "created_at": NOW,
    }
    return AgentInfo(**{**fields, **changes})


def test_agent_in_unity():
    shown = convert.agent(agent(waypoint=2, waypoints=3), Basis.UNITY, BODIES)
    assert (shown.waypoint, shown.waypoints) == (2, 3)
    assert shown.position == schema.Vector3(x=1.0, y=0.9, z=2.0)
    assert shown.heading == -0.25
    assert shown.goal.position == schema.Vector3(x=3.0, y=0.0, z=4.0)
    message = wire.message(agent_pb2.Agent, shown)
    assert message.state == agent_pb2.AGENT_STATE_WALKING
    assert message.gender == agent_pb2.GENDER_MALE
    assert wire.parse(schema.Agent, message).model_dump(exclude={"rest_offsets"}) == (
        shown.model_dump(exclude={"rest_offsets"})
    )


def test_an_agent_without_a_goal_has_none_on_the_wire():
    message = wire.message(agent_pb2.Agent, convert.agent(agent(goal=None), Basis.GLTF, BODIES))
    assert not message.HasField("goal")


@pytest.mark.parametrize("basis", Basis)
def test_rest_offsets_add_up_to_the_rest_pose(basis):
    betas = (1.0, -1.0) + (0.0,) * 8
    body = BODIES.model("female")
    offsets = np.array(convert.rest_offsets(BODIES, "female", betas, basis)).reshape(-1, 3)
    places = [offsets[0]]
    for joint, parent in enumerate(body.parents[1:], start=1):
        places.append(places[parent] + offsets[joint])
    expected = basis.axes.points_to_wire(body.rest_joints(np.array(betas)))
    unit = 1 / basis.axes.metres_per_unit
    np.testing.assert_allclose(places, expected, atol=1e-4 * unit)
    height = float(np.array(places[0]) @ basis.axes.up) / unit
    assert 0.7 < height < 1.3  # hips above the floor
