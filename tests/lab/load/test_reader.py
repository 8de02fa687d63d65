"""What the generator counts of a stream, from hand-made messages."""

import numpy as np
import pytest

from wayfarer.v1 import motion_pb2
from wayfarer_lab.load.reader import EVERY, Reader
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
        header=motion_pb2.StreamHeader(bones=range(BONES), frame_bytes=4 * (3 + 4 * BONES))
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


def test_with_rings_nothing_is_due_of_agents_out_of_sight():
    tally = Tally()
    r = Reader(tally, 0.0, START + 2.0, has_rings=True)
    r.take(message((1, 0, 0.0), (2, 0, 0.0)), START)
    r.goals.asked(2, 1, START)
    gone = message((1, 1, 0.2))
    gone.batch.hidden.append(2)
    r.take(gone, START + 0.2)
    r.goals.asked(2, 2, START + 0.3)
    back = message((1, 2, 0.4), (2, 7, 1.4))
    back.batch.tier = 1
    r.take(back, START + 1.4)
    r.take(message((1, 3, 0.6), (2, 8, 1.6)), START + 1.6)
    assert tally.lost == 0
    assert {tier: chunks for tier, (chunks, _) in tally.tiers.items()} == {0: 5, 1: 2}
    r.finish(agents=3, now=START + 1.8)
    assert (tally.silent, tally.unanswered) == (0, 0)
