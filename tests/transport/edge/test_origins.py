import socket

import pytest

from wayfarer.transport.edge.origins import Origins, own_names

HOST = "wayfarer.example:8080"


@pytest.mark.parametrize(
    ("origin", "allowed"),
    [
        (None, True),  # no browser
        ("http://wayfarer.example:8080", True),
        ("https://wayfarer.example:8080", True),
        ("http://localhost:5173", True),
        ("http://127.0.0.1", True),
        ("http://[::1]:3000", True),
        ("https://app.example", True),  # listed
        ("https://app.example:444", False),
        ("http://app.example", False),
        ("http://wayfarer.example", False),  # another port
        ("https://evil.example", False),
        ("https://localhost.evil.example", False),
        ("null", False),
        ("", False),
        ("http://[", False),
    ],
)
def test_pages_that_may_call(origin, allowed):
    rule = Origins(frozenset({"https://app.example"}))
    assert rule.allows(origin, HOST) == allowed


@pytest.mark.parametrize(
    ("host", "known"),
    [
        ("localhost", True),
        ("localhost:8080", True),
        ("LOCALHOST.:8080", True),
        ("viewer.localhost:8080", True),
        ("127.0.0.1:8080", True),
        ("[::1]:8080", True),
        ("192.168.1.5:8080", True),  # no address can be made to point elsewhere
        ("[2001:db8::5]", True),
        ("wayfarer:8080", True),  # listed
        ("Wayfarer", True),
        (f"{socket.gethostname()}:8080", True),
        (f"{socket.gethostname()}.local", True),
        ("evil.example", False),
        ("evil.example:8080", False),
        ("localhost.evil.example", False),
        ("evil-localhost", False),
        ("127.0.0.1.evil.example", False),
        ("wayfarer.evil.example", False),
        ("evil.example@localhost.evil.example", False),
        ("", False),
        ("[::1", False),
    ],
)
def test_names_of_a_server_that_asks_for_no_credentials(host, known):
    rule = Origins(names=own_names() | {"wayfarer"})
    assert rule.is_name(host) == known
    assert Origins(names=None).is_name(host)  # credentials are asked for
    assert Origins(names=frozenset({"*"})).is_name(host)
