"""Chunks, publications and subscriptions by hand, and a meter that keeps its values."""

from collections import Counter

from tests.world.fakes import ManualClock, motion_chunk
from wayfarer.config.limits import Limits
from wayfarer.runtime.streams.publications import Publication, StreamOptions
from wayfarer.runtime.streams.subscription import QueuedPublication, Subscription, SubscriptionStart
from wayfarer.world.agents.agent import (
    AgentInfo,
    AgentSpec,
    AgentState,
    MotionChunks,
)
from wayfarer.world.agents.goal import Goal

STEP = 0.2


class KeepingMeter:
    """Implements `MetricsSink`."""

    def __init__(self):
        self.steps, self.lateness, self.queues, self.goals = [], [], [], []
        self.dropped, self.resumes, self.refusals = Counter(), Counter(), Counter()

    def step(self, seconds, agents):
        self.steps.append((seconds, agents))

    def chunks(self, lateness, sights):
        assert len(lateness) == len(sights)
        self.lateness += lateness.tolist()

    def queue(self, seconds):
        self.queues.append(seconds)

    def drops(self, policy, publications):
        self.dropped[policy] += publications

    def resume(self, result):
        self.resumes[result] += 1

    def goal_to_motion(self, seconds):
        self.goals.append(seconds)

    def refusal(self, command):
        self.refusals[command] += 1


def chunk(seq, agent="a", at=None, **values):
    when = STEP * seq if at is None else at
    given = {"state": AgentState.STANDING, "scheduled_at": when, **values}
    return motion_chunk(seq, agent_id=agent, alias=ord(agent), **given)


def together(*chunks):
    return MotionChunks.of(chunks)


def entry(seq, *agents, events=()):
    """Publication number seq + 1: chunk `seq` of each agent ("a" when none is named)."""
    chunks = together(*(chunk(seq, agent) for agent in agents or ("a",)))
    return QueuedPublication(Publication(seq + 1, chunks, tuple(events)), STEP * seq)


def subscription(
    *agent_ids, meter=None, clock=None, start=None, queue_s=0.5, lead_s=0.5, **options
):
    made = Subscription(
        "s",
        StreamOptions(agent_ids, **options),
        Limits(queue_s=queue_s, lead_s=lead_s),
        meter or KeepingMeter(),
        clock or ManualClock(0.0),
    )
    made.begin(start or SubscriptionStart("epoch", 0, 0.0))
    return made


def info(agent_id="a", path=(Goal((1.0, 0.0, 0.0)),), revision=1, waypoint=0):
    return AgentInfo(
        agent_id=agent_id,
        alias=1,
        session_id="s",
        spec=AgentSpec(),
        state=AgentState.WALKING,
        position=(0.0, 0.0, 0.9),
        heading=0.0,
        goal=path[waypoint] if path else None,
        goal_revision=revision,
        created_at=0.0,
        waypoint=waypoint,
        waypoints=len(path),
    )
