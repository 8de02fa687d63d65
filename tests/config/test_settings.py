import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from wayfarer.config import settings as config
from wayfarer.config import sources
from wayfarer.config.page import app, as_markdown, as_toml
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
    settings = sources.load({})
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
    settings = sources.load({"http_port": 21}, file)
    assert (settings.http_port, settings.grpc_port, settings.threads) == (21, 12, 3)
    assert (settings.limits.agents, settings.limits.streams) == (14, 5)


def test_file_from_the_environment(tmp_path, monkeypatch):
    monkeypatch.setenv("WAYFARER_CONFIG", str(write(tmp_path, "threads = 3")))
    assert sources.load({}).threads == 3


def test_frozen():
    with pytest.raises(ValueError, match="frozen"):
        sources.load({}).threads = 3


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("htp_port = 1", r"setting htp_port: unknown; did you mean http_port\?"),
        ("[limits]\nagnts = 4", r"setting limits\.agnts: unknown; did you mean limits\.agents\?"),
        ("colour = 1", r"setting colour: unknown; known are .*limits\.agents,"),
    ],
)
def test_unknown_keys_in_the_file(tmp_path, text, what):
    with pytest.raises(InvalidArgument, match=what):
        sources.load({}, write(tmp_path, text))


def test_all_that_is_wrong_is_told_at_once(tmp_path, monkeypatch):
    monkeypatch.setenv("WAYFARER_HTP_PORT", "1")
    monkeypatch.setenv("WAYFARER_GRPC_PORT", "fifty")
    file = write(
        tmp_path, 'threads = -1\nmodle = "x"\n[limits]\nagents = 0\n[auth]\njwt_keys = "k"'
    )
    with pytest.raises(InvalidArgument) as caught:
        sources.load({"log_level": "loud"}, file)
    told = [line.split(":")[0] for line in str(caught.value).splitlines()]
    assert sorted(told) == [
        "setting WAYFARER_HTP_PORT in the environment",
        "setting auth",
        "setting grpc_port",
        "setting limits.agents",
        "setting log_level",
        "setting modle",
        "setting threads",
    ]


def test_unknown_variables(monkeypatch):
    monkeypatch.setenv("WAYFARER_HTP_PORT", "1")
    with pytest.raises(InvalidArgument, match=r"WAYFARER_HTP_PORT.*WAYFARER_HTTP_PORT"):
        sources.load({})


def test_what_kubernetes_puts_beside_a_service_is_no_setting(monkeypatch):
    for name in ("SERVICE_HOST", "SERVICE_PORT", "SERVICE_PORT_HTTP", "PORT", "PORT_8080_TCP_ADDR"):
        monkeypatch.setenv(f"WAYFARER_{name}", "10.0.0.1")
    sources.load({})


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
        sources.load({})


def test_a_file_that_is_not_there_or_not_toml(tmp_path):
    with pytest.raises(InvalidArgument, match=r"no settings file .*nowhere\.toml"):
        sources.load({}, tmp_path / "nowhere.toml")
    with pytest.raises(InvalidArgument, match="is not TOML"):
        sources.load({}, write(tmp_path, "threads ="))


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
    assert sources.load({"host": host, "insecure_no_auth": True}).is_loopback == loopback


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.168.1.4", "example.org"])
def test_beyond_loopback_one_must_say_who_may_call(host):
    with pytest.raises(InvalidArgument) as caught:
        sources.load({"host": host})
    said = str(caught.value)
    assert host in said and "auth.keys_file" in said and "--insecure-no-auth" in said


@pytest.mark.parametrize(
    "given",
    [
        {"auth": {"keys_file": "keys.toml"}},
        {
            "auth": {
                "jwt_keys": "https://issuer.example/jwks",
                "jwt_issuer": "https://issuer.example",
            }
        },
        {"tls_cert": "a.pem", "tls_key": "a.key", "tls_client_ca": "ca.pem"},
        {"insecure_no_auth": True},
    ],
)
def test_ways_beyond_loopback(given):
    settings = sources.load({"host": "0.0.0.0", **given})
    assert settings.has_auth != settings.insecure_no_auth


@pytest.mark.parametrize(
    ("given", "what"),
    [
        ({"tls_cert": "a.pem"}, "tls_cert and tls_key belong together"),
        ({"tls_client_ca": "ca.pem"}, "tls_client_ca needs tls_cert"),
        ({"peer_tls": {"cert": "a.pem", "key": "a.key"}}, "peer_tls: cert, key and ca belong"),
        ({"auth": {"jwt_keys": "keys.json"}}, "auth: jwt_keys and jwt_issuer belong together"),
        (
            {"auth": {"jwt_keys": "http://issuer.example", "jwt_issuer": "x"}},
            "jwt_keys is a file or an https:// URL",
        ),
        ({"auth": {"jwt_algorithms": ["HS256"]}}, "'HS256' is not allowed; allowed are ES256"),
        ({"auth": {"jwt_algorithms": ["none"]}}, "'none' is not allowed"),
        ({"auth": {"jwt_algorithms": []}}, "auth.jwt_algorithms"),
        ({"auth": {"certificate_scopes": ["write"]}}, "write is no scope"),
        ({"cors_origins": ["*"]}, "is no origin"),
        ({"cors_origins": ["https://a.example/"]}, "with no path"),
        ({"allowed_hosts": ["a.example:8080"]}, "no scheme and no port"),
        ({"allowed_hosts": ["https://a.example"]}, "'https://a.example' is no host name"),
        ({"node_hosts": ["*"]}, "would let pages call every server"),
        ({"node_hosts": ["*.a.example:*"]}, "no scheme and no port"),
        ({"node_hosts": ["a.example; script-src *"]}, "is no host name"),
        ({"node_hosts": ["*.*"]}, "would let pages call every server"),
    ],
)
def test_settings_that_do_not_fit_together(given, what):
    with pytest.raises(InvalidArgument, match=what):
        sources.load(given)


def test_lists_in_the_environment(monkeypatch):
    monkeypatch.setenv("WAYFARER_CORS_ORIGINS", "https://a.example, http://b.example:8080")
    monkeypatch.setenv("WAYFARER_AUTH__JWT_ALGORITHMS", "EdDSA")
    settings = sources.load({})
    assert settings.cors_origins == ("https://a.example", "http://b.example:8080")
    assert settings.auth.jwt_algorithms == ("EdDSA",)


def test_a_group_comes_together_from_all_sources(tmp_path, monkeypatch):
    file = write(tmp_path, "[auth]\njwt_issuer = 'i'\njwt_keys = 'k.json'")
    monkeypatch.setenv("WAYFARER_AUTH__JWT_AUDIENCE", "games")
    auth = sources.load({"auth": {"keys_file": "keys.toml"}}, file).auth
    assert (auth.jwt_issuer, auth.jwt_audience, auth.keys_file) == ("i", "games", Path("keys.toml"))


def test_where_each_setting_comes_from(tmp_path, monkeypatch):
    file = write(tmp_path, "threads = 3\ngrpc_port = 2\n[limits]\nagents = 4")
    monkeypatch.setenv("WAYFARER_GRPC_PORT", "12")
    monkeypatch.setenv("WAYFARER_LIMITS__STREAMS", "14")
    found = sources.origins({"http_port": 21}, file)
    expected = {
        "http_port": "command line",
        "grpc_port": "environment",
        "limits.streams": "environment",
        "threads": str(file),
        "limits.agents": str(file),
        "host": "default",
    }
    assert {key: found[key] for key in expected} == expected
    assert set(found) == set(sources.fields())


def test_what_is_printed_is_a_settings_file(tmp_path):
    keys = {"auth": {"keys_file": "keys.toml"}, "otlp_endpoint": "http://ada:sesame@collector:4317"}
    settings = sources.load(keys)
    page = as_toml(settings, sources.origins(keys))
    assert "sesame" not in page
    assert "# command line" in page and "# tls_cert is not set" in page
    again = sources.load({}, write(tmp_path, page.replace("[hidden]", "ada:sesame")))
    assert again.model_dump() == settings.model_dump()


def test_the_schema_knows_every_setting():
    done = CliRunner().invoke(app, ["schema"])
    document = json.loads(done.stdout)
    assert set(document["properties"]) == set(config.Settings.model_fields)
    assert set(document["$defs"]["Limits"]["properties"]) == set(config.Limits.model_fields)


def test_the_settings_in_the_documents_are_these():
    page = (Path(__file__).parents[2] / "docs/operations.md").read_text()
    table = page.split("<!-- wayfarer config table -->\n")[1].split("\n<!-- end -->")[0]
    assert table == as_markdown()


def test_every_setting_is_described():
    models = (config.Settings, config.Limits, config.Auth, config.PeerTls)
    bare = [
        name
        for model in models
        for name, field in model.model_fields.items()
        if not field.description and name not in ("limits", "auth", "peer_tls")
    ]
    assert bare == []
