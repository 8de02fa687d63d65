"""The generator's counts of a stream, from hand-made messages."""

import numpy as np
import pytest

from wayfarer.v1 import agent_pb2, motion_pb2
from wayfarer_lab.load.reader import EVERY, FIRST, GAP, Reader
from wayfarer_lab.load.rings import LoadRing
from wayfarer_lab.load.tally import Tally

START = 1000.0
BONES = 22
FRAMES = 8


def message(*chunks):
    """Chunks of (alias, seq, scheduled seconds after the start)."""
    return motion_pb2.StreamMotionResponse(
        batch=motion_pb2.MotionBatch(
            chunks=motion_pb2.MotionChunks(
                aliases=[alias for alias, _, _ in chunks],
                seqs=[seq for _, seq, _ in chunks],
                scheduled_at_us=[round(1e6 * (START + at)) for _, _, at in chunks],
                goal_revisions=[0] * len(chunks),
                states=[0] * len(chunks),
                flags=[0] * len(chunks),
            )
        )
    )


def reader(since=0.0, until=1e12):
    tally = Tally()
    return Reader(tally, since, until), tally


def test_lost_and_late_primitives_are_misses():
    r, tally = reader()
    r.take(message((1, 7, 0.0), (2, 3, 0.0)), START)
    r.take(message((1, 8, 0.2), (2, 6, 0.6)), START + 0.61)  # agent 2 lost two; agent 1 is late
    r.take(message((1, 9, 0.4)), START + 0.59)  # in time still
    assert (tally.chunks, tally.lost, tally.late, tally.misses) == (5, 2, 1, 3)


def test_a_primitive_that_never_came_is_as_late_as_when_that_shows():
    r, tally = reader()
    r.take(message((1, 0, 0.0)), START)
    r.take(message((1, 2, 0.4)), START + 0.4)
    assert tally.lateness.count == 3
    assert tally.lateness.milliseconds()["max"] == pytest.approx(200, rel=2e-3)


def test_a_schedule_moved_by_a_server_that_fell_behind_hides_nothing():
    r, tally = reader()
    r.take(message((1, 0, 0.0)), START)
    r.take(message((1, 1, 2.2)), START + 2.2)  # the next number, and two seconds later
    assert tally.lost == 10
    assert tally.lateness.milliseconds()["max"] == pytest.approx(2000, rel=2e-3)


def test_what_falls_due_before_or_after_the_measuring_does_not_count():
    r, tally = reader(since=START + 1, until=START + 1.5)
    r.take(message((1, 0, 0.8)), START + 1.1)
    assert tally.chunks == 0
    r.take(message((1, 1, 1.0)), START + 1.1)
    r.take(message((1, 5, 1.8)), START + 1.8)  # of three that are lost two were due in time
    assert (tally.chunks, tally.lost) == (1, 2)


def test_a_stream_that_falls_silent_has_lost_all_the_rest():
    r, tally = reader(since=START, until=START + 2)
    r.take(message((1, 0, 0.0)), START)
    r.finish(1, START + 2.2)
    assert tally.chunks == 1 and tally.lost == 9
    assert tally.lateness.milliseconds()["max"] == pytest.approx(2000, rel=2e-3)


def test_an_agent_of_whom_nothing_comes_has_lost_everything():
    r, tally = reader(since=START, until=START + 2)
    r.finish(3, START + 2.2)
    assert tally.silent == 3 and tally.lost == 30


def test_a_stream_that_was_complete_has_lost_nothing_at_the_end():
    r, tally = reader(since=START, until=START + 2)
    for number in range(10):
        at = 0.13 + 0.2 * number
        r.take(message((1, number, at)), START + at)
    r.finish(1, START + 2.2)
    assert tally.chunks == 10 and tally.misses == 0 and tally.silent == 0


def test_chunks_that_come_twice_are_a_fault():
    r, tally = reader()
    r.take(message((1, 4, 0.0)), START)
    r.take(message((1, 4, 0.0)), START)
    assert tally.repeated == 1


def header():
    return motion_pb2.StreamMotionResponse(
        header=motion_pb2.StreamHeader(
            pose_encoding=motion_pb2.POSE_ENCODING_F32_LE, frame_bytes=4 * (3 + 4 * BONES)
        )
    )


def poses():
    values = np.zeros((FRAMES, 3 + 4 * BONES), "<f4")
    values[:, 6::4] = 1.0
    return values


def nan(values):
    values[3, 1] = np.nan


def stretched(values):
    values[5, 6] = 1.1


@pytest.mark.parametrize("spoil", [nan, stretched])
def test_poses_that_are_none_are_found_in_a_sample(spoil):
    for spoilt in (False, True):
        values = poses()
        if spoilt:
            spoil(values)
        r, tally = reader()
        r.take(header(), START)
        for number in range(2 * EVERY):
            wire = message((1, number, 0.2 * number))
            wire.batch.chunks.poses = values.tobytes()
            wire.batch.chunks.contacts = bytes(FRAMES)
            r.take(wire, START + 0.2 * number)
        assert tally.malformed == (2 if spoilt else 0)


def test_poses_of_the_wrong_length_are_a_fault():
    r, tally = reader()
    r.take(header(), START)
    r.take(message((1, 0, 0.0)), START)
    assert tally.malformed == 1


# rings


def ringed(until=1e12):
    tally = Tally((LoadRing("full", 8.0), LoadRing("root")))
    return Reader(tally, 0.0, until), tally


def seen(tier, *chunks, added=(), hidden=(), flags=0):
    """Chunks of a ring. Added agents have FIRST, the others `flags`."""
    wire = message(*chunks)
    wire.batch.tier = tier
    wire.batch.hidden.extend(hidden)
    wire.batch.added.extend(agent_pb2.Agent(alias=alias) for alias in added)
    wire.batch.chunks.flags[:] = [FIRST if a in added else flags for a, _, _ in chunks]
    return wire


def begun(r, at=0.0):
    r.take(motion_pb2.StreamMotionResponse(header=motion_pb2.StreamHeader()), START + at)


def test_nothing_is_due_of_agents_out_of_sight():
    r, tally = ringed(until=START + 2.0)
    r.take(seen(0, (1, 0, 0.0), (2, 0, 0.0), added=[1, 2]), START)
    r.goals.asked(2, 1, START)
    r.take(seen(0, (1, 1, 0.2), hidden=[2]), START + 0.2)
    r.goals.asked(2, 2, START + 0.3)
    r.take(seen(0, (1, 2, 0.4)), START + 0.4)
    r.take(seen(1, (2, 7, 1.4), added=[2]), START + 1.4)
    r.take(seen(0, (1, 3, 0.6), flags=GAP), START + 1.4)
    r.take(seen(1, (2, 8, 1.6)), START + 1.6)
    r.take(seen(1, hidden=[1, 2]), START + 1.8)
    r.finish(agents=3, now=START + 2.2)
    assert (tally.silent, tally.unanswered, tally.popped) == (0, 0, 0)
    near, far = tally.by_ring[0], tally.by_ring[1]
    assert (near.chunks, far.chunks, far.misses) == (5, 2, 0)
    assert (near.late, near.lost) == (1, 5)  # agent 1: from 0.8 until it was hidden


def test_lateness_and_misses_are_told_by_the_ring_in_which_one_was_seen_last():
    r, tally = ringed(until=START + 2.0)
    r.take(seen(0, (1, 0, 0.0), added=[1]), START)
    r.take(seen(1, (2, 0, 0.0), added=[2]), START)
    r.take(seen(1, (1, 1, 0.2)), START + 0.5)  # late, and out of the first ring
    r.take(seen(0, (2, 3, 0.6), flags=GAP), START + 0.6)  # has lost two in the second
    near, far = (ring for ring in tally.summary(2.0)["rings"])
    assert (near["ring"], near["chunks"], near["misses"]) == ("full:8", 2, 0)
    assert (far["ring"], far["chunks"], far["misses"]) == ("root", 2, 3)
    assert far["lateness_ms"]["max"] == pytest.approx(400, rel=2e-3)
    assert tally.misses == 3 and tally.lateness.count == 6


def test_who_is_seen_only_by_a_part_of_the_time_is_a_part_of_a_person():
    r, tally = ringed(until=START + 2.0)
    tally.agents = 2
    for number in range(5):
        added = [1] if number == 0 else []
        r.take(seen(0, (1, number, 0.2 * number), added=added), START + 0.2 * number)
    found = tally.summary(2.0)
    assert [ring["people"] for ring in found["rings"]] == [0.5, 0.0]
    assert found["rings"][0]["share"] == 0.25 and found["unseen_share"] == 0.75


@pytest.mark.parametrize(
    ("second", "pops"),
    [
        (seen(0, (1, 6, 0.2)), 0),  # from ring to ring nothing is said
        (seen(0, (1, 8, 0.6), flags=GAP), 0),
        (seen(0, (1, 8, 0.6)), 1),  # a jump of which nothing is said
        (seen(0, (2, 6, 0.2), added=[2]), 0),
        (seen(0, (2, 6, 0.2), flags=FIRST), 1),
        (seen(0, (2, 6, 0.2)), 1),
    ],
)
def test_who_appears_or_jumps_without_a_word_pops(second, pops):
    r, tally = ringed()
    begun(r)
    r.take(seen(1, (1, 5, 0.0), added=[1]), START)
    r.take(second, START + 0.2)
    assert tally.popped == pops


@pytest.mark.parametrize("taken_away", [seen(0, hidden=[1]), header()])
def test_who_was_hidden_or_is_shown_by_a_new_stream_must_be_introduced_again(taken_away):
    r, tally = ringed()
    begun(r)
    r.take(seen(0, (1, 0, 0.0), added=[1]), START)
    r.take(taken_away, START + 0.2)
    r.take(seen(0, (1, 1, 0.2)), START + 0.2)
    assert tally.popped == 1


def test_a_stream_that_begins_anew_has_lost_what_fell_due_meanwhile_and_expects_nobody():
    r, tally = ringed(until=START + 3.0)
    r.take(seen(0, (1, 0, 0.0), added=[1]), START)
    begun(r, 1.1)
    r.finish(1, START + 3.2)
    assert tally.lost == 4


def test_people_who_come_as_roots_must_be_somewhere():
    layout = motion_pb2.Tier(pose_encoding=motion_pb2.POSE_ENCODING_ROOT, frame_bytes=16)
    opening = motion_pb2.StreamHeader(tiers=[layout, layout])
    for place, malformed in ((0.0, 0), (np.nan, 1)):
        r, tally = ringed()
        r.take(motion_pb2.StreamMotionResponse(header=opening), START)
        wire = seen(1, (1, 0, 0.0), added=[1])
        wire.batch.chunks.poses = np.full((2, 4), place, "<f4").tobytes()
        wire.batch.chunks.contacts = bytes(2)
        r.take(wire, START)
        assert tally.malformed == malformed


def test_a_ring_that_the_stream_does_not_have_is_a_fault():
    r, tally = reader()
    r.take(header(), START)
    r.take(seen(1, (1, 0, 0.0), added=[1]), START)
    assert tally.malformed == 1
