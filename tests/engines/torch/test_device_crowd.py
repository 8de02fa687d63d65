"""A crowd on the device takes the same way as single steps of an engine."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from benchmarks.device_crowd import DeviceCrowd

from tests.engines.standing import standing_inputs
from wayfarer.engines.torch.engine import TorchEngine, load_networks
from wayfarer.spec import SEED_FRAMES

GENDER = "male"
ROWS = 3


@pytest.fixture(scope="module")
def start():
    return standing_inputs(GENDER, ROWS, candidates=2)


def test_it_goes_on_from_where_it_was(networks, start):
    crowd, engine = DeviceCrowd(networks, GENDER, start), TorchEngine(networks, batch_sizes=(ROWS,))
    asked = start
    for _ in range(2):
        found = crowd.step()
        asked = replace(asked, noise=crowd.given["noise"].numpy().copy())
        expected = engine.step(GENDER, asked)
        assert np.array_equal(found.translation.numpy(), expected.translation)
        asked = replace(
            asked,
            seed_markers=expected.next_seed_markers,
            seed_translation=expected.translation[:, -SEED_FRAMES:],
            seed_rotations=expected.rotations[:, -SEED_FRAMES:],
        )


def test_noise_is_new_in_every_step_and_the_same_for_the_same_seed(networks, start):
    crowds = [DeviceCrowd(networks, GENDER, start, noise_seed=seed) for seed in (1, 1, 2)]
    drawn = []
    for crowd in crowds:
        crowd.step()
        drawn.append(crowd.given["noise"].clone())
    assert torch.equal(drawn[0], drawn[1])
    assert not torch.equal(drawn[0], drawn[2])
    crowds[0].step()
    assert not torch.equal(crowds[0].given["noise"], drawn[0])


def test_what_is_asked_may_change_between_steps(networks, start):
    here, there = DeviceCrowd(networks, GENDER, start), DeviceCrowd(networks, GENDER, start)
    with there.lane.use():
        there.given["goal"].neg_()
    assert not torch.equal(here.step().translation, there.step().translation)


@pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a GPU")
def test_on_a_gpu_it_begins_at_its_start_and_moves_on(models, start):
    networks = load_networks(models)
    first, again = (DeviceCrowd(networks, GENDER, start) for _ in range(2))
    for crowd in (first, again):
        crowd.step()
        crowd.lane.wait()
    begun = first.given["seed_translation"].clone()
    assert torch.equal(begun, again.given["seed_translation"])
    away = (begun[:, -1].cpu() - torch.from_numpy(start.seed_translation[:, -1])).norm(dim=-1)
    assert (away < 1.0).all()
    first.step()
    first.lane.wait()
    assert not torch.equal(first.given["seed_translation"], begun)
