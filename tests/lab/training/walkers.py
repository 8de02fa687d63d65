"""The environment of policies with untrained networks and few poses: quick, and all of it real."""

import torch

from tests.lab.training.fakes import gliding_frames
from wayfarer.body.library import load_body
from wayfarer.engines.torch.marker_bodies import marker_body
from wayfarer.motion.predictor import MarkerPredictor
from wayfarer.motion.primitive import PrimitiveStep
from wayfarer.motion.quality import Sites
from wayfarer.motion.regressor import BodyRegressor
from wayfarer.spec import GENDERS
from wayfarer_lab.training.environment import GoalEnvironment, Task
from wayfarer_lab.training.pose_networks import PosePrior
from wayfarer_lab.training.starts import StartSampler

STANDING = torch.tensor([0.0, 0, 0, 1]).expand(1, 22, 4)


def starts(frames: int, **shares: float) -> StartSampler:
    torch.manual_seed(5)
    return StartSampler(frames, shares, STANDING, gliding_frames(), PosePrior())


def environment(frames: int = 2, task: Task | None = None, lead: bool = False) -> GoalEnvironment:
    """A 1-frame predictor makes the first primitive if `lead` is given."""
    torch.manual_seed(5)
    steps = untrained_steps(frames)
    kinds = starts(1 if lead else frames, standing=0.4, moving=0.4, pose_prior=0.2)
    first = untrained_steps(1) if lead else ()
    return GoalEnvironment(steps, kinds.prior, kinds, task or Task(), first)


def untrained_steps(frames: int) -> tuple[PrimitiveStep, ...]:
    predictor, steps = MarkerPredictor(frames), []
    for gender in GENDERS:
        model = load_body("anny52", gender)
        body = marker_body(model)
        sites = Sites.from_names(model.marker_names)
        steps.append(PrimitiveStep(predictor, BodyRegressor(body), body, sites).eval())
    return tuple(steps)
