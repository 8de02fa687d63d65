"""Engines for searches, and problems for them."""

from dataclasses import fields, replace

import numpy as np

from tests.world.fakes import FakeEngine, make_world, people
from wayfarer.engines.engine import StepInputs, StepOutputs
from wayfarer.spec import NEW_FRAMES
from wayfarer.terms import TERMS
from wayfarer.world.agents.goal import Goal
from wayfarer.world.search.problem import MotionPlan, PlanningProblem

TERM = {name: number for number, name in enumerate(TERMS)}


class Walker(FakeEngine):
    """Like the fake engine, but with a choice: each latent has its own direction and price."""

    def step(self, gender: str, inputs: StepInputs) -> StepOutputs:
        shape = inputs.noise.shape[:2]
        tried = [super(Walker, self).step(gender, self._only(inputs, k)) for k in range(shape[1])]
        terms = np.zeros((*shape, len(TERMS)), np.float32)
        for k, outputs in enumerate(tried):
            latent = inputs.noise[:, k]
            outputs.translation[..., :2] += 0.05 * latent[:, None, 1:3]
            outputs.next_seed_markers[..., :2] += 0.05 * latent[:, None, None, 1:3]
            way = inputs.goal[:, :2] - outputs.translation[:, -1, :2]
            terms[:, k, TERM["goal_distance"]] = np.linalg.norm(way, axis=-1)
            terms[:, k, TERM["skating"]] = 0.1 * np.abs(latent[:, 3])
        choice = (terms * inputs.term_weights[:, None]).sum(-1).argmin(-1)
        rows = np.arange(shape[0])
        chosen = {
            f.name: np.stack([getattr(o, f.name) for o in tried], 1)[rows, choice]
            for f in fields(StepOutputs)
        }
        return StepOutputs(**{**chosen, "terms": terms[rows, choice], "choice": choice})

    def _only(self, inputs: StepInputs, k: int) -> StepInputs:
        return replace(inputs, noise=inputs.noise[:, k : k + 1])


class Lanes(FakeEngine):
    """A trap: on the left lane the first step is cheap and all others are dear; the right lane is
    the other way round. The sign of the first latent chooses the lane, once and for all."""

    FIRST, LATER = {-1: 0.1, 1: 0.5}, {-1: 1.0, 1: 0.0}

    def step(self, gender: str, inputs: StepInputs) -> StepOutputs:
        outputs = super().step(gender, inputs)
        start = inputs.seed_translation[:, -1]
        fresh = start[:, 0] == 0
        lane = np.where(fresh, np.sign(inputs.noise[:, 0, 0]), np.sign(start[:, 0])).astype(int)
        price = [
            (self.FIRST if f else self.LATER)[side] for f, side in zip(fresh, lane, strict=True)
        ]
        outputs.terms[:, TERM["skating"]] = price
        outputs.translation[..., 0] = lane[:, None]
        outputs.translation[..., 1] = start[:, None, 1] + np.linspace(0.05, 0.4, NEW_FRAMES)
        return outputs


def problem(count: int, way=(0.0, 3.0), **values) -> PlanningProblem:
    """Agents of both genders, each with a goal `way` from where it stands."""
    specs = people(count, **values)
    paths = [[Goal((s.position[0] + way[0], s.position[1] + way[1], 0.0))] for s in specs]
    return PlanningProblem.of(specs, make_world().prepare(specs), paths)


def standing(count: int) -> PlanningProblem:
    specs = people(count)
    return PlanningProblem.of(specs, make_world().prepare(specs), [()] * count)


def same(a: MotionPlan, b: MotionPlan) -> bool:
    return a.steps == b.steps and all(
        np.array_equal(getattr(a, name), getattr(b, name))
        for name in ("translation", "rotations", "contacts", "modes", "costs", "rejected")
    )
