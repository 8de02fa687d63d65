"""What a command has started ends with it: also what has lost its parent, or does not want to."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import wayfarer

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="descendants are found on Linux")

COMMAND = """
import subprocess, sys, time
from pathlib import Path
from wayfarer.cluster.process_tree import adopt_orphans, descendants, end_descendants

earlier = subprocess.Popen(["sleep", "60"])
spared = descendants()
adopt_orphans()
subprocess.Popen(["sleep", "60"])
start = "import subprocess, sys; subprocess.Popen([sys.executable, '-m', 'wayfarer', 'node'])"
subprocess.run([sys.executable, "-c", start], cwd=sys.argv[1])  # a keeper that ends at once
while not Path(sys.argv[1], "runs").exists():
    time.sleep(0.01)
print(sorted(node for pid, node in descendants().items() if pid not in spared))
end_descendants(0.3, spared)
print(list(descendants()) == [earlier.pid])
earlier.kill()
"""

NODE = """
import signal, sys, time
from pathlib import Path

def drain(*_):
    Path("asked").touch()
    {then}

signal.signal(signal.SIGTERM, drain)
Path("runs").touch()
while True:
    time.sleep(0.01)
"""


@pytest.mark.parametrize(("then", "is_killed"), [("sys.exit()", False), ("pass", True)])
def test_an_orphan_drains_or_is_killed(tmp_path, then, is_killed):
    (tmp_path / "wayfarer.py").write_text(NODE.format(then=then))  # instead of the real one
    done = subprocess.run(
        [sys.executable, "-c", COMMAND, str(tmp_path)],
        env={**os.environ, "PYTHONPATH": str(Path(wayfarer.__file__).parents[1])},
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.stdout.splitlines()[0] == "[False, True]", done.stderr
    assert done.stdout.splitlines()[-1] == "True", "all but what was there before"
    assert (tmp_path / "asked").exists()
    assert ("did not end" in done.stdout + done.stderr) is is_killed
