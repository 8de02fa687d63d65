import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.world.fakes import ManualClock
from wayfarer_client import Agent, Batch, Flag, Frames, JitterBuffer
from wayfarer_client.quaternions import slerp

START = 1000.0


def agent(alias: int = 1) -> Agent:
    return Agent(
        agent_id=f"agent-{alias}",
        alias=alias,
        session_id="session-1",
        name="",
        body="anny52",
        gender="female",
        betas=(),
        seed=0,
        state="walking",
        position=(0, 0, 0),
        heading=0,
        goal=None,
        goal_revision=0,
        created_at=START,
        rest_offsets=np.zeros((52, 3), np.float32),
    )


def frames(seq: int, alias: int = 1, start: float = START, state: str = "walking") -> Frames:
    """Hips move 1 m/s along x; the first bone turns 1 rad/s about y."""
    times = start + seq * 0.2 + np.arange(8) / 40
    elapsed = times - START
    rotations = np.zeros((8, 22, 4), np.float32)
    rotations[..., 3] = 1
    rotations[:, 0, 1], rotations[:, 0, 3] = np.sin(elapsed / 2), np.cos(elapsed / 2)
    return Frames(
        agent=agent(alias),
        seq=seq,
        first_frame=8 * seq,
        goal_revision=0,
        state=state,
        flags=Flag.NONE,
        times=times,
        translation=np.outer(elapsed, [1, 0, 0]).astype(np.float32),
        rotations=rotations,
        contacts=np.tile([True, False], (8, 1)),
    )


class Clock(ManualClock):
    offset = 0.0
    """Seconds by which the viewer's clock is ahead of the server's."""


def arrive(buffer: JitterBuffer, clock: Clock, *chunks: Frames, late: float = 0.0) -> None:
    """Sent at the first frame's time; arrives `late` seconds after that."""
    sent_at = chunks[0].times[0]
    clock.now += sent_at + late - clock.now + clock.offset
    buffer.push(Batch(sent_at, chunks))


@pytest.fixture
def clock():
    return Clock(START)


DELAY = 0.35  # of a stream without history


@given(st.floats(0.0, 0.2))
def test_plays_delayed_and_between_frames(elapsed):
    clock = Clock(START)
    buffer = JitterBuffer(clock=clock)
    for seq in range(3):
        arrive(buffer, clock, frames(seq))
    pose = buffer.sample(START + DELAY + elapsed)["agent-1"]
    assert pose.translation[0] == pytest.approx(elapsed, abs=1e-3)
    turn = 2 * np.arctan2(pose.rotations[0, 1], pose.rotations[0, 3])
    assert turn == pytest.approx(elapsed, abs=1e-3)
    assert not pose.held


@pytest.mark.parametrize("offset", [-3600.0, 5.0])
def test_clocks_need_not_agree(clock, offset):
    clock.offset = offset
    buffer = JitterBuffer(clock=clock)
    arrive(buffer, clock, frames(0), late=0.08)
    arrive(buffer, clock, frames(1), late=0.02)  # the quickest tells
    pose = buffer.sample(START + offset + 0.02 + DELAY + 0.1)["agent-1"]
    assert pose.translation[0] == pytest.approx(0.1, abs=1e-3)


def test_before_its_time_an_agent_waits_on_its_first_frame(clock):
    buffer = JitterBuffer(clock=clock)
    assert buffer.sample() == {}
    arrive(buffer, clock, frames(0))
    pose = buffer.sample(START + DELAY - 0.05)["agent-1"]
    assert pose.translation[0] == 0 and not pose.held


def test_holds_the_last_frame_when_frames_run_out_and_blends_into_the_next(clock):
    buffer = JitterBuffer(clock=clock)
    arrive(buffer, clock, frames(0))
    buffer.sample(START + DELAY)
    for later in (0.4, 0.5):
        pose = buffer.sample(START + DELAY + later)["agent-1"]
        assert pose.held and pose.translation[0] == pytest.approx(0.175)
    assert buffer.underruns == 1
    for seq in range(1, 6):
        arrive(buffer, clock, frames(seq))
    last = 0.175
    for later in np.arange(0.5, 1.0, 0.025):
        pose = buffer.sample(START + DELAY + later)["agent-1"]
        assert not pose.held and 0 <= pose.translation[0] - last < 0.12
        last = pose.translation[0]
    assert buffer.underruns == 1


def test_after_a_late_chunk_it_plays_later(clock):
    buffer = JitterBuffer(clock=clock)
    arrive(buffer, clock, frames(0))
    buffer.sample(clock.now)
    before = buffer.delay
    clock.now = START + 0.6
    buffer.push(Batch(START + 0.6, ()))  # batches come at once,
    clock.now = START + 0.8
    buffer.push(Batch(START + 0.8, (frames(1),)))  # but this chunk was made late
    for elapsed in np.arange(0.8, 12, 1 / 30):
        clock.now = START + elapsed
        buffer.sample()
    assert buffer.delay == pytest.approx(0.66, abs=0.01) and buffer.delay > before


def test_crosses_a_gap_in_a_straight_line(clock):
    buffer = JitterBuffer(clock=clock)
    arrive(buffer, clock, frames(0))
    arrive(buffer, clock, frames(2))
    pose = buffer.sample(START + DELAY + 0.3)["agent-1"]
    assert pose.translation[0] == pytest.approx(0.3, abs=1e-3)


def test_removed_agents_disappear(clock):
    buffer = JitterBuffer(clock=clock)
    arrive(buffer, clock, frames(0, 1), frames(0, 2))
    buffer.push(Batch(START + 0.1, (), removed=(agent(1),)))
    assert list(buffer.sample(START + 0.5)) == ["agent-2"]


def test_state_is_that_of_the_frames_shown(clock):
    buffer = JitterBuffer(clock=clock)
    arrive(buffer, clock, frames(0, state="walking"))
    arrive(buffer, clock, frames(1, state="stopping"))
    assert buffer.sample(START + DELAY + 0.1)["agent-1"].state == "walking"
    assert buffer.sample(START + DELAY + 0.25)["agent-1"].state == "stopping"


def test_memory_is_bounded_even_when_nobody_looks(clock):
    buffer = JitterBuffer(clock=clock)
    for seq in range(200):
        arrive(buffer, clock, frames(seq))
    pose = buffer.sample()["agent-1"]
    assert pose.translation[0] == pytest.approx(40.0, abs=1)
    assert len(buffer._members["agent-1"].track) <= 400


def test_frames_that_come_again_after_a_reconnection_are_dropped(clock):
    buffer = JitterBuffer(clock=clock)
    for seq in (5, 6, 5, 6, 7):
        arrive(buffer, clock, frames(seq))
    assert len(buffer._members["agent-1"].track) == 24


def test_motion_missed_while_the_connection_was_lost_does_not_count_as_late(clock):
    buffer = JitterBuffer(clock=clock)
    arrive(buffer, clock, frames(0))
    clock.now = START + 2.0
    for seq in range(1, 10):
        buffer.push(Batch(START + 2.0, (frames(seq),), resumed_at=START + 2.0))
    buffer.sample()
    assert buffer.delay < 0.4
    clock.now = START + 2.5
    buffer.push(Batch(START + 2.5, (frames(10),), resumed_at=START + 2.0))  # late, not missed
    assert buffer._playout.wanted_delay(clock.now) == pytest.approx(0.5 + 0.06, abs=0.01)


unit = st.lists(st.floats(-1, 1), min_size=4, max_size=4).filter(lambda q: np.linalg.norm(q) > 0.1)


@given(unit, unit, st.floats(0, 1))
def test_slerp(a, b, share):
    a, b = (np.array(q) / np.linalg.norm(q) for q in (a, b))
    mixed = slerp(a, b, share)
    assert np.linalg.norm(mixed) == pytest.approx(1, abs=1e-6)
    whole = 2 * np.arccos(min(1.0, abs(a @ b)))
    part = 2 * np.arccos(min(1.0, abs(a @ mixed)))
    assert part == pytest.approx(share * whole, abs=2e-3)  # arccos is rough near 1
    np.testing.assert_allclose(slerp(a, b, 0.0), a, atol=1e-6)
    np.testing.assert_allclose(slerp(a, -a, 0.5), a, atol=1e-6)
