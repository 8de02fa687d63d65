from hashlib import sha256

import pytest
from structlog.testing import capture_logs

from tests.world.fakes import ManualClock
from wayfarer.errors import InvalidArgument, Unauthenticated
from wayfarer.transport.auth.keys import POLL_S, KeyFile, new_key
from wayfarer.transport.edge.caller import Quota, Scope

# fixed, since parametrized tests need the same names in every process
STUDIO, OTHER = "wf_" + "s" * 43, "wf_" + "o" * 43
DIGEST, OTHER_DIGEST = (sha256(key.encode()).hexdigest() for key in (STUDIO, OTHER))
FILE = f"""
[keys.studio]
sha256 = "{DIGEST}"
scopes = ["read", "control"]
quota = {{ agents = 16, calls_per_second = 5 }}
"""
ADDED = f"""
[keys.other]
sha256 = "{OTHER_DIGEST}"
scopes = ["admin"]
"""


@pytest.fixture
def path(tmp_path):
    path = tmp_path / "keys.toml"
    path.write_text(FILE)
    return path


def test_a_key_stands_for_a_caller_with_scopes_and_quota(path):
    caller = KeyFile(path).caller(STUDIO)
    assert caller.name == "key:studio"
    assert caller.scopes == {Scope.READ, Scope.CONTROL}
    assert caller.quota == Quota(agents=16, calls_per_second=5)


@pytest.mark.parametrize("key", ["", "wf_", OTHER, STUDIO[:-1], STUDIO + "x", "wf_ü", DIGEST])
def test_other_keys_are_unknown(path, key):
    with pytest.raises(Unauthenticated, match="unknown API key"):
        KeyFile(path).caller(key)


def test_a_changed_file_is_read_again(path):
    clock = ManualClock()
    keys = KeyFile(path, clock)
    path.write_text(FILE + ADDED)
    with pytest.raises(Unauthenticated):  # looked at just now
        keys.caller(OTHER)
    clock.now += POLL_S
    assert keys.caller(OTHER).name == "key:other"
    path.write_text(ADDED)
    clock.now += POLL_S
    with pytest.raises(Unauthenticated):
        keys.caller(STUDIO)


def test_reload_does_not_wait(path):
    keys = KeyFile(path, ManualClock())
    path.write_text(ADDED)
    keys.reload()
    assert keys.caller(OTHER)


@pytest.mark.parametrize("damage", ["keys = 3", "[keys.", None])
def test_a_file_that_has_gone_bad_changes_nothing_and_is_logged(path, damage):
    clock = ManualClock()
    keys = KeyFile(path, clock)
    if damage is None:
        path.unlink()
    else:
        path.write_text(damage)
    clock.now += POLL_S
    with capture_logs() as lines:
        assert keys.caller(STUDIO)
    assert "stay good" in lines[0]["event"] and lines[0]["log_level"] == "error"


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("[keys.a]\nsha256 = 'abc'\nscopes = ['read']", r"keys\.a\.sha256"),
        (f"[keys.a]\nsha256 = '{DIGEST}'\nscopes = ['write']", r"keys\.a\.scopes.*'read'"),
        (f"[keys.a]\nsha256 = '{DIGEST}'\nscopes = []", r"keys\.a\.scopes"),
        (f"[keys.a]\nsha256 = '{DIGEST}'", r"keys\.a\.scopes: Field required"),
        (f"[keys.'a b']\nsha256 = '{DIGEST}'\nscopes = ['read']", "keys.a b"),
        (FILE + "quotas = 1", r"keys\.studio\.quotas"),
        ("[[keys", "not TOML"),
    ],
)
def test_a_bad_file_at_the_start_names_the_entry(path, text, what):
    path.write_text(text)
    with pytest.raises(InvalidArgument, match=what) as caught:
        KeyFile(path)
    assert DIGEST not in str(caught.value)


def test_a_missing_file(tmp_path):
    with pytest.raises(InvalidArgument, match=r"keys\.toml: No such file"):
        KeyFile(tmp_path / "keys.toml")


def test_keys_are_new_each_time():
    assert len({new_key()[0] for _ in range(100)}) == 100
    assert len(STUDIO) >= 43 and STUDIO.startswith("wf_")


def test_a_caller_is_good_as_long_as_its_key_opens_as_much(path):
    clock = ManualClock()
    keys = KeyFile(path, clock)
    studio = keys.caller(STUDIO)

    def is_good(content: str) -> bool:
        path.write_text(content)
        clock.now += POLL_S
        return keys.is_good(studio)

    assert keys.is_good(studio)
    assert is_good(FILE + ADDED)
    assert is_good(FILE.replace("agents = 16", "agents = 1")), "it may keep the agents that it has"
    assert is_good(FILE.replace("control", "admin")) is False, "a scope was taken from it"
    assert is_good(FILE.replace(DIGEST, OTHER_DIGEST)) is False, "another key has its name"
    assert is_good(FILE)
    assert is_good("not TOML"), "a bad file changes nothing"
    assert is_good(ADDED) is False


def test_the_key_of_a_caller_is_not_shown(path):
    assert DIGEST not in repr(KeyFile(path).caller(STUDIO))
    assert bytes.fromhex(DIGEST) not in repr(KeyFile(path).caller(STUDIO)).encode()
