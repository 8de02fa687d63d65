"""homes.json: a client's next calls, and its memory, for lists of answers.

It is written by hand, since it is the rule itself ("Many nodes" of clients/README.md).
"""

import json
from pathlib import Path
from typing import Any, Final

HOMES = Path(__file__).parent / "homes.json"
ENTRY: Final = "http://entry:8080"
A, B, C = ("http://a:1", "http://b:2", "http://c:3")
SESSION, AGENT, PATH = "session-00ff12", "agent-00ff34", "/v1/sessions/session-00ff12/agents"
TO: Final = {"a": ["a", 1], "b": ["b", 2], "c": ["c", 3]}


def misdirected(node: str) -> dict[str, Any]:
    return {"misdirected": TO[node]}


def call(about: str, *steps: tuple[str, dict[str, Any]], fails: bool = False) -> dict[str, Any]:
    """`steps`: each call and its answer. `fails`: the caller gets the last answer."""
    return {
        "about": about,
        "called": [address for address, _ in steps],
        "answers": [answer for _, answer in steps],
        "fails": fails,
    }


DOES: Final = {"answered": ""}
AWAY: Final = {"unavailable": True}
HOME_A: Final = call(SESSION, (ENTRY, misdirected("a")), (A, DOES))


def case(name: str, *calls: dict[str, Any], home: str, entry: str = ENTRY) -> dict[str, Any]:
    """`home`: the address for calls on the session afterwards."""
    return {"name": name, "entry": entry, "calls": calls, "about": SESSION, "home": home}


CASES: Final = [
    case("one server", call(SESSION, (ENTRY, DOES)), home=ENTRY),
    case("one server that is away", call(SESSION, (ENTRY, AWAY), fails=True), home=ENTRY),
    case(
        "what was made is remembered, with all of its slot",
        call("", (ENTRY, misdirected("a")), (A, {"answered": SESSION})),
        call(AGENT, (A, DOES)),
        call(PATH, (A, DOES)),
        call("scene-00ff56", (A, DOES)),
        call("session-00fe12", (ENTRY, DOES)),
        call("", (ENTRY, DOES)),
        home=A,
    ),
    case("what was looked for is remembered", HOME_A, call(AGENT, (A, DOES)), home=A),
    case(
        "its node is gone: the entry knows the next one",
        HOME_A,
        call(PATH, (A, AWAY), (ENTRY, misdirected("b")), (B, DOES)),
        call(AGENT, (B, DOES)),
        home=B,
    ),
    case(
        "it has moved: its node knows where to",
        HOME_A,
        call(SESSION, (A, misdirected("b")), (B, DOES)),
        home=B,
    ),
    case(
        "it has moved twice: the entry is asked again",
        HOME_A,
        call(
            SESSION, (A, misdirected("b")), (B, misdirected("a")),
            (ENTRY, misdirected("c")), (C, DOES),
        ),
        home=C,
    ),
    case(
        "it has moved to a node that is gone",
        HOME_A,
        call(SESSION, (A, misdirected("b")), (B, AWAY), (ENTRY, misdirected("c")), (C, DOES)),
        home=C,
    ),
    case(
        "sent round, it is given up and forgotten",
        call(SESSION, (ENTRY, misdirected("a")), (A, misdirected("b")), fails=True),
        home=ENTRY,
    ),
    case(
        "four calls are the most",
        HOME_A,
        call(
            SESSION, (A, misdirected("b")), (B, misdirected("a")),
            (ENTRY, misdirected("a")), (A, misdirected("b")), fails=True,
        ),
        home=ENTRY,
    ),
    case(
        "the node that the entry names is gone",
        call(SESSION, (ENTRY, misdirected("a")), (A, AWAY), fails=True),
        home=ENTRY,
    ),
    case(
        "node and entry are gone; later the entry is back",
        HOME_A,
        call(SESSION, (A, AWAY), (ENTRY, AWAY), fails=True),
        call(SESSION, (ENTRY, misdirected("b")), (B, DOES)),
        home=B,
    ),
    case(
        "a place without a port is none",
        call(SESSION, (ENTRY, {"misdirected": ["a", 0]}), fails=True),
        home=ENTRY,
    ),
    case(
        "what is no host's name is no place",
        call(SESSION, (ENTRY, {"misdirected": ["a/v1?@b", 1]}), fails=True),
        home=ENTRY,
    ),
    case(
        "without a host it is the entry's",
        call(SESSION, ("http://entry:8080", {"misdirected": ["", 7]}), ("http://entry:7", DOES)),
        home="http://entry:7",
    ),
    case(
        "nodes of an entry with TLS are called with TLS",
        call(SESSION, ("https://walk.example", {"misdirected": ["n1", 7]}), ("https://n1:7", DOES)),
        entry="https://walk.example",
        home="https://n1:7",
    ),
    case(
        "IPv6 of a node",
        call(SESSION, (ENTRY, {"misdirected": ["fd00::2", 7]}), ("http://[fd00::2]:7", DOES)),
        home="http://[fd00::2]:7",
    ),
    case(
        "IPv6 of the entry",
        call(SESSION, ("http://[::1]:8080", {"misdirected": ["", 7]}), ("http://[::1]:7", DOES)),
        entry="http://[::1]:8080",
        home="http://[::1]:7",
    ),
    case(
        "over gRPC, addresses have no scheme",
        call(SESSION, ("entry:50051", {"misdirected": ["n1", 7]}), ("n1:7", DOES)),
        call(SESSION, ("n1:7", {"misdirected": ["", 8]}), ("entry:8", DOES)),
        entry="entry:50051",
        home="entry:8",
    ),
]  # fmt: skip

REASONS: Final = [
    ["call n1.pods.example:8080", "n1.pods.example", 8080],
    ["call :8080", "", 8080],
    ["call [fd00::2]:8080", "[fd00::2]", 8080],
    ["call n1:", "", 0],
    ["call n1:123456", "", 0],
    ["the session has ended", "", 0],
    ["", "", 0],
]
"""Close reasons of streams (code 4421), with host and port; 0: none."""


def files() -> dict[Path, bytes]:
    document = {"cases": CASES, "reasons": REASONS}
    return {HOMES: (json.dumps(document, indent=1) + "\n").encode()}
