"""`wayfarer eval control`: Table 1 of the paper."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import typer

from wayfarer.errors import InvalidArgument
from wayfarer.models.bundle import DEFAULT_MODEL, ModelBundle, open_bundle
from wayfarer.world.goals.steering import Steering
from wayfarer.world.search.beam_settings import BeamSettings
from wayfarer_lab.evaluation import report
from wayfarer_lab.evaluation.commands import options
from wayfarer_lab.evaluation.commands.shared import finish, origin
from wayfarer_lab.evaluation.control import (
    TOGETHER,
    Pair,
    Trial,
    control_row,
    mocap_row,
    offline,
    online,
    random_pairs,
    told_the_goal_alone,
)
from wayfarer_lab.evaluation.gait import MOCAP
from wayfarer_lab.evaluation.outcome import NEAR
from wayfarer_lab.evaluation.tracks import Recorded
from wayfarer_lab.training.mocap.selection import Use

if TYPE_CHECKING:  # loads torch, which `wayfarer eval --help` must not
    from wayfarer_lab.evaluation.first_primitive import Lead

app = typer.Typer()

PRIOR = "N(0, I)"
Run = Callable[[list[Pair]], Iterator[Trial]]


@dataclass(frozen=True)
class ControlMethod:
    """One row: how pairs become trials."""

    name: str
    run: Run


@app.command(short_help="Random bodies to random goals: policy and searches (Table 1).")
def control(
    models: options.Models = DEFAULT_MODEL,
    policy_10: options.Policy10 = None,
    policy_1: options.Policy1 = None,
    g_cvae: options.GoalCvae = None,
    only: Annotated[
        str,
        typer.Option(
            help="Only methods whose names begin so, as 'policy(10)'.", show_default="all"
        ),
    ] = "",
    lead: Annotated[
        bool,
        typer.Option(
            "--lead",
            help="Offline rows begin with a primitive of --models' 1-frame predictor.",
        ),
    ] = False,
    pairs: Annotated[
        int, typer.Option(help="Number of random bodies, each with a goal.", min=1)
    ] = 100,
    speed: Annotated[float, typer.Option(help="Target speed, m/s.", min=0.2, max=4.0)] = 1.4,
    data: options.Data = None,
    split: options.Split = "heldout",
    threads: options.Threads = 0,
    seed: options.Seed = 0,
    json: options.Json = None,
) -> None:
    """Send random bodies to random goals, by the paper's methods and by the service's (Table 1).

    Offline rows follow the paper (Sec. 4.2): 32 clones of each body and, with "& top k", a tree
    search that keeps the k best of 32 primitives at every level. The row "policy" is the policy of
    --models; the shipped one learns from recordings (docs/models.md). The rows policy(10) and
    policy(1) need --policy-10 and --policy-1: PPO with that weight of the KL term (Eq. 10); they
    and the g-CVAE receive the goal and the speed alone, as in their training; steering turns all
    others on the spot first. "search" rows are single bodies in the world that serves, with K
    candidates per step. Only the last row has the foot lock. Bodies begin at rest; with --lead
    those of offline rows begin as the paper's, with a primitive of the 1-frame predictor; a policy
    that was trained so seldom sets off without it.
    """
    shipped = open_bundle(models, threads)
    of_paper = {"policy(10)": policy_10, "policy(1)": policy_1}
    first = _lead(models, threads, seed) if lead else None
    every = methods(shipped, of_paper, g_cvae, pairs, threads, seed, first)
    everyone = random_pairs(pairs, speed, np.random.default_rng(seed))
    body = shipped.bodies["male"]
    rows = []
    with report.progress() as bar:
        for method in chosen(list(every), only):
            task = bar.add_task(f"{method.name} (pairs)", total=pairs)
            trials = []
            for trial in method.run(everyone):
                trials.append(trial)
                bar.advance(task)
            rows.append(control_row(method.name, trials, body))
    if data:
        recorded = Recorded(data, split).windows(Use.LOCOMOTION)
        rows.append(mocap_row(MOCAP, recorded, body))
    finish(
        json, {"Control": rows}, **origin(models, None, data, split, seed),
        policy_10=str(policy_10), policy_1=str(policy_1), g_cvae=str(g_cvae), only=only, lead=lead,
        pairs=pairs, speed_mps=speed,
    )  # fmt: skip


def chosen(methods: list[ControlMethod], only: str) -> list[ControlMethod]:
    """The methods whose names begin with `only`. Raises InvalidArgument with all names if none
    does.
    """
    found = [method for method in methods if method.name.startswith(only)]
    if not found:
        names = ", ".join(method.name for method in methods)
        raise InvalidArgument(f"no method begins with {only!r}; there are: {names}", "only")
    return found


def methods(
    shipped: ModelBundle,
    of_paper: Mapping[str, Path | None],
    g_cvae: Path | None,
    pairs: int,
    threads: int,
    seed: int,
    lead: "Lead | None" = None,
) -> Iterator[ControlMethod]:
    """Rows in the order of Table 1, then those of the service.

    Raises ArtifactError for a folder that does not fit, InvalidArgument for one without a policy.
    """
    tops = {"": 0, " & top1": 1, " & top4": 4}
    if g_cvae:
        bundle = open_bundle(g_cvae, threads)
        yield ControlMethod(
            "g-CVAE",
            _offline(
                bundle,
                seed,
                BeamSettings.paper(policy=0.0, reach=NEAR),
                lead,
                told_the_goal_alone(),
            ),
        )
    trained = {"policy": shipped} if shipped.has_policy else {}
    for name, folder in of_paper.items():
        if folder is None:
            continue
        trained[name] = open_bundle(folder, threads)
        if not trained[name].has_policy:
            raise InvalidArgument(f"{folder} holds no policy.onnx", name)
    for ending, top in tops.items():
        for name, bundle in trained.items():
            settings = BeamSettings.paper(top, reach=NEAR)
            steering = told_the_goal_alone() if name in of_paper else None
            yield ControlMethod(name + ending, _offline(bundle, seed, settings, lead, steering))
    prior = BeamSettings.paper(1, policy=0.0, reach=NEAR)
    yield ControlMethod(f"{PRIOR} & top1", _offline(shipped, seed, prior, lead))

    yield ControlMethod(f"search K=8 {PRIOR}", _online(shipped, pairs, candidates=8, policy=0.0))
    for candidates in (8, 4, 1) if shipped.has_policy else ():
        run = _online(shipped, pairs, candidates=candidates, policy=1.0)
        yield ControlMethod(f"search K={candidates} π", run)
    if shipped.has_policy:
        run = _online(shipped, pairs, candidates=8, policy=1.0, foot_lock=True)
        yield ControlMethod("search K=8 π, foot lock", run)


def _lead(models: Path, threads: int, seed: int) -> "Lead":
    from wayfarer_lab.evaluation.first_primitive import Lead
    from wayfarer_lab.evaluation.model_parts import load_parts

    return Lead(load_parts(models, None, threads), seed)


def _offline(
    bundle: ModelBundle,
    seed: int,
    settings: BeamSettings,
    lead: "Lead | None",
    steering: Steering | None = None,
) -> Run:
    world, random = bundle.world(TOGETHER, Steering()), np.random.default_rng(seed)
    return lambda pairs: offline(
        bundle.engine, world, bundle.bodies, pairs, settings, random, lead, steering
    )


def _online(
    bundle: ModelBundle, agents: int, candidates: int, policy: float, foot_lock: bool = False
) -> Run:
    steering = Steering().with_search(candidates=candidates, policy=policy)
    return lambda pairs: online(bundle.world(agents, steering), bundle.bodies, pairs, foot_lock)
