"""HTTP goals under load, with Locust (pip install './lab[locust]').

    wayfarer serve
    locust -f benchmarks/locustfile.py --host http://127.0.0.1:8080 --headless -u 20 -r 5 -t 60s

Each user has a session with one agent, gives it goals and sometimes a path, clears the goal, or
reads the agent. Locust measures calls; `wayfarer load` measures how late motion is. Locust waits
for answers (a closed loop), so its figures flatter beyond the knee.

The environment variable WAYFARER_LOAD_KEY is the API key for the server.
"""

import math
import os
import random
from typing import Any

from locust import FastHttpUser, between, task
from locust.exception import StopUser

HEADERS = {"Authorization": f"Bearer {key}"} if (key := os.environ.get("WAYFARER_LOAD_KEY")) else {}
Json = dict[str, Any]

METRES = 10.0
PATH_GOALS = 4


class Walker(FastHttpUser):
    """A client with one agent. Positions: metres, Y up (the service's default basis)."""

    wait_time = between(0.5, 2.0)
    agent = ""
    session = ""

    def on_start(self) -> None:
        """Creates the session and its agent; without them there is nothing to load."""
        self.session = self._made("/v1/sessions", {})["session_id"]
        made = self._made(f"/v1/sessions/{self.session}/agents", {"agents": [{}]})
        self.agent = f"/v1/agents/{made['agents'][0]['agent_id']}"

    def on_stop(self) -> None:
        """Ends the session."""
        if self.session:
            self.client.delete(
                f"/v1/sessions/{self.session}", headers=HEADERS, name="/v1/sessions/[id]"
            )

    @task(10)
    def set_goal(self) -> None:
        """Walks to another place."""
        self._call("PUT", "/goal", self._goal())

    @task(3)
    def set_path(self) -> None:
        """Walks along a path."""
        self._call("PUT", "/path", {"goals": [self._goal() for _ in range(PATH_GOALS)]})

    @task(2)
    def clear(self) -> None:
        """Stops."""
        self._call("DELETE", "/goal")

    @task(5)
    def look(self) -> None:
        """Reads the agent."""
        self._call("GET", "")

    def _goal(self) -> dict[str, dict[str, float]]:
        angle, reach = random.uniform(0, math.tau), METRES * math.sqrt(random.random())
        return {"position": {"x": reach * math.cos(angle), "y": 0.0, "z": reach * math.sin(angle)}}

    def _call(self, method: str, path: str, body: Json | None = None) -> None:
        name = f"/v1/agents/[id]{path}"
        self.client.request(method, self.agent + path, json=body, headers=HEADERS, name=name)

    def _made(self, path: str, body: Json) -> Json:
        name = path.replace(self.session, "[id]") if self.session else path
        with self.client.post(
            path, json=body, headers=HEADERS, name=name, catch_response=True
        ) as answer:
            if answer.status_code not in (200, 201):
                answer.failure(f"{answer.status_code}: {answer.text}")
                raise StopUser
            made: Json = answer.json()
            return made
