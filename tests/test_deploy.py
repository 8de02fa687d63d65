"""Files for Prometheus, Grafana and compose: do they name what there is?"""

import json
import os
import re
import shlex
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import typer
import yaml

from tests.cluster.nodes import Link
from tests.programs import run_program
from wayfarer.cluster.directory import Directory, LeaseRules
from wayfarer.cluster.node_finder import ClusterFigures, NodeFinder
from wayfarer.commands import cluster as cluster_command
from wayfarer.commands.serve import serve_command
from wayfarer.config import sources
from wayfarer.runtime.stats import LoopStats
from wayfarer.transport.edge.metrics import Metrics
from wayfarer.transport.edge.tls import peer_tls
from wayfarer.transport.server_options import ServerOptions

ROOT = Path(__file__).parent.parent
DEPLOY = ROOT / "deploy"
SUFFIXES = {
    "counter": ("_total",),
    "histogram": ("_bucket", "_sum", "_count"),
    "gauge": ("",),
    "info": ("_info",),
}
TARGET_LABELS = {"le", "job", "instance"}  # of histograms, and of Prometheus itself


def exported(of_cluster: bool = False) -> set[str]:
    """Names of all series."""
    metrics = Metrics()
    if of_cluster:
        finder = NodeFinder(Link(LeaseRules()))
        finder.head, finder.status = True, Directory(LeaseRules(), 1).look((0, 0))[0]
        metrics.registry.register(ClusterFigures(finder))
    metrics.refresh(LoopStats(*([0] * 9)))
    return {
        family.name + suffix
        for family in metrics.registry.collect()
        for suffix in SUFFIXES[family.type]
    }


def labels() -> set[str]:
    """Labels that some metric of ours has."""
    metrics = Metrics()
    found = {"state", "sight", "kind"}  # of collectors of our own
    for collector in set(metrics.registry._collector_to_names):
        found.update(getattr(collector, "_labelnames", ()))
    return found


def expressions() -> Iterator[str]:
    dashboard = json.loads((DEPLOY / "grafana/dashboards/wayfarer.json").read_text())
    for panel in dashboard["panels"]:
        yield from (target["expr"] for target in panel.get("targets", ()))
    for group in yaml.safe_load((DEPLOY / "prometheus/alerts.yml").read_text())["groups"]:
        yield from (rule["expr"] for rule in group["rules"])


@pytest.mark.parametrize("expression", list(expressions()))
def test_every_metric_and_label_in_dashboard_and_alerts_exists(expression):
    names = set(re.findall(r"\b(?:wayfarer|process|python)_\w+", expression))
    assert names or "up{" in expression
    assert names <= exported(of_cluster=True)
    grouped = {
        label.strip() for by in re.findall(r"by \(([^)]*)\)", expression) for label in by.split(",")
    }
    assert grouped <= labels() | TARGET_LABELS


def test_every_metric_of_ours_is_on_the_dashboard():
    shown = " ".join(expressions())
    missing = {
        name
        for name in exported()
        if name.startswith("wayfarer_") and not name.endswith(("_bucket", "_sum", "_count"))
        if name not in shown
    }
    assert missing <= {"wayfarer_build", "wayfarer_agent_steps_total"}


def test_every_metric_of_ours_is_documented():
    page = (ROOT / "docs/operations.md").read_text()
    families = {re.sub("_(total|bucket|sum|count)$", "", name) for name in exported()}
    assert [n for n in sorted(families) if n.startswith("wayfarer_") and n not in page] == []


def test_every_alert_is_documented():
    page = (ROOT / "docs/operations.md").read_text()
    (group,) = yaml.safe_load((DEPLOY / "prometheus/alerts.yml").read_text())["groups"]
    assert [rule["alert"] for rule in group["rules"] if f"`{rule['alert']}`" not in page] == []


def compose() -> dict:
    return yaml.safe_load((ROOT / "docker-compose.yml").read_text())


def test_what_compose_mounts_is_there_and_what_it_scrapes_is_a_service():
    services = compose()["services"]
    for service in services.values():
        for volume in service.get("volumes", ()):
            source = volume.split(":")[0]
            assert source in compose()["volumes"] or (ROOT / source).is_dir()
    assert scraped().split(":")[0] in services


def scraped() -> str:
    """Host and port."""
    scrape = yaml.safe_load((DEPLOY / "prometheus/prometheus.yml").read_text())
    (target,) = scrape["scrape_configs"][0]["static_configs"][0]["targets"]
    return target


def test_a_cluster_is_scraped_where_its_entry_names_its_nodes():
    scrape = yaml.safe_load((DEPLOY / "prometheus/cluster.yml").read_text())
    entry, nodes = scrape["scrape_configs"]
    (address,) = entry["static_configs"][0]["targets"]
    (found,) = nodes["http_sd_configs"]
    assert found["url"] == f"http://{address}/v1/cluster/targets"  # see tests/cluster/test_entry.py
    assert address.split(":")[0] in cluster_compose()["services"]
    assert (DEPLOY / "prometheus" / scrape["rule_files"][0]).exists()


def test_compose_sets_what_the_service_knows(monkeypatch):
    monkeypatch.setenv("WAYFARER_HOST", "0.0.0.0")  # as the image does
    for name, value in compose()["services"]["wayfarer"]["environment"].items():
        monkeypatch.setenv(name, value)
    settings = sources.load({})
    assert settings.insecure_no_auth
    origins = ServerOptions.from_settings(settings).origins
    assert origins.is_name(scraped()) and not origins.is_name("evil.example")


def test_monitoring_is_started_only_when_asked_for():
    services = compose()["services"]
    asked = {name for name, service in services.items() if service.get("profiles")}
    assert asked == set(services) - {"wayfarer"}


def cluster_compose() -> dict:
    return yaml.safe_load((ROOT / "docker-compose.cluster.yml").read_text())


def commands_of(service: dict) -> Iterator[list[str]]:
    """The words of a container's command; for a shell script, of each of its lines."""
    command = service["command"]
    if command[:2] == ["/bin/bash", "-c"]:
        for line in command[2].splitlines():
            words = shlex.split(line)
            if words[0] != "set":
                yield words[1:] if words[0] == "exec" else words
    else:
        yield command


def unknown(group: Any, words: list[str]) -> list[str]:
    """Options of a command line that its command does not have. KeyError: no such command."""
    name, *rest = words
    known = {option for param in group.commands[name].params for option in param.opts}
    return [word for word in rest if word.startswith("--") and word not in known]


def starts_in_documents() -> list[list[str]]:
    """The words after `wayfarer` of the commands in docs/ that start servers."""
    texts = [path.read_text() for path in sorted((ROOT / "docs").glob("*.md"))]
    found = re.findall(
        r"^ *[^`|#\n]*?\bwayfarer ((?:serve|cluster start)\b[^#\n]*)", "\n".join(texts), re.M
    )
    return [shlex.split(line) for line in found]


def test_servers_start_as_the_documents_say():
    commands, guarded = typer.Typer(), {"--keys-file", "--insecure-no-auth"}
    commands.command("serve")(serve_command)
    commands.add_typer(cluster_command.app, name="cluster")
    group = typer.main.get_command(commands)
    starts = starts_in_documents()
    assert {words[0] for words in starts} == {"serve", "cluster"} and len(starts) > 4
    for words in starts:
        name, *rest = words
        if name == "cluster":
            assert unknown(group.commands[name], rest) == [], words
        else:
            assert unknown(group, words) == [], words
        if "--host" in words:
            host = words[words.index("--host") + 1]
            sources.load({"host": host, "insecure_no_auth": bool(guarded & set(words))})


def test_three_nodes_in_compose_run_commands_that_there_are(monkeypatch):
    services = cluster_compose()["services"]
    assert services["node"]["deploy"]["replicas"] == 3
    run = [words for service in services.values() for words in commands_of(service)]
    assert [words[:2] for words in run] == [
        ["ray", "start"],
        ["wayfarer", "cluster"],
        ["ray", "start"],
    ]
    own = typer.main.get_command(cluster_command.app)
    assert unknown(own, run[1][2:]) == []
    assert unknown(own, ["start", "--address", "auto", "--nonsense"]) == ["--nonsense"]
    for service in services.values():
        assert (ROOT / service["build"]["dockerfile"]).exists()
        environment = service["environment"]
        others = {n for n in environment if not n.startswith(("WAYFARER_", "RAY_AUTH_"))}
        assert not others
        for name, value in environment.items():
            monkeypatch.setenv(name, value)
        assert sources.load({}).insecure_no_auth
    # nodes call Ray at the service that is its head
    head = run[2][run[2].index("--address") + 1]
    assert head.split(":") == ["entry", run[0][run[0].index("--port") + 1]]


def kube_cluster() -> dict:
    """The RayCluster of deploy/kuberay."""
    return next(yaml.safe_load_all((DEPLOY / "kuberay/wayfarer.yaml").read_text()))["spec"]


def test_the_head_in_a_pod_keeps_its_state():
    others = list(yaml.safe_load_all((DEPLOY / "kuberay/wayfarer.yaml").read_text()))[1:]
    host, port = kube_cluster()["gcsFaultToleranceOptions"]["redisAddress"].split(":")
    (service,) = (
        one for one in others if one["metadata"]["name"] == host and one["kind"] == "Service"
    )
    (store,) = (one for one in others if one["kind"] == "StatefulSet")
    (container,) = store["spec"]["template"]["spec"]["containers"]
    assert store["spec"]["template"]["metadata"]["labels"] == service["spec"]["selector"]
    (there,), (here,) = service["spec"]["ports"], container["ports"]
    assert (there["port"], there["targetPort"]) == (int(port), here["name"])
    password = kube_cluster()["gcsFaultToleranceOptions"]["redisPassword"]
    assert password["valueFrom"] == container["env"][0]["valueFrom"]


def groups() -> list[dict]:
    cluster = kube_cluster()
    return [cluster["headGroupSpec"], *cluster["workerGroupSpecs"]]


def test_pods_run_commands_that_there_are():
    own = typer.main.get_command(cluster_command.app)
    (head, *nodes) = (group["template"]["spec"]["containers"][0] for group in groups())
    run = [shlex.split(line) for line in head["args"][0].splitlines()]
    (start,) = [words[1:] for words in run if "wayfarer" in words]
    assert start[:2] == ["wayfarer", "cluster"] and unknown(own, start[2:]) == []
    for container in (head, *nodes):  # Ray's own command comes from the operator
        assert "$KUBERAY_GEN_RAY_START_CMD" in container["args"][0]
    ports = {port["name"]: port["containerPort"] for port in head["ports"]}
    settings = sources.load({})
    assert ports == {"http": settings.http_port, "grpc": settings.grpc_port}
    assert head["readinessProbe"]["httpGet"] == {"path": "/v1/health/ready", "port": "http"}


def test_pods_start_ray_as_it_can_be_started():
    scripts = pytest.importorskip("ray.scripts.scripts")
    for group in groups():
        words = [f"--{name}" for name in group["rayStartParams"]]
        assert unknown(scripts.cli, ["start", *words]) == []
    assert unknown(scripts.cli, ["health-check"]) == []
    image = (DEPLOY / "kuberay/Dockerfile").read_text()
    assert f"rayproject/ray:{kube_cluster()['rayVersion']}-" in image


def test_a_pod_makes_a_certificate_that_nodes_and_ray_take(tmp_path, monkeypatch):
    text = (DEPLOY / "kuberay/wayfarer.yaml").read_text()
    pods = [group["template"]["spec"] for group in groups()]
    (made,) = pods[0]["initContainers"]
    comment = "".join(
        line[1:].rstrip("\\\n") for line in text.splitlines(keepends=True) if line[0] == "#"
    )
    authority = re.search(r"openssl req -x509.*?ca\.pem", comment)[0]
    tls, ca = tmp_path / "tls", tmp_path / "ca"
    tls.mkdir()
    ca.mkdir()
    subprocess.run(shlex.split(authority), cwd=ca, check=True)
    script = (
        made["args"][0].replace("/etc/wayfarer-tls", str(tls)).replace("/etc/wayfarer-ca", str(ca))
    )
    told = {"POD_IP": "127.0.0.9", "POD_NAME": "one", "POD_NAMESPACE": "default"}
    assert set(told) == {one["name"] for one in made["env"]}
    subprocess.run([*made["command"], script], env={**os.environ, **told}, check=True)
    for pod in pods:
        assert pod["initContainers"] == [made]
        (container,) = pod["containers"]
        for one in container["env"]:
            if "value" in one:
                here = one["value"].replace("/etc/wayfarer-tls", str(tls))
                monkeypatch.setenv(one["name"], here)
        found = peer_tls(sources.load({}).peer_tls)
        assert found is not None and found.cert == tls / "node.pem"
        for ray, own in (
            ("SERVER_CERT", found.cert),
            ("SERVER_KEY", found.key),
            ("CA_CERT", found.client_ca),
        ):
            assert os.environ[f"RAY_TLS_{ray}"] == str(own)
    own, authority = tls / "node.pem", ca / "ca.pem"
    run_program("openssl", "verify", "-CAfile", authority, "-verify_ip", "127.0.0.9", own)


def test_compose_starts_ray_with_options_that_it_has():
    scripts = pytest.importorskip("ray.scripts.scripts")
    for service in cluster_compose()["services"].values():
        lines = [words for words in commands_of(service) if words[0] == "ray"]
        lines += [service["healthcheck"]["test"][1:]] if "healthcheck" in service else []
        for words in lines:
            assert unknown(scripts.cli, words[1:]) == []
