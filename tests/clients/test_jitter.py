import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayfarer_client import Agent, Batch, Flag, Frames, JitterBuffer
from wayfarer_client.jitter import slerp

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


class Clock:
    def __init__(self, offset: float = 0.0) -> None:
        self.now = START + offset

    def __call__(self) -> float:
        return self.now


def arrive(buffer: JitterBuffer, clock: Clock, *chunks: Frames, late: float = 0.0) -> None:
    """Sent at the first frame's time; arrives `late` seconds after that."""
    sent_at = chunks[0].times[0]
    clock.now += sent_at + late - clock.now + clock.offset
    buffer.push(Batch(sent_at, chunks))


@pytest.fixture
def clock():
    made = Clock()
    made.offset = 0.0
    return made


@given(st.floats(0.0, 0.55))
def test_plays_delayed_and_between_frames(elapsed):
    clock = Clock()
    clock.offset = 0.0
    buffer = JitterBuffer(clock=clock)
    for seq in range(3):
        arrive(buffer, clock, frames(seq))
    pose = buffer.sample(START + 0.35 + elapsed)["agent-1"]
    assert pose.translation[0] == pytest.approx(elapsed, abs=1e-4)
    turn = 2 * np.arctan2(pose.rotations[0, 1], pose.rotations[0, 3])
    assert turn == pytest.approx(elapsed, abs=1e-3)
    assert not pose.held


@pytest.mark.parametrize("offset", [-3600.0, 5.0])
def test_clocks_need_not_agree(offset):
    clock = Clock()
    clock.offset = offset
    buffer = JitterBuffer(clock=clock)
    arrive(buffer, clock, frames(0), late=0.08)
    arrive(buffer, clock, frames(1), late=0.02)  # the quickest tells
    pose = buffer.sample(START + offset + 0.02 + 0.35 + 0.1)["agent-1"]
    assert pose.translation[0] == pytest.approx(0.1, abs=1e-3)


def test_nothing_before_its_time(clock):
    buffer = JitterBuffer(clock=clock)
    assert buffer.sample() == {}
    arrive(buffer, clock, frames(0))
    assert buffer.sample(START + 0.34) == {}
    assert list(buffer.sample(START + 0.36)) == ["agent-1"]


def test_holds_the_last_frame_when_frames_run_out_and_goes_on(clock):
    buffer = JitterBuffer(clock=clock)
    arrive(buffer, clock, frames(0))
    for later in (0.2, 0.9):
        pose = buffer.sample(START + 0.35 + later)["agent-1"]
        assert pose.held and pose.translation[0] == pytest.approx(0.175)
    assert buffer.underruns == 1
    for seq in range(1, 6):
        arrive(buffer, clock, frames(seq))
    assert not buffer.sample(START + 0.35 + 1.0)["agent-1"].held
    assert buffer.underruns == 1


def test_crosses_a_gap_in_a_straight_line(clock):
    buffer = JitterBuffer(clock=clock)
    arrive(buffer, clock, frames(0))
    arrive(buffer, clock, frames(2))
    pose = buffer.sample(START + 0.35 + 0.3)["agent-1"]
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
    assert buffer.sample(START + 0.35 + 0.1)["agent-1"].state == "walking"
    assert buffer.sample(START + 0.35 + 0.25)["agent-1"].state == "stopping"


def test_memory_is_bounded(clock):
    buffer = JitterBuffer(clock=clock)
    for seq in range(200):
        arrive(buffer, clock, frames(seq))
        buffer.sample()
    assert len(buffer._tracks["agent-1"].frames) < 20


def test_a_stream_that_starts_again_replaces_what_was_there(clock):
    buffer = JitterBuffer(clock=clock)
    for seq in (5, 6, 5, 6):
        arrive(buffer, clock, frames(seq))
    assert buffer.sample(START + 0.35 + 1.1)["agent-1"].translation[0] == pytest.approx(1.1)


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
