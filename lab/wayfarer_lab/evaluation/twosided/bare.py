"""The model alone: primitives driven by wished ways and facings, without the world that serves.

No foot lock, no planting, no rule after the model. The caller gives a function that steps all
people of a gender once; it may search, sample a policy, or look up recordings.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Final, Protocol

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from wayfarer.body.library import load_body
from wayfarer.clips.clip import Clip
from wayfarer.models.bundle import START_POSES, load_bodies
from wayfarer.spec import FPS, NEW_FRAMES
from wayfarer.world.agents.agent import AgentSpec
from wayfarer.world.agents.heading import facing_of
from wayfarer.world.agents.spawn import Spawner, load_start_poses
from wayfarer_lab.evaluation.takes import Take
from wayfarer_lab.evaluation.tasks import random_specs
from wayfarer_lab.evaluation.twosided.verdicts import Person
from wayfarer_lab.evaluation.twosided.wishes import AHEAD, ORDERS, SECONDS, Order, Wish

Array = NDArray[np.floating[Any]]

BODY: Final = "anny52"
MARGIN: Final = AHEAD[-1] + NEW_FRAMES
"""Frames of wishes after the last step."""


class BareStep(Protocol):
    """Steps A people of one gender by a primitive. The canonical frame is that of the seed's first
    frame: origin on the floor under the hips, +X from left to right hip, +Y ahead.
    """

    def __call__(
        self,
        seed_markers: Tensor,  # [A, 2, 67, 3] world, metres
        seed_translation: Tensor,  # [A, 2, 3]
        seed_rotations: Tensor,  # [A, 2, 22, 4] x, y, z, w
        betas: Tensor,  # [A, 10]
        ways: Tensor,  # [A, 3, 2] from the hips of the seed's last frame to those .2, .5, 1 s later
        facings: Tensor,  # [A, 3, 2] unit vectors faced then; ways and facings: canonical frame
    ) -> tuple[Tensor, Tensor, Tensor]:
        """New frames: translation [A, 8, 3], rotations [A, 8, 22, 4] (world), and the markers of
        the next seed [A, 2, 67, 3].
        """


@dataclass(frozen=True)
class Track:
    """One person over 12 s, and what it was asked for."""

    order: str  # of `wishes.ORDERS`
    wish: Wish
    take: Take

    def people(self) -> list[Person]:
        """Its figures in each situation that its order is a case of."""
        return [
            Person(situation, self.take.name, values)
            for situation, values in self.wish.measured(self.take).items()
        ]


def roll(
    steps: Mapping[str, BareStep],
    people: int = 8,
    seed: int = 0,
    orders: Mapping[str, Order] = ORDERS,
) -> list[Track]:
    """Tracks of `people` for each of `orders`, of the genders in turn that `steps` has.

    The same seed gives the same people, poses and wishes.
    """
    random = np.random.default_rng(seed)
    names = [name for name in orders for _ in range(people)]
    specs = [
        replace(spec, gender=list(steps)[k % len(steps)])
        for k, spec in enumerate(random_specs(len(names), random))
    ]
    time = np.arange(round(SECONDS * FPS) + MARGIN) / FPS
    wishes = [orders[name](time, random) for name in names]
    found: dict[int, Track] = {}
    for gender, step in steps.items():
        mine = [k for k, spec in enumerate(specs) if spec.gender == gender]
        clips = _clips(step, [specs[k] for k in mine], [wishes[k] for k in mine]) if mine else []
        body = load_body(BODY, gender, "low")
        for k, clip in zip(mine, clips, strict=True):
            take = Take.of(clip, body, f"{names[k]} {k % people}")
            found[k] = Track(names[k], wishes[k], take)
    return [found[k] for k in sorted(found)]


def play(steps: Mapping[str, BareStep], people: int = 8, seed: int = 0) -> list[Person]:
    """Figures of the tracks of `roll`."""
    return [person for track in roll(steps, people, seed) for person in track.people()]


@torch.no_grad()
def _clips(step: BareStep, specs: list[AgentSpec], wishes: list[Wish]) -> list[Clip]:
    """Who begins at rest at heading 0 over the origin, and is stepped for all of `SECONDS`."""
    spawner = Spawner(load_bodies(BODY), load_start_poses(START_POSES))
    starts = [spawner.stand(_at_origin(spec)).seed for spec in specs]
    markers, translation, rotations = (
        torch.from_numpy(np.concatenate([getattr(start, name) for start in starts]))
        for name in ("markers", "translation", "rotations")
    )
    betas = torch.tensor([spec.betas for spec in specs])
    places, turns = [], []
    for number in range(round(SECONDS * FPS / NEW_FRAMES)):
        ways, facings = _wished(wishes, number * NEW_FRAMES, translation, rotations)
        new, turned, markers = step(markers, translation, rotations, betas, ways, facings)
        translation, rotations = new[:, -2:], turned[:, -2:]
        places.append(new)
        turns.append(turned)
    hips, every = torch.cat(places, 1).numpy(), torch.cat(turns, 1).numpy()
    return [_clip(hips[k], every[k], spec) for k, spec in enumerate(specs)]


def _at_origin(spec: AgentSpec) -> AgentSpec:
    return AgentSpec(gender=spec.gender, betas=spec.betas, noise_seed=spec.noise_seed)


def _clip(hips: Array, rotations: Array, spec: AgentSpec) -> Clip:
    """A clip that says nothing of contacts: no figure here reads them."""
    unknown = np.zeros((len(hips), 2), np.bool_)
    return Clip(hips, rotations, unknown, spec.gender, spec.betas)


def _wished(
    wishes: list[Wish], frame: int, translation: Tensor, rotations: Tensor
) -> tuple[Tensor, Tensor]:
    """Ways and facings [A, 3, 2] in the canonical frames of seeds [A, 2, ...]."""
    hips = translation[:, -1, :2].numpy()
    ahead = facing_of(rotations[:, 0, 0].numpy())
    right = np.stack([ahead[:, 1], -ahead[:, 0]], -1)
    axes = np.stack([right, ahead], -1)  # [A, 2, 2], columns: the frame's x and y
    ways = np.stack([wish.ways(frame, hips[k]) for k, wish in enumerate(wishes)]) @ axes
    facings = np.stack([wish.facings(frame) for wish in wishes]) @ axes
    return torch.from_numpy(ways).float(), torch.from_numpy(facings).float()
