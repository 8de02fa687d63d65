"""The same cases in JuPedSim: its collision-free speed model V2, with its own parameters."""

import time
from collections import Counter

import jupedsim
import numpy as np

from benchmarks.crowd_cases import SPEED, Case
from benchmarks.crowd_figures import RATE, Tracks

STEP = 0.05
"""Seconds of a step."""

THERE = 0.5
"""Metres from its goal at which a person has arrived and is removed, so that it blocks nobody."""


def run(case: Case) -> Tracks:
    """Simulates a case."""
    begun = time.process_time()
    model = jupedsim.CollisionFreeSpeedModelV2()
    simulation = jupedsim.Simulation(model=model, geometry=case.ground, dt=STEP)
    names, goals = [], []
    for place, goal in zip(case.starts.tolist(), case.goals, strict=True):
        to = tuple(place) if goal is None else goal.position[:2]
        stage = simulation.add_waypoint_stage(to, 0.3)
        journey = simulation.add_journey(jupedsim.JourneyDescription([stage]))
        agent = jupedsim.CollisionFreeSpeedModelV2AgentParameters(
            position=tuple(place), desired_speed=SPEED, journey_id=journey, stage_id=stage
        )
        names.append(simulation.add_agent(agent))
        goals.append(to)
    every = round(1 / (RATE * STEP))
    places, reached = [], np.full(len(names), np.inf)
    for tick in range(round(case.seconds / STEP)):
        if tick % every == 0:
            line = np.full((len(names), 2), np.nan)
            for k, name in enumerate(names):
                if np.isinf(reached[k]):
                    line[k] = simulation.agent(name).position
            near = np.linalg.norm(line - goals, axis=-1) < THERE
            for k in np.flatnonzero(near).tolist():
                reached[k] = tick * STEP
                simulation.mark_agent_for_removal(names[k])
            places.append(line)
            if np.isfinite(reached).all():
                break
        simulation.iterate()
    return Tracks(np.array(places), None, reached, Counter(), [], time.process_time() - begun)
