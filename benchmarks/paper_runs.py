"""Trains the models behind rows of benchmarks/results/paper.md, and measures them.

    python -m benchmarks.paper_runs GROUP... --data PREPARED [--test PREPARED]
        [--runs runs/paper] [--steps 5000] [--rollout-steps 1000] [--batch 256] [--minutes 50]
        [--seed 0] [--train | --measure] [--poses 100] [--results FOLDER]

predictors        the four predictors of Table S1, trained alike; also their rows of Fig. 3
short             the same, 1,000 (rollouts: 200) steps × 256: the cheapest spread of seeds
direct            Sec. A.4: predictors of body parameters, and one of markers, trained alike
end_to_end        Eq. 12, from the 2-frame predictor of `predictors` and the shipped regressors
regressors        Table S2: the paper's regressor, of male bodies
regressors_apart  the same, but each pass of the recursion learns alone
kl_0.05 kl_0.2 kl_1
                  docs/models.md: the 2-frame predictor of `short` by the weight of its KL term,
                  on people of the validation

One process loads the data once and trains unfinished runs on one thread; the same command resumes.
Steps and batch are those of `--config paper/NAME` unless given or named above. Then `wayfarer eval`
writes the tables of finished runs into benchmarks/results. --train and --measure do only one of
these. The page is measured on data whose held-out people are only CMU's, and into a folder outside
of the checkout, since a second table would find the commit changed by the first. Runs lie in
RUNS/GROUP/NAME. With a seed other than 0, runs and tables have different names (GROUP_seed_1), and
the page shows the spread of all seeds.
"""

import argparse
import dataclasses
import shlex
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import torch
from pydantic import BaseModel

from wayfarer.body.library import load_body
from wayfarer.models.bundle import DEFAULT_MODEL
from wayfarer.spec import GENDERS
from wayfarer_lab.evaluation.model_parts import DIRECT, TRAINED
from wayfarer_lab.training.cli import read_config
from wayfarer_lab.training.dataset import Frames, load_frames, load_poses
from wayfarer_lab.training.end_to_end import EndToEndConfig, train_end_to_end
from wayfarer_lab.training.predictor import PredictorConfig, train_predictor
from wayfarer_lab.training.regressor import RegressorConfig, train_regressor
from wayfarer_lab.training.run import read_effort, read_run_config
from wayfarer_lab.training.unpack import unpack_models

RESULTS: Final = Path(__file__).parent / "results"


class Group(NamedTuple):
    """Runs in the order in which they start from each other, and the table they go into."""

    runs: tuple[str, ...]
    tables: Mapping[str, str]  # `wayfarer eval NAME` → file
    values: Mapping[str, Any] = {}  # replacements of config values; the command line wins
    split: str = "heldout"  # the people for measuring


SHORT: Final = {"steps": 1000, "rollout_steps": 200, "batch": 256}
REGRESSORS: Final = ("regressor_male",)  # one gender is enough for the comparison
PREDICTORS: Final = ("predictor_2f", "predictor_2f_rollout", "predictor_1f", "predictor_1f_rollout")

GROUPS: Final[dict[str, Group]] = {
    "predictors": Group(PREDICTORS, {"predictor": "predictor_paper", "realism": "realism_paper"}),
    "short": Group(PREDICTORS, {"predictor": "predictor_short", "realism": "realism_short"}, SHORT),
    "direct": Group(
        (
            *("predictor_2f", "direct_body", "direct_humor"),
            *("predictor_2f_rollout", "direct_body_rollout", "direct_humor_rollout"),
        ),
        {"realism": "realism_direct", "failures": "failures"},
    ),
    "end_to_end": Group(("end_to_end",), {"realism": "realism_e2e"}),
    "regressors": Group(REGRESSORS, {"regressor": "regressor_paper"}),
    "regressors_apart": Group(REGRESSORS, {"regressor": "regressor_apart"}, {"through": False}),
    **{
        f"kl_{weight:g}": Group(
            ("predictor_2f",),
            {"predictor": f"predictor_kl_{weight:g}"},
            {**SHORT, "kl_weight": weight},
            "validation",
        )
        for weight in (0.05, 0.2, 1.0)
    },
}

VARIANTS: Final = {
    "2f": ("2f", "reproj-2f"),
    "1f": ("1f", "reproj-1f"),
    "ro-2f": ("ro-2f",),
    "ro-1f": ("ro-1f",),
}
"""Predictor → rows of Fig. 3."""

Split = dict[str, Frames]


class Data:
    """Both splits of a prepared folder, loaded once; only the shares of draws differ."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._known: Split = {}

    def drawn(self, mix: Mapping[str, float]) -> tuple[Frames, Frames]:
        """The frames of training and of validation."""
        found = []
        for split in ("train", "validation"):
            if split in self._known:
                weight = load_poses(self.folder, split, mix).weight
                self._known[split] = dataclasses.replace(self._known[split], weight=weight)
            else:
                self._known[split] = load_frames(self.folder, split, mix)
            found.append(self._known[split])
        return found[0], found[1]


def seeded(name: str, seed: int) -> str:
    """The name of a group or a table with its seed."""
    return f"{name}_seed_{seed}" if seed else name


def settings(name: str, runs: Path, group: str, asked: argparse.Namespace) -> Any:
    """A run's settings: its config, with the runs of this folder to start from."""
    kind: type[BaseModel] = PredictorConfig
    if name in ("end_to_end", *REGRESSORS):
        kind = EndToEndConfig if name == "end_to_end" else RegressorConfig
    config = read_config(kind, f"paper/{name}")
    given = {key: value for key in SHORT if (value := getattr(asked, key)) is not None}
    change = {**GROUPS[group].values, **given, "seed": asked.seed}
    rollout_steps = change.pop("rollout_steps", None)
    if name.endswith("_rollout"):
        change.pop("steps", None)
        change |= {"steps": rollout_steps} if rollout_steps is not None else {}
    if isinstance(config, EndToEndConfig):
        predictors = runs / seeded("predictors", asked.seed)
        change["start_from"] = str(predictors / "predictor_2f_rollout")
        change["start_regressors"] = {g: str(runs / "shipped" / f"regressor_{g}") for g in GENDERS}
    elif isinstance(config, PredictorConfig) and config.start_from:
        started = runs / seeded(group, asked.seed)
        change["start_from"] = str(started / Path(config.start_from).name)
    return kind.model_validate(config.model_dump() | change)


def train(config: Any, data: Data, folder: Path, minutes: float) -> bool:
    """Trains or resumes one run. True when it is finished."""
    frames = data.drawn(config.mix)
    if isinstance(config, EndToEndConfig):
        return train_end_to_end(config, *frames, folder, minutes)
    if isinstance(config, PredictorConfig):
        return train_predictor(config, *frames, folder, minutes)
    body = load_body("anny52", config.gender)
    return train_regressor(config, *frames, body, folder, minutes)


def is_finished(folder: Path) -> bool:
    """Whether all steps of a run are done."""
    effort = read_effort(folder)
    return effort is not None and effort.steps >= read_run_config(folder)["steps"]


def rows(group: str, finished: Sequence[str]) -> list[str]:
    """Names of the rows of `wayfarer eval realism` that finished runs stand for."""
    if group == "end_to_end":
        return ["ro-2f"] if finished else []
    plain = {"direct": {**TRAINED, **DIRECT}}.get(group, TRAINED)
    names = [name for name, run in plain.items() if run in finished]
    if group in ("direct", "short"):
        return names
    return [row for name in names for row in VARIANTS[name]]


def measure(
    group: str, runs: Path, data: Path, poses: int, results: Path = RESULTS, seed: int = 0
) -> None:
    """Writes the tables of a group's finished runs into a folder. `seed`: that of the training."""
    trained = folder = runs / seeded(group, seed)
    if group == "end_to_end":  # its networks are runs inside it
        folder = folder / "end_to_end"
    finished = [name for name in GROUPS[group].runs if is_finished(trained / name)]
    for table, stem in GROUPS[group].tables.items():
        file = seeded(stem, seed)
        wanted = ["--runs", str(folder), "--data", str(data), "--split", GROUPS[group].split]
        wanted += ["--seed", "7", "--threads", "1"]
        if table == "realism":
            wanted += ["--only", ",".join(rows(group, finished)), "--poses", str(poses)]
        if table == "predictor":
            wanted += ["--only", ",".join(n for n in TRAINED if TRAINED[n] in finished)]
        if table == "failures":
            wanted += ["--poses", str(poses)]
        wanted += ["--json", str(results / f"{file}.json")]
        if not finished:
            print(f"{group}: nothing is finished, so there is no {table}")
            continue
        command = ["wayfarer", "eval", table, *wanted]
        print(shlex.join(command), flush=True)
        subprocess.run(command, check=True)
        for leftover in (".md", ".png"):  # the page is made of the JSON alone
            (results / f"{file}{leftover}").unlink(missing_ok=True)


def main(words: Sequence[str] | None = None) -> int:
    """Trains and measures; 1 when the time was up before all was trained."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("groups", nargs="+", choices=GROUPS)
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("--test", type=Path, help="prepared data to measure on; --data")
    parser.add_argument("--runs", type=Path, default=Path("runs/paper"))
    parser.add_argument("--results", type=Path, default=RESULTS)
    for name in ("--steps", "--rollout-steps", "--batch"):
        parser.add_argument(name, type=int)
    parser.add_argument("--seed", type=int, default=0, help="of the trainings")
    parser.add_argument("--minutes", type=float, default=float("inf"))
    parser.add_argument("--poses", type=int, default=100)
    parser.add_argument("--measure", action="store_true")
    parser.add_argument("--train", action="store_true")
    asked = parser.parse_args(words)
    until, data, done = time.monotonic() + 60 * asked.minutes, Data(asked.data), True
    torch.set_num_threads(1)
    if "end_to_end" in asked.groups:
        unpack_models(DEFAULT_MODEL, asked.runs / "shipped")
    for group in () if asked.measure else asked.groups:
        for name in GROUPS[group].runs:
            folder = asked.runs / seeded(group, asked.seed) / name
            config = settings(name, asked.runs, group, asked)
            if (folder / "config.json").exists() and is_finished(folder):
                print(f"{folder}: finished", flush=True)
                continue
            minutes = (until - time.monotonic()) / 60
            done = train(config, data, folder, minutes) and done
    for group in () if asked.train else asked.groups:
        data_of = asked.data if GROUPS[group].split == "validation" else asked.test or asked.data
        measure(group, asked.runs, data_of, asked.poses, asked.results, asked.seed)
    return 0 if done else 1


if __name__ == "__main__":
    sys.exit(main())
