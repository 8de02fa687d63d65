import pytest

from wayfarer.transport.origins import Origins

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
    rule = Origins(frozenset({"https://app.example"}), local_only=False)
    assert rule.allows(origin, HOST) == allowed


@pytest.mark.parametrize("host", ["evil.example:8080", "localhost.evil.example:8080"])
def test_a_foreign_name_that_points_here_is_not_this_machine(host):
    rule = Origins(local_only=True)
    assert not rule.allows(f"http://{host}", host)
    assert rule.allows("http://localhost:8080", "localhost:8080")
    assert rule.allows("http://127.0.0.1:8080", "127.0.0.1:8080")
