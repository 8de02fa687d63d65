"""A list of stages: order, resuming, stopping, and messages."""

import json
import re
import signal
import sys
import threading
import time
from pathlib import Path

import pytest
from filelock import FileLock
from pydantic import BaseModel

from wayfarer.errors import InvalidArgument
from wayfarer_lab.training.cli import CONFIGS, _training_of, _with_values, read_config
from wayfarer_lab.training.stages import StageList, Stages

PROGRAM = """
import sys, time
from pathlib import Path

kind, out, *rest = sys.argv[1:]
with open("calls.txt", "a") as calls:
    calls.write(" ".join(sys.argv[1:]) + chr(10))
if kind == "touch":
    Path(out).write_text("x")
elif kind == "fail":
    sys.exit(3)
elif kind == "wait":
    try:
        time.sleep(60)
    except KeyboardInterrupt:
        Path(out).write_text("stopped")
        sys.exit(130)
elif kind == "train" and rest[1] == "0":  # at once: the files alone that a training leaves
    Path(out).mkdir(parents=True)
    steps = '"steps": ' + rest[0]
    Path(out, "config.json").write_text("{" + steps + "}")
    Path(out, "effort.json").write_text("{" + steps + ', "of": ' + rest[0] + ', "cpu_minutes": 0}')
elif kind == "train":
    import torch
    from pydantic import BaseModel
    from wayfarer_lab.training.run import TrainingRun

    class Config(BaseModel):
        steps: int

    steps, pause = int(rest[0]), float(rest[1])
    model = torch.nn.Linear(1, 1)
    run = TrainingRun(Path(out), Config(steps=steps), model, torch.optim.SGD(model.parameters()))
    def update():
        time.sleep(pause)
        return {}
    try:
        run.drive(steps, update, dict, every=5)
    except KeyboardInterrupt:
        sys.exit(130)
"""


class Config(BaseModel):
    """Like the program's config."""

    steps: int


def parse(arguments: tuple[str, ...]) -> tuple[Path, BaseModel] | None:
    if arguments[0] != "train":
        return None
    return Path(arguments[1]), Config(steps=int(arguments[2]))


@pytest.fixture
def make(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "program.py").write_text(PROGRAM)

    def stages(*rows: dict[str, object], **values: object) -> Stages:
        wanted = StageList.model_validate({"folder": "pass", "values": values, "stages": rows})
        return Stages(wanted, parse, (sys.executable, "program.py"))

    return stages


def calls() -> list[str]:
    path = Path("calls.txt")
    return path.read_text().split("\n")[:-1] if path.exists() else []


TOUCH = {"name": "data", "command": "touch $where", "done": "$where", "minutes": 10}
TRAIN = {"name": "net", "command": "train $folder/net 20 0", "minutes": 30}
LAST = {"name": "export", "command": "touch model", "done": "model"}


def test_stages_run_in_order_once(make) -> None:
    said: list[str] = []
    stages = make(TOUCH, TRAIN, LAST, where="data.npz")
    assert stages.lines()[-1] == "about 40 min left in all, not counting 1 without an estimate"
    assert stages.run(float("inf"), said.append)
    assert calls() == ["touch data.npz", "train pass/net 20 0", "touch model"]
    assert [line.split(":")[0] for line in said] == [f"stage {k} of 3" for k in (1, 2, 3)]
    assert make(TOUCH, TRAIN, LAST, where="data.npz").run(float("inf"), said.append)
    assert len(calls()) == 3, "all were finished"
    lines = make(TOUCH, TRAIN, LAST, where="data.npz").lines()
    assert [": done" in line for line in lines] == [True, True, True, False]
    assert lines[-1] == "all stages are done"
    Path("model").unlink()
    assert make(TOUCH, TRAIN, LAST, where="data.npz").run(float("inf"), said.append)
    assert calls()[3:] == ["touch model"]


def test_stages_can_be_added_and_removed(make) -> None:
    assert make(TOUCH, where="a").run(float("inf"), print)
    assert make(LAST, TRAIN).run(float("inf"), print)
    assert calls() == ["touch a", "touch model", "train pass/net 20 0"]


def test_a_signal_stops_after_a_checkpoint_and_the_same_list_resumes(make) -> None:
    slow = {"name": "net", "command": "train pass/net 60 .05"}
    effort = Path("pass/net/effort.json")

    def interrupt() -> None:
        while not effort.exists():
            time.sleep(0.05)
        # as Ctrl-C would; a real signal that comes a moment too late ends pytest's worker
        signal.getsignal(signal.SIGINT)(signal.SIGINT, None)

    threading.Thread(target=interrupt).start()
    stages = make(slow, LAST)
    with pytest.raises(KeyboardInterrupt):
        stages.run(float("inf"), print)
    steps = json.loads(effort.read_text())["steps"]
    assert 5 <= steps < 60
    assert not Path("model").exists()
    (line, *_) = stages.lines()
    assert re.match(rf" 1 net: {steps} of 60 steps, about \d+ min left here$", line)
    assert make(slow, LAST).run(float("inf"), print)
    assert json.loads(effort.read_text())["steps"] == 60
    assert Path("model").exists()


def test_time_that_is_up_stops_cleanly(make) -> None:
    slow = {"name": "slow", "command": "wait stopped", "done": "never"}
    assert make(slow, LAST).run(0.1, print) is False
    assert Path("stopped").read_text() == "stopped"
    assert not Path("model").exists()
    assert make(TOUCH, where="b").run(0.0, print) is False
    assert not Path("b").exists()


def test_a_stage_that_fails_ends_the_list(make) -> None:
    bad = {"name": "bad", "command": "fail now", "done": "never"}
    with pytest.raises(InvalidArgument, match="bad: `wayfarer fail now` failed with exit code 3"):
        make(bad, LAST).run(float("inf"), print)
    lazy = {"name": "lazy", "command": "touch other", "done": "never"}
    with pytest.raises(InvalidArgument, match="lazy: its command ended, but never is not finished"):
        make(lazy, LAST).run(float("inf"), print)
    assert not Path("model").exists()


def test_what_was_finished_otherwise_is_not_taken_for_done(make) -> None:
    assert make(TOUCH, TRAIN, where="data.npz").run(float("inf"), print)
    more = TRAIN | {"command": "train pass/net 40 0"}
    with pytest.raises(InvalidArgument, match=r"net: pass/net was made with other values of \['st"):
        make(TOUCH, more, where="data.npz").lines()
    other = TOUCH | {"command": "touch $where now"}
    with pytest.raises(InvalidArgument, match=r"data: data\.npz was made by another command"):
        make(other, where="data.npz").run(float("inf"), print)


def test_time_left_follows_what_stages_took(make) -> None:
    stages = make(TOUCH, TRAIN, LAST, where="data.npz")
    Path("pass").mkdir()
    Path("data.npz").touch()
    took = {"minutes": 20, "command": "touch data.npz"}
    Path("pass/stages.json").write_text(json.dumps({"data": took}))
    lines = stages.lines()
    assert lines[0] == " 1 data: done, 20 min"
    assert lines[1] == " 2 net: about 60 min"
    assert lines[-1] == "about 60 min left in all, not counting 1 without an estimate"


def test_two_do_not_run_the_same_list(make) -> None:
    stages = make(LAST)
    Path("pass").mkdir()
    with FileLock("pass/stages.lock"), pytest.raises(InvalidArgument, match="another `wayfarer"):
        stages.run(float("inf"), print)


@pytest.mark.parametrize(
    ("stage", "reason"),
    [
        ({"name": "a", "command": "touch x"}, "a: `done` has to name"),
        ({"name": "a", "command": "touch $x", "done": "x"}, "values are where, folder"),
        ({"name": "a", "command": "touch 'x", "done": "x"}, "a: No closing quotation"),
        ({"name": "data", "command": "touch x", "done": "x"}, "different names"),
    ],
)
def test_a_faulty_list_is_refused_before_anything_runs(stage, reason, make) -> None:
    with pytest.raises(InvalidArgument, match=reason.replace("$", r"\$")):
        make(TOUCH, stage, where="a")
    assert calls() == []


def test_the_shipped_list_is_made_of_commands_that_exist(tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    wanted = _with_values(read_config(StageList, "next"), ["folder=runs/two", "threads=2"])
    stages = Stages(wanted, _training_of)
    trained = {step.name: step.training for step in stages.steps if step.training}
    assert trained["predictor 2f, rollouts"][0] == Path("runs/two/predictor_2f_rollout")
    settings = trained["predictor 2f, rollouts"][1].model_dump()
    assert settings["start_from"] == "runs/two/predictor_2f"
    assert settings["regressors"]["male"] == "runs/two/regressor_male"
    # a stage begins from the results of an earlier one
    written: set[str] = set()
    for step in stages.steps:
        for name, training in ((step.name, step.training),):
            text = json.dumps(training[1].model_dump(mode="json")) if training else ""
            for part in text.split('"'):
                if part.startswith("runs/"):
                    assert part in written, f"{name} begins from {part}"
            written.add(str(training[0] if training else step.done.parent))
    assert (CONFIGS / "next.toml").exists()


def test_values_and_trainings_that_are_unknown_are_refused() -> None:
    wanted = read_config(StageList, "next")
    with pytest.raises(InvalidArgument, match=r"no value \['dta'\]; the list has \['data'"):
        _with_values(wanted, ["dta=x"])
    for command, reason in (
        ("train predictor --config nothing --data d --out o", "no config"),
        ("train predictor --data d", "Missing .*out"),
        ("train predictor --data d --out o --stepps 4", "No such option"),
    ):
        with pytest.raises(InvalidArgument, match=f"p: .*{reason}"):
            Stages(
                StageList.model_validate(
                    {"folder": "f", "stages": [{"name": "p", "command": command}]}
                ),
                _training_of,
            )
