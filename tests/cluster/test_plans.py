import pytest

from wayfarer.cluster.plans import check_state, node_plans, shares_of
from wayfarer.config import sources
from wayfarer.config.settings import Settings
from wayfarer.errors import InvalidArgument


@pytest.mark.parametrize(
    ("cores", "nodes", "shares"),
    [
        (4, 2, [(0, 1), (2, 3)]),
        (5, 2, [(0, 1), (2, 3, 4)]),
        (16, 3, [(0, 1, 2, 3, 4), (5, 6, 7, 8, 9), (10, 11, 12, 13, 14, 15)]),
        (2, 3, [(0,), (1,), (0,)]),
    ],
)
def test_cores_are_shared_out(cores, nodes, shares):
    assert shares_of(list(range(cores)), nodes) == shares


def test_nodes_have_the_servers_settings_but_for_what_is_their_own(tmp_path):
    settings = Settings(
        workers=3, grpc_port=6000, http_port=7000, state_dir=tmp_path / "state", candidates=7
    )
    plans = node_plans(settings)
    assert [plan.settings.grpc_port for plan in plans] == [6001, 6002, 6003]
    assert [plan.settings.http_port for plan in plans] == [7001, 7002, 7003]
    folders = [plan.settings.state_dir.name for plan in plans]
    assert folders == ["worker-0", "worker-1", "worker-2"]
    assert all(plan.settings.threads >= 1 and plan.settings.candidates == 7 for plan in plans)
    assert all(plan.cores == () for plan in plans), "free to run anywhere unless pinned"
    free = node_plans(Settings(workers=2, grpc_port=0, http_port=0))
    assert {(plan.settings.grpc_port, plan.settings.http_port) for plan in free} == {(0, 0)}


def test_a_state_folder_is_not_opened_by_fewer_nodes(tmp_path):
    def settings(workers: int) -> Settings:
        return Settings(workers=workers, state_dir=tmp_path)

    check_state(settings(1))
    check_state(settings(2))
    (tmp_path / "worker-0").mkdir()
    (tmp_path / "worker-1").mkdir()
    check_state(settings(2))
    check_state(settings(3))
    with pytest.raises(InvalidArgument, match=r"holds the sessions of --workers 2.*with 2 or more"):
        check_state(settings(1))


def test_one_process_and_several_do_not_share_a_state_folder(tmp_path):
    (tmp_path / "journal.sqlite3").touch()
    check_state(Settings(workers=1, state_dir=tmp_path))
    with pytest.raises(InvalidArgument, match=r"holds the sessions of --workers 1.*with 1 once"):
        check_state(Settings(workers=2, state_dir=tmp_path))


@pytest.mark.parametrize(
    ("ports", "says"),
    [
        ({"grpc_port": 8080, "http_port": 8082}, "2 apart; 2 workers"),
        ({"grpc_port": 65534, "http_port": 8080}, "65533 at most"),
    ],
)
def test_ports_that_leave_no_room_for_the_workers_are_refused(ports, says):
    with pytest.raises(InvalidArgument, match=says):
        sources.load({"workers": 2, **ports})
    assert sources.load({**ports}).workers == 1
