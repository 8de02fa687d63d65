import pytest

from wayfarer import config_sources
from wayfarer.config import Settings
from wayfarer.errors import InvalidArgument
from wayfarer.workers.assignments import assignments, check_state, shares_of
from wayfarer.workers.messages import Assignment


@pytest.mark.parametrize(
    ("cores", "workers", "shares"),
    [
        (4, 2, [(0, 1), (2, 3)]),
        (5, 2, [(0, 1), (2, 3, 4)]),
        (16, 3, [(0, 1, 2, 3, 4), (5, 6, 7, 8, 9), (10, 11, 12, 13, 14, 15)]),
        (2, 3, [(0,), (1,), (0,)]),
    ],
)
def test_cores_are_shared_out(cores, workers, shares):
    assert shares_of(list(range(cores)), workers) == shares


def test_workers_have_the_servers_settings_but_for_what_is_their_own(tmp_path):
    settings = Settings(
        workers=3, grpc_port=6000, http_port=7000, state_dir=tmp_path / "state", candidates=7
    )
    plan = assignments(settings, tmp_path)
    assert [a.settings.grpc_port for a in plan] == [6001, 6002, 6003]
    assert [a.settings.http_port for a in plan] == [7001, 7002, 7003]
    assert [a.settings.state_dir.name for a in plan] == ["worker-0", "worker-1", "worker-2"]
    assert all(a.settings.threads >= 1 and a.settings.candidates == 7 for a in plan)
    assert all(a.cores == () for a in plan), "free to run anywhere unless pinned"
    assert [e.grpc_port for e in plan[2].shares.endpoints] == [6001, 6002, 6003]
    assert {a.folder.stat().st_mode & 0o777 for a in plan} == {0o700}


def test_an_assignment_is_read_as_it_was_written(tmp_path, monkeypatch):
    settings = Settings(workers=2, grpc_port=0, http_port=0, pin_workers=True, threads=3)
    written = assignments(settings, tmp_path)[1]
    monkeypatch.setenv("WAYFARER_CANDIDATES", "9")  # it has been read by the supervisor
    monkeypatch.setenv("WAYFARER_AUTH__KEYS_FILE", "other.toml")
    assert Assignment.model_validate_json(written.model_dump_json()) == written
    assert written.settings.threads == 3 and written.cores


def test_a_state_folder_belongs_to_a_number_of_workers(tmp_path):
    def settings(workers: int) -> Settings:
        return Settings(workers=workers, state_dir=tmp_path)

    check_state(settings(1))
    check_state(settings(2))
    (tmp_path / "worker-0").mkdir()
    (tmp_path / "worker-1").mkdir()
    check_state(settings(2))
    for workers in (1, 3):
        with pytest.raises(InvalidArgument, match="holds the sessions of --workers 2"):
            check_state(settings(workers))


def test_one_process_and_several_do_not_share_a_state_folder(tmp_path):
    (tmp_path / "journal.sqlite3").touch()
    check_state(Settings(workers=1, state_dir=tmp_path))
    with pytest.raises(InvalidArgument, match="holds the sessions of --workers 1"):
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
        config_sources.load({"workers": 2, **ports})
    assert config_sources.load({**ports}).workers == 1
