"""What the generator counts of a stream, from hand-made messages."""

from wayfarer.load.reader import Reader
from wayfarer.load.tally import Tally
from wayfarer.v1 import motion_pb2

START = 1000.0


def message(*chunks):
    """Chunks of (alias, seq, scheduled seconds after the start, revision)."""
    return motion_pb2.StreamMotionResponse(
        batch=motion_pb2.MotionBatch(
            chunks=[
                motion_pb2.MotionChunk(
                    alias=alias,
                    seq=seq,
                    scheduled_at_us=int(1e6 * (START + at)),
                    goal_revision=revision,
                )
                for alias, seq, at, revision in chunks
            ]
        )
    )


def reader(measuring_from=0.0):
    return Reader(Tally(), measuring_from)


def test_lost_and_late_primitives_are_misses():
    r = reader()
    r.take(message((1, 7, 0.0, 0), (2, 3, 0.0, 0)), START)
    r.take(message((1, 8, 0.2, 0), (2, 6, 0.6, 0)), START + 0.21)  # agent 2 lost two
    r.take(message((1, 9, 0.4, 0)), START + 0.61)  # after its last frame's time
    assert r.tally.chunks == 5
    assert r.tally.misses == 3


def test_the_warm_up_does_not_count():
    r = reader(measuring_from=START + 1)
    r.take(message((1, 0, 0.0, 0)), START + 0.9)
    r.take(message((1, 1, 1.0, 0)), START + 1.0)
    assert r.tally.chunks == 1 and r.tally.misses == 0


def test_goal_latency_runs_from_the_command_to_the_first_changed_pose():
    r = reader()
    r.asked(1, 4, START)
    r.take(message((1, 0, 0.0, 3)), START + 0.1)
    assert r.tally.goal_latency.count == 0
    r.take(message((1, 1, 0.2, 4)), START + 0.25)
    assert round(r.tally.goal_latency.milliseconds()["max"]) == 250


def test_a_chunk_that_is_quicker_than_the_reply_counts_too():
    r = reader()
    r.take(message((1, 1, 0.0, 4)), START + 0.05)
    r.asked(1, 4, START)
    assert round(r.tally.goal_latency.milliseconds()["max"]) == 50


def test_a_newer_goal_answers_for_those_it_replaced():
    r = reader()
    r.asked(1, 4, START)
    r.asked(1, 5, START + 0.1)
    r.take(message((1, 1, 0.2, 5)), START + 0.3)
    assert r.tally.goal_latency.count == 2
