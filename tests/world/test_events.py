"""Events survive in a kept session: the places in their sentences are places again."""

from pydantic import TypeAdapter

from wayfarer.errors import Metres, Place
from wayfarer.world.events import Event, EventKind


def test_the_parts_of_a_sentence_come_back_from_json_as_what_they_were():
    kept = TypeAdapter(Event)
    parts = (Metres(0.5), Place((1.0, -2.0, 0.25)), "a word")
    event = Event(EventKind.GOAL_MOVED, 1.5, "agent-1", detail="{} from {}: {}", parts=parts)
    assert kept.validate_json(kept.dump_json(event)) == event
    assert str(event.text) == "0.5 m from (1, -2, 0.25): a word"


def test_an_event_of_an_earlier_build_has_no_parts_and_keeps_its_braces():
    old = TypeAdapter(Event).validate_json('{"kind": "gap", "at": 1.0, "detail": "a {} b"}')
    assert str(old.text) == "a {} b"
