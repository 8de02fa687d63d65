"""Sessions as bytes: they resume where they were, and forgeries of clients are refused."""

import json
import struct
import zlib
from dataclasses import fields, replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.runtime.kept_worlds import STICK, assert_same_poses, fake_worlds
from tests.world.fakes import people
from wayfarer.config.limits import Limits
from wayfarer.errors import FailedPrecondition, InvalidArgument, WayfarerError
from wayfarer.runtime.persistence.capture import capture_session
from wayfarer.runtime.persistence.container import ContainerKind, seal, unseal
from wayfarer.runtime.persistence.packing import get, pack, row_bytes, unpack
from wayfarer.runtime.persistence.session_record import encode_record
from wayfarer.runtime.persistence.snapshot import (
    AgentPart,
    AgentRows,
    BodyStamp,
    SessionPart,
    SnapshotHeader,
    decode_session,
    most_bytes,
)
from wayfarer.world.agents.agent import SessionSpec
from wayfarer.world.agents.goal import Goal
from wayfarer.world.agents.records import AgentRecord, SessionRecord
from wayfarer.world.agents.slots import Motion
from wayfarer.world.behaviours import Wander
from wayfarer.world.goals.commands import Path
from wayfarer.world.output.ground import Footing
from wayfarer.world.rows import flat_columns

LIMITS = Limits(agents=64, agents_per_session=16, path_goals=16)
SPEC = SessionSpec("s", seed=2**64 - 1, attributes={"basis": "unity", "näme": "ö"})


def walking_world(worlds, seconds=3.02):
    """Four agents in mid-motion: a wanderer, one on a path, one at rest, one unlocked."""
    world = worlds.live()
    world.create_session(SPEC, 0.0)
    specs = people(3) + people(1, foot_lock=False, position=(9.0, 0.0), noise_seed=2**64 - 1)
    a, b, _, d = (info.agent_id for info in world.create_agents("s", specs, 0.0))
    world.give(a, Wander((2.0, 0.0), 4.0), 0.0)
    world.give(b, Path(tuple(Goal((x, 3.0 * (x % 2), 0.0), stop=False) for x in range(6))), 0.0)
    world.give(d, Goal((9.0, 2.0, 0.0), heading=1.0), 0.0)
    sent = list(world.advance(seconds))
    return world, sent


def export(world, body=STICK):
    return encode_record(capture_session(world, "s"), body)


@cache
def some_snapshot():
    return export(walking_world(fake_worlds(limits=LIMITS))[0])


@pytest.fixture
def snapshot():
    return some_snapshot()


def decode(data, body=STICK, limits=LIMITS):
    return decode_session(data, body, limits)


def changed(data, edit=lambda header: None, rows=lambda rows: rows):
    """A snapshot forged with knowledge of the format: dicts and packed rows are edited."""
    text, arrays = unseal(ContainerKind.SNAPSHOT, data, most_bytes(LIMITS))
    header = json.loads(text)
    edit(header)
    return seal(ContainerKind.SNAPSHOT, json.dumps(header).encode(), rows(arrays))


def test_it_goes_on_elsewhere_bit_for_bit():
    worlds = fake_worlds(limits=LIMITS)
    here, before = walking_world(worlds)
    there = worlds.live()
    there.members.put_session(decode(export(here)), 7000.0)
    expected = {}
    for chunk in here.advance(9.0):
        expected.setdefault(chunk.alias, []).append(chunk)
    found = {}
    for chunk in there.advance(7005.0):
        found.setdefault(chunk.alias, []).append(chunk)
    last = {chunk.alias: chunk.seq for chunk in before}
    assert found.keys() == expected.keys() == last.keys()
    for alias, chunks in found.items():
        assert chunks[0].seq == last[alias] + 1
        assert len(chunks) > 20
        for a, b in zip(chunks, expected[alias], strict=False):
            assert_same_poses(a, replace(b, agent_id=a.agent_id))


def test_all_that_is_told_of_agents_stays():
    worlds = fake_worlds(limits=LIMITS)
    here, _ = walking_world(worlds)
    there = worlds.live()
    there.members.put_session(decode(export(here)), 7000.0)
    assert there.list_agents("s") == here.list_agents("s")
    assert there.get_session("s") == here.get_session("s")
    [new] = there.create_agents("s", people(1), 7000.0)
    assert new.alias == 5


def test_it_names_the_model_of_each_agent(snapshot):
    [model] = {agent.model for agent in decode(snapshot).agents}
    name, stamp = model.split("@")
    assert name == "fake" and len(stamp) == 16


def test_the_snapshot_of_an_untouched_import_is_the_same(snapshot):
    there = fake_worlds(limits=LIMITS).live()
    there.members.put_session(decode(snapshot), 7000.0)
    assert export(there) == snapshot


@pytest.mark.parametrize(
    ("stamp", "limits", "error", "text"),
    [
        (BodyStamp("other", {}), LIMITS, FailedPrecondition, "made with body 'stick'"),
        (
            STICK,
            LIMITS.model_copy(update={"agents_per_session": 3}),
            InvalidArgument,
            "4 agents; allowed: 3",
        ),
    ],
)
def test_what_does_not_belong_here_is_refused(snapshot, stamp, limits, error, text):
    with pytest.raises(error, match=text):
        decode(snapshot, stamp, limits)


@pytest.mark.parametrize(
    ("data", "error", "text"),
    [
        (b"", InvalidArgument, "cut short"),
        (b"x" * 100, InvalidArgument, "does not begin"),
        (seal(ContainerKind.LOG, b"{}", b""), InvalidArgument, "does not begin"),
        (struct.pack("<8sHI", b"WAYFSNAP", 9, 0), FailedPrecondition, "format 9"),
        (struct.pack("<8sHI", b"WAYFSNAP", 1, 0) + b"junk", InvalidArgument, "damaged"),
        (struct.pack("<8sHI", b"WAYFSNAP", 1, 9) + zlib.compress(b"{}"), InvalidArgument, "header"),
        (seal(ContainerKind.SNAPSHOT, b"{}", b"") + b"more", InvalidArgument, "after its end"),
        (seal(ContainerKind.SNAPSHOT, b"{}", b"")[:-3], InvalidArgument, "cut short"),
        (seal(ContainerKind.SNAPSHOT, b"[" * 100_000, b""), InvalidArgument, "snapshot"),
        (
            seal(ContainerKind.SNAPSHOT, b"[0" + b",0" * 100_000 + b"]", b""),
            InvalidArgument,
            "values",
        ),
        (seal(ContainerKind.SNAPSHOT, b"{}", b""), InvalidArgument, "snapshot.fps"),
    ],
)
def test_what_is_no_snapshot_is_refused(data, error, text):
    with pytest.raises(error, match=text):
        decode(data)


def test_a_bomb_is_not_inflated():
    bomb = seal(ContainerKind.SNAPSHOT, b"{}", bytes(20_000_000))
    assert len(bomb) < 100_000
    with pytest.raises(InvalidArgument, match="more than"):
        decode(bomb)


def put(path, value):
    """An edit of the header: put("agents.0.seq", -1)."""

    def edit(header):
        *way, last = path.split(".")
        for step in way:
            header = header[int(step) if step.isdigit() else step]
        header[last] = value

    return edit


@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("fps", "forty"),
        ("surprise", 1),
        ("session.session_id", "../../etc"),
        ("session.session_id", ""),
        ("session.last_alias", 2),
        ("session.last_alias", 2**70),
        ("session.created_at", float("nan")),
        ("session.created_at", float("inf")),
        ("session.spec.attributes", {str(i): "" for i in range(1000)}),
        ("session.spec.attributes", {"a": "x" * 100_000}),
        ("agents", []),
        ("agents.0.agent_id", "a b"),
        ("agents.0.alias", 2),
        ("agents.0.alias", -1),
        ("agents.0.goal_revision", -1),
        ("agents.0.surprise", 1),
        ("agents.0.spec.betas", [9.0] * 10),
        ("agents.0.spec.betas", [float("nan")] * 10),
        ("agents.0.spec.betas", []),
        ("agents.0.spec.gender", "none"),
        ("agents.0.spec.noise_seed", 2**64),
        ("agents.0.spec.name", "x" * 1000),
        ("agents.0.path_start", [float("inf"), 0.0]),
        ("agents.0.behaviour.radius", -1.0),
        ("agents.0.behaviour.center", [1e9, 0.0]),
        ("agents.1.passed", -1),
        ("agents.1.passed", 2**40),
        ("agents.1.path", []),
        ("agents.1.path.0.position", [1e12, 0.0, 0.0]),
        ("agents.1.path.0.position", [0.0, 0.0]),
        ("agents.1.path.0.speed", 1e9),
        ("agents.1.path.0.radius", float("nan")),
        ("agents.1.path", [{"position": [0.0, 0.0, 0.0]}] * 500),
    ],
)
def test_headers_are_checked_field_by_field(snapshot, path, value):
    with pytest.raises(InvalidArgument) as caught:
        decode_and_put(changed(snapshot, put(path, value)))
    assert str(caught.value)


def decode_and_put(data):
    world = fake_worlds(limits=LIMITS).live()
    world.members.put_session(decode(data), 0.0)
    return world


def test_rows_keep_their_layout_and_hold_all_of_a_motion():
    """Sessions that were kept until 2026-11-30 have rows of this size, and can still be read."""
    assert row_bytes(AgentRows) == 2640
    motion, columns = Motion.empty(2), flat_columns(Motion)
    for number, column in enumerate(columns):
        get(motion, column.path)[:] = 1 if column.dtype == np.bool_ else number
    packed = pack(AgentRows.of(np.array([4, 5]), motion, Footing.empty(2))).tobytes()
    kept = unpack(AgentRows, packed, "rows").motion
    for column in columns:
        assert (get(kept, column.path) == get(motion, column.path)).all(), column.path


def rows_with(path, value):
    def edit(arrays):
        rows = unpack(AgentRows, arrays, "rows")
        get(rows, path)[0] = value
        return pack(rows).tobytes()

    return edit


@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("seed.markers", np.nan),
        ("seed.markers", 50.0),
        ("seed.translation", np.inf),
        ("seed.translation", 9e5),
        ("seed.rotations", 0.0),
        ("seed.rotations", 7.0),
        ("gait.mode", 77),
        ("gait.mode", -1),
        ("gait.speed", np.nan),
        ("gait.waypoint", -1),
        ("gait.waypoint", 2**62),
        ("gait.stop_place", 1e30),
        ("gait.stop_facing", 1e3),
        ("seq", -1),
        ("seq", 2**60),
    ],
)
def test_motion_is_checked_number_by_number(snapshot, path, value):
    with pytest.raises(InvalidArgument) as caught:
        decode_and_put(changed(snapshot, rows=rows_with(path, value)))
    assert "agents" in str(caught.value) or "agents" in caught.value.field


def test_flags_are_flags_and_rows_are_whole(snapshot):
    with pytest.raises(InvalidArgument, match="flags must be 0 or 1"):
        decode(changed(snapshot, rows=lambda rows: b"\x02" * len(rows)))
    for size in (-1, -1000):
        with pytest.raises(InvalidArgument, match="a row has"):
            decode(changed(snapshot, rows=lambda rows, size=size: rows[:size]))
    with pytest.raises(InvalidArgument, match="the motion of 8"):
        decode(changed(snapshot, rows=lambda rows: rows * 2))


@settings(max_examples=150)
@given(st.data())
def test_no_change_of_bytes_does_more_than_be_refused(data):
    whole = some_snapshot()
    text, arrays = unseal(ContainerKind.SNAPSHOT, whole, most_bytes(LIMITS))
    inner = bytearray(text + arrays)
    for _ in range(data.draw(st.integers(1, 4))):
        place = data.draw(st.integers(0, len(inner) - 1))
        inner[place : place + data.draw(st.integers(0, 9))] = data.draw(st.binary(max_size=9))
    cut = data.draw(st.integers(0, len(text) + 9))
    for mutant in (
        seal(
            ContainerKind.SNAPSHOT,
            bytes(inner[: len(text)]),
            bytes(inner[len(text) :]),
        ),
        seal(ContainerKind.SNAPSHOT, bytes(inner[:cut]), bytes(inner[cut:])),
        whole[: data.draw(st.integers(0, len(whole)))],
    ):
        try:
            world = decode_and_put(mutant)
        except WayfarerError as error:
            assert str(error)
        else:
            list(world.advance(0.7))  # an accepted snapshot can be stepped


def test_the_header_names_every_part_of_a_record():
    assert {f.name for f in fields(AgentRecord)} == {f.name for f in fields(AgentPart)} | {
        "seq",
        "motion",
        "footing",
    }
    assert {f.name for f in fields(SessionRecord)} == {f.name for f in fields(SessionPart)} | {
        "agents"
    }
    assert set(SnapshotHeader.model_fields) == {"fps", "body", "session", "agents"}
