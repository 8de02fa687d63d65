"""curl and a browser's WebSocket, nothing else, against the real server."""

import json
import shutil
import subprocess
import time

import pytest

from tests.viewer.chromium import Page, find_chromium

pytestmark = pytest.mark.skipif(
    not (shutil.which("curl") and find_chromium()), reason="needs curl and Chromium"
)

# The page reads the stream with the modules that the server itself provides.
FOLLOW = """
(async () => {
  const { StreamDecoder, unpackPoses } = await import("/client/index.js");
  globalThis.follow = (address, enough) => new Promise((resolve) => {
    const found = { header: null, chunks: [], events: [], token: "", close: null };
    const decoder = new StreamDecoder();
    const socket = new WebSocket(address);
    socket.binaryType = "arraybuffer";
    const end = () => socket.close();
    socket.onclose = ({ code, reason }) => resolve({ ...found, close: [code, reason] });
    socket.onmessage = ({ data }) => {
      const kind = decoder.decode(new Uint8Array(data));
      if (kind === "header") found.header = decoder.header;
      if (kind === "event") found.events.push(decoder.event.kind);
      if (kind === "batch") {
        found.token = decoder.resumeToken;
        const { encoding, bones } = found.header;
        for (let row = 0; row < decoder.chunks; row += 1) {
          const { alias, seq, goalRevision, poses, frames } = decoder.chunk(row);
          const width = 3 + 4 * bones.length;
          const out = new Float32Array(frames * width);
          unpackPoses(decoder.view, poses, frames, encoding, bones.length, out);
          const last = [...out.subarray(-width).subarray(0, 3)];
          found.chunks.push({ alias, seq, goalRevision, last });
        }
      }
      if (enough(found)) end();
    };
  });
  return true;
})()
"""


def curl(method: str, url: str, body: object = None) -> tuple[int, dict]:
    """Status and document of an answer."""
    command = ["curl", "--silent", "--show-error", "--request", method, "--max-time", "20", url]
    if body is not None:
        command += ["--header", "content-type: application/json", "--data", json.dumps(body)]
    done = subprocess.run(
        [*command, "--write-out", "\n%{http_code}"], capture_output=True, text=True, check=True
    )
    text, _, status = done.stdout.rpartition("\n")
    return int(status), json.loads(text) if text else {}


@pytest.fixture
def page(real_server, tmp_path):
    executable = find_chromium()
    assert executable
    with Page(executable, tmp_path / "profile") as opened:
        opened.call("Page.navigate", url=f"{real_server.url}/style.css")
        assert opened.evaluate(FOLLOW)
        yield opened


def test_session_agents_goals_stream_goal_change_resume(real_server, page):
    api = f"{real_server.url}/v1"
    created, session = curl("POST", f"{api}/sessions", {"basis": "gltf", "lease_s": 30})
    assert created == 201
    of_session = f"{api}/sessions/{session['session_id']}"
    created, made = curl("POST", f"{of_session}/agents", {"agents": [{"name": "Ada"}]})
    assert created == 201
    (ada,) = made["agents"]
    goal = f"{api}/agents/{ada['agent_id']}/goal"
    assert curl("PUT", goal, {"position": {"x": 0, "y": 0, "z": 3}}) == (200, {"revision": 1})

    socket = f"{api.replace('http', 'ws')}/stream?session={session['session_id']}"
    socket += "&encoding=smallest_three&fps=20"
    walked = page.evaluate(f"follow('{socket}', ({{ chunks }}) => chunks.at(-1)?.last[2] > 0.5)")
    assert walked["header"]["sentFps"] == 20 and walked["header"]["encoding"] == 3
    assert [chunk["seq"] for chunk in walked["chunks"]] == list(range(len(walked["chunks"])))
    assert {chunk["goalRevision"] for chunk in walked["chunks"]} <= {0, 1}

    # another goal without listeners: a stale one is refused, a good one accepted
    place = {"position": {"x": 0.3, "y": 0, "z": walked["chunks"][-1]["last"][2] + 0.8}}
    status, problem = curl("PUT", f"{goal}?expected_revision=0", place)
    assert status == 409 and "revision 1" in problem["detail"]
    assert curl("PUT", f"{goal}?expected_revision=1", place) == (200, {"revision": 2})
    time.sleep(0.6)

    resumed = f"{socket}&resume_token={walked['token']}"
    rest = page.evaluate(f"follow('{resumed}', ({{ events }}) => events.includes('path_done'))")
    assert rest["header"]["resumed"] is True
    after = walked["chunks"][-1]["seq"] + 1
    assert [c["seq"] for c in rest["chunks"]] == list(range(after, after + len(rest["chunks"])))
    assert rest["chunks"][-1]["goalRevision"] == 2
    assert "goal_reached" in rest["events"] and "gap" not in rest["events"]

    assert curl("POST", f"{of_session}/renew")[0] == 200
    assert curl("DELETE", of_session)[0] == 204
    gone = page.evaluate(f"follow('{socket}', () => false)")
    assert gone["close"][0] == 4404 and session["session_id"] in gone["close"][1]
