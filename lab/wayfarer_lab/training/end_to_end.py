"""End-to-end training of a marker predictor and both body regressors (paper, Sec. B.1, Eq. 12).

The terms of Eq. 1 look at the markers of the regressed bodies, so gradients flow through skinning
and the regressor's recursions into the predictor. As in Eq. 12 both marker terms weigh the same;
its hand term has nothing to act on. Training starts from networks that were trained apart.
"""

import json
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import torch
from torch import Tensor, nn

from wayfarer.body.library import SHIPPED, load_body
from wayfarer.engines.torch.marker_bodies import marker_body
from wayfarer.errors import InvalidArgument
from wayfarer.motion.regressor import BodyRegressor
from wayfarer.spec import GENDERS
from wayfarer_lab.training.dataset import Frames, by_gender
from wayfarer_lab.training.predictor import PredictorConfig, PredictorTrainer
from wayfarer_lab.training.regressor import load_regressor
from wayfarer_lab.training.representation import Markers, Whose
from wayfarer_lab.training.run import TrainingRun, read_run_config


class EndToEndConfig(PredictorConfig):
    """As a predictor's; `start_from` is the run of a predictor with its encoder."""

    representation: Literal["markers"] = "markers"
    velocity_weight: float = 1.0
    start_regressors: dict[str, str]  # run folders by gender


class Regressed(Markers):
    """Predicted markers that stand for the body that a regressor finds behind them."""

    def __init__(self, regressors: Sequence[BodyRegressor]) -> None:
        self.regressors = regressors  # in the order of `GENDERS`

    def markers(self, features: Tensor, whose: Whose) -> Tensor:
        """As `Markers.markers`: those of the regressed bodies."""
        points = features.unflatten(-1, (-1, 3))

        def of_gender(regressor: BodyRegressor, rows: Tensor) -> tuple[Tensor]:
            body, betas = regressor.body, whose.betas[rows]
            shape = body.shaped(betas)
            pose = regressor.solve(points[rows], betas, shape)
            made = body.blend(shape, body.place(shape, pose.hips, pose.rotations))
            return (made.transpose(-1, -2).flatten(2),)

        return by_gender(whose.gender, self.regressors, of_gender)[0]

    def handed_on(self, features: Tensor, markers: Tensor) -> Tensor:
        """The bodies' markers: predicted ones are only a way to them."""
        return markers


class EndToEndTrainer(PredictorTrainer):
    """Trains a predictor and the regressors of both genders as one network."""

    config: EndToEndConfig
    kind: Regressed

    def representation(self) -> Regressed:
        """Markers of regressed bodies. Raises InvalidArgument without a start for each network."""
        starts = self.config.start_regressors
        if missing := sorted(set(GENDERS) - set(starts)):
            raise InvalidArgument(f"no run of a regressor for {missing}", "start_regressors")
        if self.config.regressors:
            raise InvalidArgument("seeds are those of the networks in training", "regressors")
        if not self.config.start_from:
            raise InvalidArgument("no run of a predictor to start from", "start_from")
        found = []
        for gender in GENDERS:
            model = load_regressor(marker_body(load_body(SHIPPED, gender)), Path(starts[gender]))
            model.through = True
            found.append(model.train())
        return Regressed(found)

    def parameters(self) -> list[nn.Parameter]:
        """Weights of all three networks."""
        return [*super().parameters(), *(p for r in self.kind.regressors for p in r.parameters())]


def train_end_to_end(
    config: EndToEndConfig,
    train: Frames,
    validation: Frames,
    folder: Path,
    minutes: float = float("inf"),
) -> bool:
    """Trains or resumes in `folder`. True when all steps are done.

    The results are separate runs in `folder`: predictor_…_rollout, regressor_male and
    regressor_female, for `wayfarer export --runs` and `wayfarer eval … --runs`.
    """
    trainer = EndToEndTrainer(config, train, validation)
    others = dict(zip((f"regressor_{g}" for g in GENDERS), trainer.kind.regressors, strict=True))
    run = TrainingRun(folder, config, trainer.model, trainer.optimizer, others)
    trainer.run = run
    done = run.drive(config.steps, trainer.update, trainer.validate, minutes)
    own = config.model_dump(mode="json")
    _write_run(run, f"predictor_{config.seed_frames}f_rollout", trainer.model, own)
    for gender, (name, regressor) in zip(GENDERS, others.items(), strict=True):
        started = read_run_config(Path(config.start_regressors[gender]))
        _write_run(run, name, regressor, started | {"end_to_end": own})
    return done


def _write_run(run: TrainingRun, name: str, network: nn.Module, config: dict[str, object]) -> None:
    """One network as a run folder inside that of the training."""
    folder = run.folder / name
    folder.mkdir(exist_ok=True)
    state = {"model": network.state_dict(), "step": run.step, "rng": torch.get_rng_state()}
    torch.save(state | {"optimizer": {}}, folder / "last.pt")
    (folder / "config.json").write_text(json.dumps(config, indent=2) + "\n")
    # the effort is that of all three networks together, and stands only with the predictor's
    for file in ("log.txt", "effort.json") if network is run.model else ("log.txt",):
        if (run.folder / file).exists():
            shutil.copy(run.folder / file, folder / file)
