"""`make image-check`: build the image, run it, and let an agent walk in it.

It uses docker if a daemon answers, with a read-only root and no capabilities, as in compose.
Otherwise it uses buildah as root, which needs no daemon (`apt-get install buildah debootstrap`), in
a chroot with this machine's network, where the server listens on loopback. If the Dockerfile's base
image cannot be pulled, debootstrap makes one from Debian's mirror under the same name: the same
release, but not the same bytes.
"""

import argparse
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
import uuid
from collections.abc import Iterator, Sequence
from configparser import ConfigParser
from pathlib import Path

from tests.installed.process import PORTS, WALK, StepError, run, serving, tail

ROOT = Path(__file__).resolve().parent.parent.parent
BASE = re.findall(r"^FROM (\S+)", (ROOT / "Dockerfile").read_text(), re.MULTILINE)[0]
STORE = ROOT / "build/image-check"
MIRROR = "http://deb.debian.org/debian"


def main() -> int:
    """Returns the exit code: 1 when a step failed, 2 when there is nothing to build with."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--with", dest="tool", choices=["docker", "buildah"])
    parser.add_argument("--limit", type=float, default=900, help="seconds for all of it [900]")
    given = parser.parse_args()
    tool = given.tool or found_tool()
    if not tool:
        print("needs docker with a daemon, or buildah: apt-get install buildah debootstrap")
        return 2
    until = time.monotonic() + given.limit
    try:
        (with_docker if tool == "docker" else with_buildah)(until)
    except StepError as error:
        print(f"FAILED: {error}")
        return 1
    print("the image is built, runs, and an agent walks in it")
    return 0


def found_tool() -> str:
    """Which of the two can work here; empty: none."""
    if shutil.which("docker"):
        asked = subprocess.run(["docker", "info"], capture_output=True, check=False)
        if asked.returncode == 0:
            return "docker"
        print("docker: no daemon answers")
    return "buildah" if shutil.which("buildah") else ""


def with_docker(until: float) -> None:
    """Raises StepError."""
    tag = f"wayfarer:check-{uuid.uuid4().hex[:8]}"
    print(f"docker: base {BASE}")
    run(["docker", "build", "--tag", tag, "."], ROOT, until)
    published = ("--publish", "127.0.0.1::8080", "--publish", "127.0.0.1::50051")
    confined = ("--read-only", "--tmpfs", "/tmp", "--cap-drop", "ALL")
    confined += ("--security-opt", "no-new-privileges:true")
    started = ["docker", "run", "--detach", *confined, *published, tag, "serve"]
    container = run([*started, "--insecure-no-auth"], ROOT, until).strip()
    try:
        inside = ["docker", "exec", container]
        ports = [
            run(["docker", "port", container, port], ROOT, until) for port in ("8080", "50051")
        ]
        http, grpc = (port.splitlines()[0].strip() for port in ports)
        while True:
            try:
                print(f"probe: {run([*inside, 'wayfarer', 'probe'], ROOT, until).strip()}")
                break
            except StepError:
                if time.monotonic() > until:
                    raise StepError(tail(run(["docker", "logs", container], ROOT, until))) from None
                time.sleep(1)
        print(f"in it: {run([*inside, *describe()], ROOT, until).strip()}")
        print(run([sys.executable, str(WALK), f"http://{http}", grpc], ROOT, until).strip())
        run(["docker", "stop", "--time", "30", container], ROOT, time.monotonic() + 60)
        code = run(["docker", "inspect", "--format", "{{.State.ExitCode}}", container], ROOT, until)
        if code.strip() != "0":
            raise StepError(f"it ended with {code.strip()}")
    finally:
        for command in (["docker", "rm", "--force", container], ["docker", "rmi", tag]):
            subprocess.run(command, capture_output=True, check=False)


def describe() -> list[str]:
    """A command that prints its user and program."""
    ask = "import os, sys, numpy, onnxruntime as o; print('user', os.getuid(), 'Python',"
    return ["python", "-c", f"{ask} sys.version.split()[0], 'numpy', numpy.__version__,"
            " 'onnxruntime', o.__version__)"]  # fmt: skip


def with_buildah(until: float) -> None:
    """Raises StepError."""
    STORE.mkdir(parents=True, exist_ok=True)
    buildah = ["buildah", "--root", str(STORE / "images"), "--runroot", str(STORE / "run")]
    provide_base(buildah, until)
    tag = "localhost/wayfarer:check"
    build = [*buildah, "build", "--isolation", "chroot", "--pull-never", "--tag", tag]
    run([*build, *way_to_packages(), "."], ROOT, until)
    image = json.loads(run([*buildah, "inspect", "--type", "image", tag], ROOT, until))
    config = image["OCIv1"]["config"]
    container = run([*buildah, "from", "--pull-never", tag], ROOT, until).strip()
    try:
        into = [*buildah, "run", "--isolation", "chroot", container, "--"]
        print(f"buildah: user {config['User']}, {config['Entrypoint']} {config['Cmd']}")
        print(f"in it: {run([*into, *describe()], ROOT, until).strip()}")
        # the container has this machine's network: loopback and free ports, and so no open door
        serve = [*config["Entrypoint"], *config["Cmd"], "--host", "127.0.0.1", *PORTS]
        tell = ["sh", "-c", 'echo "pid $$"; exec "$@"', "sh"]
        with serving([*into, *tell, *serve], ROOT, until, stop=terminate) as (http, grpc):
            port = http.rpartition(":")[2]
            probe = ["env", f"WAYFARER_HTTP_PORT={port}", "wayfarer", "probe"]
            print(f"probe: {run([*into, *probe], ROOT, until).strip()}")
            print(run([sys.executable, str(WALK), http, grpc], ROOT, until).strip())
    finally:
        for command in (["rm", container], ["rmi", tag]):
            subprocess.run([*buildah, *command], capture_output=True, check=False)


def terminate(process: subprocess.Popen[bytes], said: str) -> None:
    """SIGTERM to the server itself: buildah, when it gets one, kills what it runs."""
    (pid,) = re.findall(r"^pid (\d+)$", said, re.MULTILINE)
    os.kill(int(pid), signal.SIGTERM)


def provide_base(buildah: Sequence[str], until: float) -> None:
    """Pull the base image, or make it. Raises StepError."""
    name = f"docker.io/library/{BASE}"
    made = "localhost/made-by-debootstrap"
    listed = run([*buildah, "images", "--format", "{{.Name}}:{{.Tag}}"], ROOT, until).split()
    if f"{made}:latest" in listed:
        print(f"base {BASE}: made by debootstrap at an earlier run ({STORE} keeps it)")
        return
    try:
        run([*buildah, "pull", "--quiet", name], ROOT, min(until, time.monotonic() + 120))
        print(f"base {BASE}: as published")
        return
    except StepError:
        print(f"base {BASE}: cannot be pulled here")
    suite = re.fullmatch(r"debian:(\w+)-slim", BASE)
    if not suite:
        raise StepError(f"no way is known to make the base image {BASE}")
    folder = STORE / "base"
    shutil.rmtree(folder, ignore_errors=True)
    run(["debootstrap", "--variant=minbase", suite[1], str(folder), MIRROR], ROOT, until)
    container = run([*buildah, "from", "scratch"], ROOT, until).strip()
    run([*buildah, "add", "--quiet", container, str(folder), "/"], ROOT, until)
    run([*buildah, "config", "--cmd", "bash", container], ROOT, until)
    run([*buildah, "commit", "--quiet", "--rm", container, name], ROOT, until)
    run([*buildah, "tag", name, made], ROOT, until)
    shutil.rmtree(folder, ignore_errors=True)
    print(f"base {BASE}: made by debootstrap from {MIRROR} (minbase), and given that name")


def way_to_packages() -> Iterator[str]:
    """Options that let pip in the build reach what it reaches here: settings, certificates, files.

    They exist while the image is built; a machine without a private registry has none of them.
    """
    settings = ConfigParser(interpolation=None)
    settings.read(["/etc/pip.conf", Path.home() / ".config/pip/pip.conf"])
    text = " ".join(value for part in settings.sections() for value in settings[part].values())
    paths = re.findall(r"(?:file://)?(/[\w./-]+)", text)
    # an index has its files next to its folder `simple`
    folders = {path.removesuffix("/").removesuffix("/simple") for path in paths}
    for path in sorted(path for path in folders if Path(path).is_dir()):
        yield f"--volume={path}:{path}:ro"
    certificates = settings.get("global", "cert", fallback=os.environ.get("SSL_CERT_FILE", ""))
    if certificates:
        settings.read_dict({"global": {"cert": "/run/certificates.crt"}})
        yield f"--volume={certificates}:/run/certificates.crt:ro"
    if settings.sections():
        with (STORE / "pip.conf").open("w") as file:
            settings.write(file)
        yield f"--volume={STORE}/pip.conf:/etc/pip.conf:ro"


if __name__ == "__main__":
    sys.exit(main())
