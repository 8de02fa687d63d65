import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.transport.fakes import NOW
from wayfarer.body.phenotype import height_of
from wayfarer.errors import InvalidArgument
from wayfarer.runtime.agent import AgentInfo, AgentSpec, AgentState, Goal
from wayfarer.runtime.heading import facing_at
from wayfarer.transport import convert, schema
from wayfarer.transport.basis import Basis
from wayfarer.transport.bodies import BodyLibrary
from wayfarer.v1 import agent_pb2, catalog_pb2, common_pb2, goal_pb2, session_pb2

BODIES = BodyLibrary("anny52")

# Schema twins and the protobuf messages they stand for.
TWINS = [
    (schema.Vector3, common_pb2.Vector3),
    (schema.BasisInfo, common_pb2.BasisInfo),
    (schema.NewSession, session_pb2.CreateSessionRequest),
    (schema.Session, session_pb2.Session),
    (schema.Phenotype, agent_pb2.Phenotype),
    (schema.AgentSpec, agent_pb2.AgentSpec),
    (schema.Agent, agent_pb2.Agent),
    (schema.Goal, goal_pb2.Goal),
    (schema.GoalRevision, goal_pb2.SetGoalResponse),
    (schema.GoalRevision, goal_pb2.SetPathResponse),
    (schema.GoalRevision, goal_pb2.ClearGoalResponse),
    (schema.Bone, catalog_pb2.Bone),
    (schema.Skeleton, catalog_pb2.Skeleton),
    (schema.Body, catalog_pb2.Body),
    (schema.Model, catalog_pb2.Model),
    (schema.Limits, catalog_pb2.Limits),
    (schema.ServerInfo, catalog_pb2.GetServerInfoResponse),
]


@pytest.mark.parametrize(("twin", "proto"), TWINS, ids=lambda t: t.__name__)
def test_twins_have_the_same_fields(twin, proto):
    assert list(twin.model_fields) == [field.name for field in proto.DESCRIPTOR.fields]


@pytest.mark.parametrize(
    ("names", "enum"),
    [
        (Basis, common_pb2.Basis),
        (schema.Gender, agent_pb2.Gender),
        (AgentState, agent_pb2.AgentState),
    ],
)
def test_enums_have_the_same_values(names, enum):
    prefix = enum.keys()[0].removesuffix("UNSPECIFIED")
    assert {prefix + name.value.upper() for name in names} == set(enum.keys()[1:])


def spec(**fields) -> agent_pb2.AgentSpec:
    return agent_pb2.AgentSpec(**fields)


def test_what_is_absent_takes_the_default():
    parsed = convert.parse(schema.AgentSpec, spec())
    assert parsed == schema.AgentSpec()
    assert parsed.seed is None and parsed.position is None
    assert convert.parse(schema.NewSession, session_pb2.CreateSessionRequest()).basis == "gltf"


def test_zero_is_not_absent():
    parsed = convert.parse(schema.AgentSpec, spec(seed=0, position={}))
    assert parsed.seed == 0
    assert parsed.position == schema.Vector3(x=0, y=0, z=0)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_numbers_must_be_finite(bad):
    with pytest.raises(InvalidArgument) as caught:
        convert.parse(schema.Goal, goal_pb2.Goal(position={"x": bad}), "goal")
    assert caught.value.field == "goal.position.x"


def test_unknown_enum_values_are_refused():
    with pytest.raises(InvalidArgument, match="GENDER_MALE") as caught:
        convert.parse(schema.AgentSpec, spec(gender=7))
    assert caught.value.field == "gender"


@pytest.mark.parametrize(
    ("fields", "field"),
    [
        ({"betas": [0.0] * 9}, ""),
        ({"betas": [0.0] * 11}, "betas"),
        ({"betas": [5.1] + [0.0] * 9}, "betas[0]"),
        ({"betas": [0.0] * 10, "phenotype": {"weight": 0.5}}, ""),
        ({"phenotype": {"weight": math.nan}}, "phenotype.weight"),
        ({"heading": 101.0}, "heading"),
        ({"name": "two\nlines"}, "name"),
    ],
)
def test_ranges_of_an_agent(fields, field):
    with pytest.raises(InvalidArgument) as caught:
        convert.parse(schema.AgentSpec, spec(**fields))
    assert caught.value.field == field


def test_agent_spec_in_unreal_is_in_centimetres_and_turns_clockwise():
    wish = schema.AgentSpec(position=schema.Vector3(x=200, y=100, z=55), heading=0.5, seed=3)
    made = convert.agent_spec(wish, Basis.UNREAL, BODIES, "agents[0]")
    assert made.position == pytest.approx((1.0, 2.0))  # Unreal x is forward, core +Y
    assert made.heading == -0.5
    assert made.betas == (0.0,) * 10


def test_a_body_in_everyday_words():
    tall = schema.AgentSpec(phenotype=schema.Phenotype(height_m=1.9))
    made = convert.agent_spec(tall, Basis.GLTF, BODIES, "agents[0]")
    assert height_of("female", made.betas) == pytest.approx(1.9, abs=2e-3)
    plain = schema.AgentSpec(phenotype=schema.Phenotype(weight=0.9))
    made = convert.agent_spec(plain, Basis.GLTF, BODIES, "agents[0]")
    assert height_of("female", made.betas) == pytest.approx(
        height_of("female", (0.0,) * 10), abs=2e-3
    )


@pytest.mark.parametrize("wrong", [{"height_m": 3.0}, {"weight": 1.5}, {"age": 5.0}])
def test_a_body_beyond_its_range_is_named(wrong):
    wish = schema.AgentSpec(phenotype=schema.Phenotype(**wrong))
    with pytest.raises(InvalidArgument, match="must lie in") as caught:
        convert.agent_spec(wish, Basis.GLTF, BODIES, "agents[2]")
    assert caught.value.field == f"agents[2].phenotype.{next(iter(wrong))}"


@pytest.mark.parametrize(("sent", "wanted"), [({}, True), ({"foot_lock": False}, False)])
def test_feet_are_locked_unless_it_is_refused(sent, wanted):
    wish = convert.parse(schema.AgentSpec, agent_pb2.AgentSpec(**sent))
    assert convert.agent_spec(wish, Basis.GLTF, BODIES, "agents[0]").foot_lock is wanted


def test_seeds_are_drawn_when_absent():
    drawn = {
        convert.agent_spec(schema.AgentSpec(), Basis.GLTF, BODIES, "").noise_seed for _ in range(8)
    }
    assert len(drawn) > 1 and all(0 <= seed < 1 << 32 for seed in drawn)


@pytest.mark.parametrize("basis", Basis)
def test_goals_there_and_back(basis):
    axes = basis.axes
    place = axes.points_to_wire(np.array([3.0, -4.0, 0.0]))
    wish = schema.Goal(
        position=dict(zip("xyz", place, strict=True)), radius=axes.length_to_wire(0.5), speed=None
    )
    goal = convert.goal(wish, basis)
    assert goal == Goal(pytest.approx((3.0, -4.0, 0.0)), pytest.approx(0.5), 1.2)


@pytest.mark.parametrize("basis", Basis)
def test_how_to_go_to_a_goal_there_and_back(basis):
    """What a client writes, in each basis, and reads back from the agent's description."""
    axes = basis.axes
    sent = goal_pb2.Goal(
        position={"x": 1.0, "y": 2.0, "z": 3.0}, heading=0.5, stop=False, strafe=True, dwell=0.0
    )
    given = convert.goal(convert.parse(schema.Goal, sent, "goal"), basis)
    assert given.heading == axes.handedness * 0.5
    assert (given.stop, given.strafe, given.dwell) == (False, True, 0.0)
    shown = convert.message(agent_pb2.Agent, convert.agent(agent(goal=given), basis, BODIES)).goal
    assert (shown.heading, shown.stop, shown.strafe) == (0.5, False, True)


@given(st.sampled_from(list(Basis)), st.floats(-3, 3))
def test_a_goal_heading_faces_what_the_basis_means_by_it(basis, heading):
    """The wire's own turn about its up axis takes its forward axis to where the body faces."""
    axes = basis.axes
    wish = schema.Goal(position=schema.Vector3(x=0, y=0, z=0), heading=heading)
    facing = axes.matrix @ np.array([*facing_at(convert.goal(wish, basis).heading), 0.0])
    side = np.cross(axes.up, axes.forward)  # where +90 degrees about +up points, either handedness
    np.testing.assert_allclose(
        facing, np.cos(heading) * axes.forward + np.sin(heading) * side, atol=1e-9
    )


def test_an_absent_heading_stays_absent():
    given = convert.goal(convert.parse(schema.Goal, goal_pb2.Goal(position={})), Basis.UNITY)
    assert given == Goal((0.0, 0.0, 0.0))
    shown = convert.message(agent_pb2.Agent, convert.agent(agent(goal=given), Basis.UNITY, BODIES))
    assert not shown.goal.HasField("heading")
    assert shown.goal.stop and not shown.goal.strafe


@pytest.mark.parametrize("bad", [math.nan, math.inf, 100.5])
def test_goal_headings_have_a_range(bad):
    with pytest.raises(InvalidArgument) as caught:
        convert.parse(schema.Goal, goal_pb2.Goal(position={}, heading=bad), "goals[2]")
    assert caught.value.field == "goals[2].heading"


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
    message = convert.message(agent_pb2.Agent, shown)
    assert message.state == agent_pb2.AGENT_STATE_WALKING
    assert message.gender == agent_pb2.GENDER_MALE
    assert convert.parse(schema.Agent, message).model_dump(exclude={"rest_offsets"}) == (
        shown.model_dump(exclude={"rest_offsets"})
    )


def test_an_agent_without_a_goal_has_none_on_the_wire():
    message = convert.message(agent_pb2.Agent, convert.agent(agent(goal=None), Basis.GLTF, BODIES))
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
