"""Tree search by width, memory and hard costs, compared with online search.

    python benchmarks/search.py [--agents 96] [--seed 1] [--json FILE]

Half of the agents get a goal 3 to 8 m away in any direction, half one 1.5 m to the side or behind;
all start from standing, and a run ends when they stand at their goal or after 60 primitives.
*N x K*: N children of each of K kept nodes. *N x 1* is the service's online search with N
candidates, which tries them within one row at less cost. *cost*: sum over the path of the
weighted quality terms, which search minimises. *better*: difference from the cost with 16 x 1 and
the same latents, mean over agents ± standard error.
"""

import argparse
import json
import time
from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from math import cos, pi, sin, tau
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

from wayfarer.models.bundle import DEFAULT_MODEL, ModelBundle, open_bundle
from wayfarer.world.agents.agent import AgentSpec
from wayfarer.world.agents.goal import Goal
from wayfarer.world.goals.steering import Steering
from wayfarer.world.search.beam import plan
from wayfarer.world.search.beam_settings import HARD, BeamSettings
from wayfarer.world.search.problem import Ending, MotionPlan, PlanningProblem
from wayfarer_lab.evaluation.gait import Windows, gait_row
from wayfarer_lab.evaluation.tasks import random_specs
from wayfarer_lab.evaluation.tracks import skin_track

LATENTS = {
    "π": BeamSettings(until="standing", policy=1.0),
    "N(0, I)": BeamSettings(until="standing", policy=0.0, temperature=1.3),
}
SEARCHES: dict[str, dict[str, Any]] = {
    "16 x 1": {"children": 16, "keep": 1},
    "4 x 1": {"children": 4, "keep": 1},
    "8 x 2": {"children": 8, "keep": 2},
    "4 x 4": {"children": 4, "keep": 4},
    "2 x 8": {"children": 2, "keep": 8},
    "4 x 4, memory 0.9": {"children": 4, "keep": 4, "memory": 0.9},
    "4 x 4, memory 1": {"children": 4, "keep": 4, "memory": 1.0},
    "4 x 4, hard": {"children": 4, "keep": 4, "limits": HARD},
    "16 x 4": {"children": 16, "keep": 4},
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
    name: str,
    bundle: ModelBundle,
    specs: Sequence[AgentSpec],
    plans: Sequence[MotionPlan],
    seconds: float,
) -> dict[str, Any]:
    """Figures of one search, and its seconds of CPU time."""
    windows = []
    for spec, found in zip(specs, plans, strict=True):
        body = bundle.bodies[spec.gender]
        made = skin_track(body, np.array(spec.betas), found.translation, found.rotations)
        windows.append(made.windows())
    gait = gait_row(name, Windows.join(windows), bundle.bodies["female"].sole_markers)
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
    """Runs the searches and prints a table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--agents", type=int, default=96)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--model", type=Path, default=DEFAULT_MODEL)
    parser.add_argument("--json", type=Path)
    asked = parser.parse_args()

    bundle = open_bundle(asked.model, threads=1)
    random = np.random.default_rng(asked.seed)
    specs = random_specs(asked.agents, random)
    motions = bundle.world(asked.agents, Steering()).prepare(specs)
    problem = PlanningProblem.of(specs, motions, random_goals(specs, random))
    rows: list[dict[str, Any]] = []
    online: dict[str, Any] = {}
    for latents, name in track(list(product(LATENTS, SEARCHES)), "searching"):
        settings = replace(LATENTS[latents], **SEARCHES[name])
        started = time.process_time()
        plans = plan(bundle.engine, problem, settings)
        seconds = time.process_time() - started
        costs = np.array([found.costs.sum() for found in plans])
        less = online.setdefault(latents, costs) - costs
        error = less.std() / np.sqrt(len(less))
        made = row(f"{latents} {name}", bundle, specs, plans, seconds)
        rows.append({**made, "better": f"{less.mean():.2f} ± {error:.2f}"})
        if asked.json:
            asked.json.write_text(json.dumps({"rows": rows, "seed": asked.seed}, indent=1))
    table = Table(*rows[0])
    for line in rows:
        table.add_row(*(f"{v:.3g}" if isinstance(v, float) else str(v) for v in line.values()))
    Console(width=160).print(table)


if __name__ == "__main__":
    main()
