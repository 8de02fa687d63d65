from wayfarer.service.stats import LoopStats
from wayfarer.transport import convert
from wayfarer.v1 import admin_pb2, session_pb2
from wayfarer.workers.merged import merged_json, merged_messages, merged_stats
from wayfarer.world.agents.agent import AgentState


def listed(*times: int) -> session_pb2.ListSessionsResponse:
    sessions = [session_pb2.Session(session_id=str(t), created_at_us=t) for t in times]
    return session_pb2.ListSessionsResponse(sessions=sessions)


def test_sessions_of_all_are_listed_oldest_first():
    merged = merged_messages([listed(2, 5), listed(), listed(1, 9)])
    assert [session.created_at_us for session in merged.sessions] == [1, 2, 5, 9]
    found = [{"sessions": [{"created_at_us": t} for t in times]} for times in ((2, 5), (), (1,))]
    assert [s["created_at_us"] for s in merged_json(found)["sessions"]] == [1, 2, 5]


def test_counts_are_added_and_the_rest_is_the_first_ones():
    replies = [admin_pb2.UseModelResponse(moved=2), admin_pb2.UseModelResponse(moved=3)]
    assert merged_messages(replies).moved == 5
    assert merged_messages([admin_pb2.DrainResponse()] * 2) == admin_pb2.DrainResponse()
    loaded = {"name": "v2", "in_use": False}
    assert merged_json([loaded, dict(loaded)]) == loaded
    assert merged_json([{"moved": 2}, {"moved": 3}]) == {"moved": 5}


def test_of_figures_the_sum_or_the_worst_is_told():
    def stats(agents: int, lateness: float, level: int, failing: bool) -> LoopStats:
        states = {AgentState.WALKING: agents}
        return LoopStats(
            agents, 1, 1, 10, 2.0, 3.0, 0, lateness, 100.0 + agents,
            states=states, degradation_level=level, load=0.1 * agents, journal_failing=failing,
            capacity=50,
        )  # fmt: skip

    merged = merged_stats(
        [convert.stats(s) for s in (stats(3, 9.0, 2, False), stats(5, 1.0, 1, True))]
    )
    assert (merged.agents, merged.sessions, merged.capacity, merged.steps) == (8, 2, 100, 20)
    assert (merged.lateness_ms_p95, merged.degradation_level, merged.load) == (9.0, 2, 0.5)
    assert merged.uptime_s == 103.0 and merged.journal_failing
    assert merged.states == {"walking": 8}
