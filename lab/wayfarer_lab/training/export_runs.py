"""Exports run folders as the model folder that serves: `wayfarer export`."""

from dataclasses import asdict
from pathlib import Path

from wayfarer.spec import GENDERS
from wayfarer_lab.training.card import model_card
from wayfarer_lab.training.export import Sources, export_models, write_models
from wayfarer_lab.training.goal_cvae import load_goal_cvae_graphs


def export_runs(
    runs: Path,
    out: Path,
    data: Path | None,
    policy: str,
    predictor_1f: str,
    predictor_2f: str,
    goal_cvae: str,
) -> dict[str, float]:
    """Writes a model folder; returns each graph's torch-ONNX difference.

    Names are those of runs in `runs`; with `goal_cvae` that baseline is written.
    """
    sources = Sources(
        policy=runs / policy,
        predictor_1f=runs / predictor_1f,
        predictor_2f=runs / predictor_2f,
        regressor_male=runs / "regressor_male",
        regressor_female=runs / "regressor_female",
        pose_prior=runs / "pose_prior",
    )
    if goal_cvae:
        regressors = {gender: runs / f"regressor_{gender}" for gender in GENDERS}
        trained = {"goal_cvae": runs / goal_cvae} | regressors
        graphs = load_goal_cvae_graphs(runs / goal_cvae, regressors)
        return write_models(graphs, out, model_card(out.name, trained, data), out.name)
    card = model_card(out.name, asdict(sources), data)
    return export_models(sources, out, card, out.name)
