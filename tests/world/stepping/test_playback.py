import numpy as np
import pytest

from wayfarer.spec import NEW_FRAMES
from wayfarer.world.agents.slots import SlotTable
from wayfarer.world.stepping.playback import REPLAN_FRAMES, Chunks, Playback

ROW = np.array([0])


def playing(lead=1, agents=1):
    table = SlotTable(limit=4, capacity=4)
    playback = Playback(table.rows, lead)
    for number in range(agents):
        [slot] = table.acquire(1)
        table.rows.start_frame[slot] = 100 + number
    return table.rows, playback


def chunk(number, rows=1):
    made = Chunks.empty(rows)
    made.translation[:] = number
    made.end.seed.translation[:] = number
    return made


def seqs(sent):
    return [(s.slots.tolist(), s.seq.tolist(), s.frame.tolist()) for s in sent]


def test_is_planned_a_lead_ahead_and_sent_at_its_time():
    slots, playback = playing(lead=2)
    assert playback.next_event() == 100 - 2 * NEW_FRAMES
    for number in range(3):
        when = 100 + (number - 2) * NEW_FRAMES
        assert not len(playback.due(when - 1)) and playback.due(when).tolist() == [0]
        playback.append(ROW, chunk(number))
    assert not len(playback.due(10_000)), "the ring is full"
    assert playback.send(99) == []
    assert seqs(playback.send(100)) == [([0], [0], [100])]
    assert slots.committed.seed.translation[0, 0, 0] == 0
    assert slots.planned.seed.translation[0, 0, 0] == 2


def test_replan_goes_back_to_the_end_of_what_is_kept():
    slots, playback = playing(lead=3)
    for number in range(3):
        playback.append(ROW, chunk(number))
    playback.replan(0, keep_until=100 + NEW_FRAMES)
    assert slots.planned_chunks[0] == 2 and slots.replanned[0]
    assert slots.planned.seed.translation[0, 0, 0] == 1
    playback.replan(0, keep_until=0)
    assert slots.planned_chunks[0] == 0
    assert slots.planned.seed.translation[0, 0, 0] == slots.committed.seed.translation[0, 0, 0]


def test_what_is_planned_anew_is_due_shortly_before_its_time():
    slots, playback = playing()
    playback.append(ROW, chunk(0))
    playback.replan(0, keep_until=0)
    assert slots.replanned[0]
    when = 100 - REPLAN_FRAMES
    assert playback.next_event() == when
    assert not len(playback.due(when - 1)) and playback.due(when).tolist() == [0]
    assert playback.is_due(ROW, when).all() and not playback.is_due(ROW, when - 1).any()


def test_what_is_shown_first_is_planned_first_whoever_could_be_planned_longer():
    slots, playback = playing(agents=3)
    slots.start_frame[:3] = [103, 100, 102]
    playback.append(np.array([0, 1, 2]), chunk(0, rows=3))
    playback.replan(1, keep_until=0)
    playback.send(101, only=np.array([0]))
    now = 103
    assert playback.due(now).tolist() == [1, 2, 0], "by 100, 110 and 111"
    rows = np.array([0, 1, 2])
    np.testing.assert_array_equal(playback.waited(rows, now), [0, 11, 1])
    assert playback.due(100 - REPLAN_FRAMES).tolist() == [1], "the others have time yet"


def test_what_is_held_is_shown_later_by_whole_chunks_and_planned_later_too():
    slots, playback = playing(agents=2)
    playback.append(np.array([0, 1]), chunk(0, rows=2))
    playback.hold(ROW, until=120)
    assert slots.start_frame[0] == 124 and slots.start_frame[1] == 101
    assert seqs(playback.send(123)) == [([1], [0], [101])]
    assert seqs(playback.send(124)) == [([0], [0], [124])]
    assert playback.due(123).tolist() == [1]


@pytest.mark.parametrize("until", [0, 99, 100])
def test_who_is_held_until_now_or_earlier_is_not_held(until):
    slots, playback = playing()
    playback.hold(ROW, until)
    assert slots.start_frame[0] == 100
