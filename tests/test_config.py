from pathlib import Path

import pytest

from wayfarer import config
from wayfarer.errors import InvalidArgument


@pytest.fixture(autouse=True)
def clean(monkeypatch):
    import os

    for name in list(os.environ):
        if name.startswith("WAYFARER_"):
            monkeypatch.delenv(name)


def write(folder: Path, text: str) -> Path:
    path = folder / "wayfarer.toml"
    path.write_text(text)
    return path


def test_defaults():
    settings = config.load({})
    assert (settings.host, settings.http_port, settings.grpc_port) == ("127.0.0.1", 8080, 50051)
    assert settings.is_loopback


def test_first_wins_command_line_environment_file(tmp_path, monkeypatch):
    file = write(
        tmp_path,
        "http_port = 1\ngrpc_port = 2\nthreads = 3\n[limits]\nagents = 4\nstreams = 5\n",
    )
    monkeypatch.setenv("WAYFARER_HTTP_PORT", "11")
    monkeypatch.setenv("WAYFARER_GRPC_PORT", "12")
    monkeypatch.setenv("WAYFARER_LIMITS__AGENTS", "14")
    settings = config.load({"http_port": 21}, file)
    assert (settings.http_port, settings.grpc_port, settings.threads) == (21, 12, 3)
    assert (settings.limits.agents, settings.limits.streams) == (14, 5)


def test_file_from_the_environment(tmp_path, monkeypatch):
    monkeypatch.setenv("WAYFARER_CONFIG", str(write(tmp_path, "threads = 3")))
    assert config.load({}).threads == 3


def test_frozen():
    with pytest.raises(ValueError, match="frozen"):
        config.load({}).threads = 3


@pytest.mark.parametrize("text", ["htp_port = 1", "[limits]\nagnts = 4"])
def test_unknown_keys_in_the_file(tmp_path, text):
    with pytest.raises(InvalidArgument, match=r"unknown; known are .*limits\.agents,"):
        config.load({}, write(tmp_path, text))


def test_unknown_variables(monkeypatch):
    monkeypatch.setenv("WAYFARER_HTP_PORT", "1")
    with pytest.raises(InvalidArgument, match=r"WAYFARER_HTP_PORT.*WAYFARER_HTTP_PORT"):
        config.load({})


def test_what_kubernetes_puts_beside_a_service_is_no_setting(monkeypatch):
    for name in ("SERVICE_HOST", "SERVICE_PORT", "SERVICE_PORT_HTTP", "PORT", "PORT_8080_TCP_ADDR"):
        monkeypatch.setenv(f"WAYFARER_{name}", "10.0.0.1")
    config.load({})


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("HTTP_PORT", "70000"),
        ("HTTP_PORT", "eighty"),
        ("LIMITS__AGENTS", "0"),
        ("LIMITS__GOAL_DISTANCE_M", "inf"),
        ("LOG_LEVEL", "loud"),
    ],
)
def test_values_out_of_range_are_named(monkeypatch, name, value):
    monkeypatch.setenv("WAYFARER_" + name, value)
    key = name.lower().replace("__", ".")
    with pytest.raises(InvalidArgument, match=f"setting {key}: .*got"):
        config.load({})


def test_a_file_that_is_not_there_or_not_toml(tmp_path):
    with pytest.raises(InvalidArgument, match=r"no settings file .*nowhere\.toml"):
        config.load({}, tmp_path / "nowhere.toml")
    with pytest.raises(InvalidArgument, match="is not TOML"):
        config.load({}, write(tmp_path, "threads ="))


@pytest.mark.parametrize(
    ("host", "loopback"),
    [
        ("127.0.0.1", True),
        ("127.8.8.8", True),
        ("::1", True),
        ("localhost", True),
        ("0.0.0.0", False),
        ("::", False),
        ("192.168.1.4", False),
        ("example.org", False),
    ],
)
def test_loopback(host, loopback):
    assert config.load({"host": host}).is_loopback == loopback
