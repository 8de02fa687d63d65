"""The `wayfarer` command: its output, its imports, its failures."""

import sys
import textwrap
import tomllib
from pathlib import Path

import pytest

from tests.programs import run_program
from wayfarer import __version__
from wayfarer.commands import cli
from wayfarer.errors import DataError, WayfarerError

COMMANDS = (
    "serve",
    "probe",
    "keys",
    "config",
    "generate",
    "render",
    "eval",
    "export",
    "data",
    "body",
    "train",
)
LEAVES = (
    ["serve"],
    ["probe"],
    ["keys", "new"],
    ["config", "schema"],
    ["config", "table"],
    ["generate"],
    ["render"],
    ["eval"],
    ["eval", "realism"],
    ["eval", "control"],
    ["export"],
    ["data", "prepare"],
    ["import", "gamma"],
    ["body", "bake"],
    ["train", "predictor"],
    ["train", "regressor"],
)


def run(monkeypatch: pytest.MonkeyPatch, *arguments: str) -> int:
    """Exit code of `wayfarer arguments…`, in this process."""
    monkeypatch.setattr(sys, "argv", ["wayfarer", *arguments])
    with pytest.raises(SystemExit) as stop:
        cli.main()
    return int(stop.value.code or 0)


def test_help_lists_every_command(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(monkeypatch, "--help") == 0
    listed = capsys.readouterr().out
    assert all(f" {command} " in listed for command in COMMANDS)


@pytest.mark.parametrize("leaf", LEAVES, ids=" ".join)
def test_every_command_exists_and_explains_itself(
    leaf: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(monkeypatch, *leaf, "--help") == 0
    assert "Usage: wayfarer " + " ".join(leaf) in capsys.readouterr().out


def test_version(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(monkeypatch, "--version") == 0
    assert capsys.readouterr().out == f"wayfarer {__version__}\n"


def test_help_keeps_what_stands_in_brackets(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(monkeypatch, "serve", "--help") == 0
    told = " ".join(capsys.readouterr().out.split())
    for words in ("wayfarer[openvino]", "wayfarer[gpu]", "[gamma-anny52]", "[127.0.0.1]", "[auto]"):
        assert words in told


def test_a_wrong_option_is_a_usage_error(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(monkeypatch, "render", "--no-such-option") == 2
    assert "--no-such-option" in capsys.readouterr().err


def stand_in(monkeypatch: pytest.MonkeyPatch, error: BaseException) -> None:
    """Let `wayfarer render` fail with `error`."""

    def fail() -> None:
        raise error

    monkeypatch.setattr("wayfarer_lab.evaluation.render.render", fail)


@pytest.mark.parametrize(
    "error", [WayfarerError("no such body"), DataError("bad number", "walk.bvh", 12)]
)
def test_our_errors_are_one_line(
    error: WayfarerError, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    stand_in(monkeypatch, error)
    assert run(monkeypatch, "render") == 2
    assert capsys.readouterr().err == f"wayfarer: {error}\n"


def test_a_missing_extra_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    stand_in(monkeypatch, ModuleNotFoundError("No module named 'torch'", name="torch.nn"))
    assert run(monkeypatch, "render") == 2
    assert "pip install './lab[train]'" in capsys.readouterr().err


def test_without_the_lab_its_commands_say_what_to_install(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    stand_in(monkeypatch, ModuleNotFoundError("No module named 'wayfarer_lab'", name=cli.LAB))
    assert run(monkeypatch, "render") == 2
    assert "pip install ./lab" in capsys.readouterr().err


class WithoutLab:
    """Finds modules as where the lab is not installed."""

    def find_spec(self, name: str, *_: object) -> None:
        if name.partition(".")[0] == cli.LAB:
            raise ModuleNotFoundError(f"No module named {cli.LAB!r}", name=cli.LAB)


@pytest.mark.parametrize("leaf", LEAVES, ids=" ".join)
def test_help_needs_no_extra_and_names_it(
    leaf: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in [name for name in sys.modules if name.split(".")[0] == cli.LAB]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setattr(sys, "meta_path", [WithoutLab(), *sys.meta_path])
    assert run(monkeypatch, *leaf, "--help") == 0
    said = capsys.readouterr()
    needed = leaf[0] in ("render", "eval", "export", "data", "import", "body", "train")
    assert (
        "It needs wayfarer_lab; in the repository's root: pip install ./lab" in said.out
    ) is needed
    assert "Traceback" not in said.err and (needed or "Usage" in said.out)


@pytest.mark.parametrize("module", ["wayfarer.x", "wayfarer_lab.x"])
def test_a_module_of_ours_that_is_missing_is_a_bug_and_shown_as_one(
    module: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    stand_in(monkeypatch, ModuleNotFoundError(f"No module named '{module}'", name=module))
    monkeypatch.setattr(sys, "argv", ["wayfarer", "render"])
    with pytest.raises(ModuleNotFoundError):
        cli.main()


def test_ctrl_c_ends_without_a_traceback(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    stand_in(monkeypatch, KeyboardInterrupt())
    assert run(monkeypatch, "render") == 130
    assert "Traceback" not in capsys.readouterr().err


@pytest.mark.parametrize("command", sorted(set(cli.INSTALL.values())))
def test_what_a_message_tells_to_install_exists(command: str) -> None:
    """Such as "./lab" or "'./lab[train]'": a folder of the repository, and an extra of it."""
    folder, _, extra = command.strip("'").partition("[")
    root = Path(__file__).parents[2]
    project = tomllib.loads((root / folder / "pyproject.toml").read_text())["project"]
    assert not extra or extra.rstrip("]") in project["optional-dependencies"]


def test_ctrl_c_while_it_loads_is_as_quiet() -> None:
    code = """
        import sys

        class Interrupted:
            def find_spec(self, name, path=None, target=None):
                if name == "typer":
                    raise KeyboardInterrupt

        sys.meta_path.insert(0, Interrupted())
        from wayfarer.__main__ import main
        main()
        """
    answer = run_program(sys.executable, "-c", textwrap.dedent(code), code=130)
    assert answer.stderr == ""


def test_help_and_serving_load_nothing_heavy() -> None:
    """scipy's parts take 40 MB and half a second: scenes, files and fits load what they need.

    numba loads the bare package, which is small.
    """
    code = """
        import re, sys, wayfarer.commands.cli, wayfarer.commands.serve, wayfarer.assembly
        heavy = {"torch", "matplotlib", "anny", "onnx", "pxr", "PIL"} & set(sys.modules)
        heavy |= {part for part in sys.modules if re.match(r"scipy\\.[a-z]+\\.", part)}
        sys.exit(f"loaded {heavy}" if heavy else 0)
        """
    run_program(sys.executable, "-c", textwrap.dedent(code))
