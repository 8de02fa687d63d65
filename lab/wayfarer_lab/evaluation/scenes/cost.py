"""Where a world's CPU time goes, measured while it runs."""

from collections import defaultdict
from collections.abc import Callable
from time import process_time
from typing import Any, cast

from wayfarer.engines.engine import StepInputs, StepOutputs
from wayfarer.engines.warm import WarmEngine
from wayfarer.world.world import World
from wayfarer_lab.evaluation.gait import Row

WORLD, ENGINE, GUIDE, CROWD = "world", "engine", "guide", "crowd"


class Cost:
    """CPU seconds of this process by part; a part may lie within another one."""

    def __init__(self) -> None:
        self.seconds: defaultdict[str, float] = defaultdict(float)
        self.steps = 0

    def timed(self, work: Callable[..., Any], part: str) -> Callable[..., Any]:
        """`work`, with its time counted for a part."""

        def call(*args: Any, **kwargs: Any) -> Any:
            begun = process_time()
            try:
                return work(*args, **kwargs)
            finally:
                self.seconds[part] += process_time() - begun

        return call

    def engine(self, engine: WarmEngine) -> WarmEngine:
        """The engine, with the rows and the time of its steps counted."""
        return cast(WarmEngine, _Timed(engine, self))

    def watch(self, world: World) -> None:
        """Counts what scene and crowd take of a world's steps from now on."""
        guide = world.guide
        for owner, method, part in (
            (guide, "course", GUIDE),
            (guide, "obstacles", GUIDE),
            (guide.avoidance, "bend", CROWD),
        ):
            setattr(owner, method, self.timed(getattr(owner, method), part))

    def figures(self, motion: float) -> Row:
        """Load of one core over `motion` seconds of the world: all, and parts but the engine."""
        world, guide, crowd = (self.seconds[part] for part in (WORLD, GUIDE, CROWD))
        return {
            "cpu_load": world / motion,
            "cpu_us_per_step": 1e6 * world / max(self.steps, 1),
            "engine_share": self.seconds[ENGINE] / world,
            "navigation_share": (guide - crowd) / world,
            "avoidance_share": crowd / world,
        }


class _Timed:
    """An engine whose steps are counted."""

    def __init__(self, engine: WarmEngine, cost: Cost) -> None:
        self._engine, self._cost = engine, cost
        self._step = cost.timed(engine.step, ENGINE)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._engine, name)

    def step(self, gender: str, inputs: StepInputs) -> StepOutputs:
        self._cost.steps += len(inputs.goal)
        return cast(StepOutputs, self._step(gender, inputs))
