"""`wayfarer eval all`: every table in turn, into one folder."""

from collections.abc import Callable
from pathlib import Path

import pytest
from typer.testing import CliRunner

from tests.lab.evaluation.recordings import write_recordings
from wayfarer_lab.evaluation.commands import app, everything

Made = list[tuple[str, dict[str, object]]]


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch) -> Made:
    """Calls of the tables, which only write their names."""
    calls: Made = []

    def stand_in(name: str) -> Callable[..., None]:
        def table(json: Path, **given: object) -> None:
            calls.append((name, given))
            json.write_text(name)

        return table

    monkeypatch.setattr(everything, "TABLES", {name: stand_in(name) for name in everything.TABLES})
    return calls


def run(data: Path, *more: str):
    arguments = ["all", "--data", str(data), "--out", str(data / "out"), *more]
    return CliRunner().invoke(app, arguments)


def test_all_tables_are_made(tmp_path: Path, made: Made) -> None:
    answer = run(write_recordings(tmp_path), "--seed", "5", "--runs", "my-runs")
    assert answer.exit_code == 0, answer.output
    assert [name for name, _ in made] == list(everything.TABLES)
    written = {path.stem for path in (tmp_path / "out").glob("*.json")}
    assert written == {"mocap", *everything.TABLES}
    assert all(given["seed"] == 5 for _, given in made)
    assert [name for name, given in made if given.get("runs") == Path("my-runs")] == list(
        everything.PARTS
    )


def test_quick_ones_are_smaller(tmp_path: Path, made: Made) -> None:
    run(write_recordings(tmp_path), "--quick")
    assert dict(made)["skating"]["poses"] == 100 and dict(made)["scenes"]["minutes"] == 1.0


def test_an_interrupt_leaves_what_is_finished(
    tmp_path: Path, made: Made, monkeypatch: pytest.MonkeyPatch
) -> None:
    def stop(**given: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setitem(everything.TABLES, "bodies", stop)
    answer = run(write_recordings(tmp_path))
    assert answer.exit_code != 0
    assert [name for name, _ in made] == ["realism", "skating"]
    assert (tmp_path / "out" / "skating.json").exists()


def test_the_sizes_of_quick_tables_are_options_of_the_tables() -> None:
    for name, sizes in everything.QUICK.items():
        table = next(c for c in app_commands() if c.__name__ == name)
        assert set(sizes) <= set(table.__annotations__)


def app_commands() -> list[Callable[..., None]]:
    return list(everything.TABLES.values())
