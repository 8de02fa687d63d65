"""A crowd that stays on the device: each step begins where the last one ended.

It is for simulations and measurements that do not need every frame. Only requested data is copied
from or to host memory.
"""

import torch
from torch import Generator, Tensor

from wayfarer.engines.engine import StepInputs
from wayfarer.engines.torch.batch import DeviceInputs
from wayfarer.engines.torch.cuda_graph_stream import CudaGraphStream
from wayfarer.engines.torch.engine import Networks
from wayfarer.motion.primitive import StepResult
from wayfarer.spec import SEED_FRAMES


class DeviceCrowd:
    """Agents of one gender, all stepped together. Not safe to use from several threads."""

    def __init__(
        self, networks: Networks, gender: str, start: StepInputs, noise_seed: int = 0
    ) -> None:
        """Begins with the seeds of `start`, and keeps its goals until `given` is changed.

        Only the shape of its noise counts: standard normal noise is drawn on the device in every
        step, the same for the same `noise_seed`, device and sizes.
        """
        rows, candidates = start.noise.shape[:2]
        self.lane = CudaGraphStream(networks.device)
        self._step = networks.steps[gender]
        self._given = DeviceInputs(self.lane, rows, candidates)
        self._random = Generator(networks.device)
        self._given.fill(start)
        with torch.no_grad():
            self._advance = self.lane.record(self._once, self._random)
        self._given.fill(start)  # recording has advanced them
        self.lane.wait()
        self._random.manual_seed(noise_seed)

    @property
    def given(self) -> dict[str, Tensor]:
        """Inputs of the next step by their names in `StepInputs`, to be changed in place.

        That must be done within `lane.use()`.
        """
        return self._given.tensors

    def step(self) -> StepResult:
        """Step all agents. On a GPU the step is still running when this returns: see `lane.wait()`.

        The next step overwrites its tensors.
        """
        with torch.no_grad():
            return self._advance()

    def _once(self) -> StepResult:
        given = self._given.tensors
        given["noise"].normal_(generator=self._random)
        result = self._step(**given)
        given["seed_markers"].copy_(result.next_seed_markers)
        given["seed_translation"].copy_(result.translation[:, -SEED_FRAMES:])
        given["seed_rotations"].copy_(result.rotations[:, -SEED_FRAMES:])
        return result
