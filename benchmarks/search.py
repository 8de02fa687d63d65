"""What tree search is worth: width, memory and hard costs, against the search online.

    python benchmarks/search.py [--agents 48] [--seed 1] [--json FILE]

Half of the agents get a goal 3 to 8 m away in any direction, half one 1.5 m beside or behind them;
all start from standing, and a run ends when they stand at their goal or after 60 primitives.
*N x K*: N children of each of K kept nodes; *N x 1* is what the service does online with N
candidates, but for its cost: it tries them within one row. *cost*: sum over the path of the
weighted quality terms, which is what is searched for; *better*: how much less that is than with
the first row's search, per agent, ± standard error.
"""

import argparse
import json
import time
from collections.abc import Sequence
from dataclasses import replace
from math import cos, pi, sin, tau
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

from wayfarer.evaluation.gait import Windows, gait_row
from wayfarer.evaluation.goals import random_specs
from wayfarer.evaluation.tracks import skin_track
from wayfarer.runtime.agent import AgentSpec, Goal
from wayfarer.runtime.beam import plan
from wayfarer.runtime.beam_settings import HARD, BeamSettings
from wayfarer.runtime.plan import Ending, Plan, Problem
from wayfarer.runtime.steering import Steering
from wayfarer.stage import DEFAULT_MODEL, Stage, open_stage

POLICY = BeamSettings(until="standing")
PRIOR = replace(POLICY, policy=0.0, temperature=1.3)

SEARCHES = {
    "4 x 1": replace(POLICY, children=4, keep=1),
    "16 x 1": replace(POLICY, children=16, keep=1),
    "8 x 2": replace(POLICY, children=8, keep=2),
    "4 x 4": POLICY,
    "4 x 4, memory 0.9": replace(POLICY, memory=0.9),
    "4 x 4, memory 1": replace(POLICY, memory=1.0),
    "4 x 4, hard": replace(POLICY, limits=HARD),
    "16 x 4, memory 1": replace(POLICY, children=16, memory=1.0),
    "N(0, I) 16 x 1": replace(PRIOR, children=16, keep=1),
    "N(0, I) 4 x 4": PRIOR,
    "N(0, I) 4 x 4, memory 0.9": replace(PRIOR, memory=0.9),
    "N(0, I) 4 x 4, memory 1": replace(PRIOR, memory=1.0),
    "N(0, I) 16 x 4, memory 1": replace(PRIOR, children=16, memory=1.0),
}


def random_goals(specs: Sequence[AgentSpec], random: np.random.Generator) -> list[list[Goal]]:
    """A goal for each agent: far for the first half of them, near for the others."""
    goals = []
    for number, spec in enumerate(specs):
        angle, distance = random.uniform(0, tau), random.uniform(3, 8)
        if number >= len(specs) // 2:
            angle, distance = spec.heading + pi / 2 + random.choice([-pi / 2, pi / 2, pi]), 1.5
        x, y = spec.position
        goals.append([Goal((x + distance * cos(angle), y + distance * sin(angle), 0.0))])
    return goals


def row(
    name: str, stage: Stage, specs: Sequence[AgentSpec], plans: Sequence[Plan], seconds: float
) -> dict[str, Any]:
    """Figures of one search, made in so many seconds of CPU time."""
    windows = []
    for spec, found in zip(specs, plans, strict=True):
        body = stage.bodies[spec.gender]
        made = skin_track(body, np.array(spec.betas), found.translation, found.rotations)
        windows.append(made.windows())
    gait = gait_row(name, Windows.join(windows), stage.bodies["female"].sole_markers)
    return {
        "name": name,
        "stands": float(np.mean([found.ending is Ending.STANDING for found in plans])),
        "steps": float(np.mean([found.steps for found in plans])),
        "error_m": float(np.mean([found.distance for found in plans])),
        "cost": float(np.mean([found.costs.sum() for found in plans])),
        "contact_strict": gait["contact_strict"],
        "slide_cm_s": gait["slide_cm_s"],
        "rejected": float(np.mean(np.concatenate([found.rejected for found in plans]))),
        "agent_steps_per_cpu_s": sum(found.steps for found in plans) / seconds,
    }


def main() -> None:
    """Run the searches and print a table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--agents", type=int, default=48)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", nargs="*", choices=SEARCHES, default=list(SEARCHES))
    parser.add_argument("--model", type=Path, default=DEFAULT_MODEL)
    parser.add_argument("--json", type=Path)
    asked = parser.parse_args()

    stage = open_stage(asked.model, threads=1)
    random = np.random.default_rng(asked.seed)
    specs = random_specs(asked.agents, random)
    motions = stage.world(asked.agents, Steering()).prepare(specs)
    problem = Problem.of(specs, motions, random_goals(specs, random))
    rows, first = [], None
    for name in track(asked.only, "searching"):
        started = time.process_time()
        plans = plan(stage.engine, problem, SEARCHES[name])
        rows.append(row(name, stage, specs, plans, time.process_time() - started))
        costs = np.array([found.costs.sum() for found in plans])
        first = costs if first is None else first
        less = first - costs
        error = less.std() / np.sqrt(len(less))
        rows[-1]["better"] = f"{less.mean():.2f} ± {error:.2f}"
        if asked.json:
            asked.json.write_text(json.dumps({"rows": rows, "seed": asked.seed}, indent=1))
    table = Table(*rows[0])
    for line in rows:
        table.add_row(*(f"{v:.3g}" if isinstance(v, float) else str(v) for v in line.values()))
    Console(width=160).print(table)


if __name__ == "__main__":
    main()
