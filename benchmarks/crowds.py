"""People among people: doors, groups, shared goals, people in the way.

    python -m benchmarks.crowds [--cases one_way_1.2 …] [--seeds 1] [--no-peer] [--plots FOLDER]
        [--films FOLDER] [--json FILE] [--quick]

The world of a session in lock-step with the real engine and one candidate; time passes as fast as
it is computed. It is compared with JuPedSim's collision-free speed model V2 on the same
ground (`pip install jupedsim`; it is skipped if that is missing).
*there*: people at their goals, or as near as others let them. *all_s*: seconds from the start
until all are there. *after_s*: the same from the first arrival.
*through_s*: seconds until all are through the door. JuPedSim's people are removed at their goals,
so they block nobody. *flow*, *per_m*: people per second through the door, also per metre.
*door_idle_s*: longest time for which the door was empty although somebody stood before it.
*still_s*: longest time for which a person on its way has not advanced by .3 m; *untold_s*: the same
until the event `BLOCKED`.
*overlap_cm*: maximum overlap of two bodies (capsules of .42 by .22 m across their facing);
*overlap_%*, *deep_%*: shares of bodies and times that overlap by more than 1 and 5 cm.
*m/s*: mean speed of people on their way, 3 to 15 s after the start; in a stream, in which all
walk one way, of its middle half from 4 s on. *per_m2*, *diagram_m/s*: the density there, and the
speed of Weidmann's fundamental diagram at it. *wall_cm*, *body_cm*: maximum depth of skin in a
wall, and of a limb or trunk in another body (corridors). *walked_on_m*: maximum that a person
walked later than 15 s after the first arrival. With several seeds the figures are the worst (of
*there*, *all_s*, *still_s* …) or the mean (of flows).

`--cost` instead measures the rule: microseconds of an agent and step at 1 and 3 people per m².
"""

import argparse
import time
from collections import Counter
from collections.abc import Callable, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import bench
from benchmarks.bench import Row
from benchmarks.crowd_cases import CASES, QUICK, Case
from benchmarks.crowd_cost import rule_cost
from benchmarks.crowd_figures import RATE, Tracks, figures
from benchmarks.crowd_film import Filming
from benchmarks.crowd_skin import Skin
from wayfarer.models.bundle import DEFAULT_MODEL, ModelBundle, open_bundle
from wayfarer.spec import BETAS, FPS, GENDERS
from wayfarer.world.agents.agent import AgentSpec, ChunkFlag, MotionChunk, SessionSpec
from wayfarer.world.agents.heading import facing_of
from wayfarer.world.events import EventKind
from wayfarer.world.goals.steering import Steering
from wayfarer.world.scenes.messages import SceneSource
from wayfarer.world.scenes.scene_registry import SceneRegistry

EVERY = round(FPS / RATE)
"""Frames from one sample of a track to the next."""

OVER = 16.0
"""Seconds for which a case continues after the last arrival."""

MEANS = "flow", "per_m", "m/s", "per_m2", "diagram_m/s", "wall_s"
"""Figures of which several seeds have the mean."""


See = Callable[[int, MotionChunk], None]


def people_of(case: Case, seed: int) -> list[AgentSpec]:
    """The people of a case."""
    random = np.random.default_rng(seed)
    return [
        AgentSpec(
            gender=GENDERS[number % 2],
            betas=tuple(random.uniform(-1, 1, BETAS).tolist()),
            position=tuple(place),
            heading=float(heading),
            noise_seed=1000 * seed + number,
        )
        for number, (place, heading) in enumerate(
            zip(case.starts.tolist(), case.headings, strict=True)
        )
    ]


def run(
    case: Case, bundle: ModelBundle, specs: list[AgentSpec], watchers: Sequence[See] = ()
) -> Tracks:
    """Simulates a case; `watchers` see each chunk and the number of its person."""
    begun = time.process_time()
    scenes = SceneRegistry()
    scene = "" if case.spec is None else scenes.create(SceneSource(case.spec)).scene_id
    world = bundle.world(len(case.starts), Steering().with_search(candidates=1), scenes)
    session = world.create_session(SessionSpec(scene=scene), 0.0).session_id
    people = [agent.agent_id for agent in world.create_agents(session, specs, 0.0)]
    for agent, goal in zip(people, case.goals, strict=True):
        if goal is not None:
            world.give(agent, goal, 0.0)
    number = {agent: k for k, agent in enumerate(people)}
    samples = round((case.seconds + 1) * RATE)
    place = np.full((samples, len(people), 2), np.nan)
    facing = np.full((samples, len(people), 2), np.nan)
    reached, events, end = np.full(len(people), np.inf), Counter[str](), case.seconds
    told = list[tuple[float, int]]()
    wanted = [k for k, goal in enumerate(case.goals) if goal is not None]
    for chunk in world.advance(case.seconds):
        who = number[chunk.agent_id]
        for see in watchers:
            see(who, chunk)
        first = round(chunk.scheduled_at * RATE)
        for k, frame in enumerate(range(EVERY - 1, len(chunk.translation), EVERY)):
            if first + k < samples:
                place[first + k, who] = chunk.translation[frame, :2]
                facing[first + k, who] = facing_of(chunk.rotations[frame : frame + 1, 0])[0]
        if ChunkFlag.ARRIVED in chunk.flags:
            reached[who] = min(reached[who], chunk.scheduled_at)
            if np.isfinite(reached[wanted]).all():
                end = min(end, chunk.scheduled_at + OVER)
        if chunk.scheduled_at > end:
            break
        for _, event in world.take_events():
            events[event.kind.value] += 1
            if event.kind == EventKind.BLOCKED:
                told.append((chunk.scheduled_at, number[event.agent_id]))
    known = np.flatnonzero(np.isfinite(place).all((1, 2)))
    window = slice(known[0], known[-1] + 1)
    wall = time.process_time() - begun
    told = [(at - known[0] / RATE, who) for at, who in told]
    return Tracks(place[window], facing[window], reached, events, told, wall)


def summed(rows: Sequence[Row]) -> Row:
    """One row of several seeds: the worst of each figure, and the mean flow."""
    if len(rows) == 1:
        return rows[0]
    found: Row = {"there": " ".join(sorted({row["there"] for row in rows}))}
    for name in rows[0]:
        values = [row[name] for row in rows]
        if name == "there":
            continue
        if name == "events":
            counts = Counter[str]()
            for text in values:
                words = text.split()
                counts.update(dict(zip(words[::2], map(int, words[1::2]), strict=True)))
            found[name] = " ".join(f"{kind} {count}" for kind, count in sorted(counts.items()))
        elif name in MEANS:
            known = [value for value in values if value is not None]
            found[name] = float(np.mean(known)) if known else None
        elif name in ("all_s", "after_s", "through_s") and None in values:
            found[name] = None
        else:
            known = [value for value in values if value is not None]
            found[name] = max(known) if known else None
    return found


def main() -> None:
    """Runs, prints and draws."""
    parser = bench.parser(__doc__)
    parser.add_argument("--cases", nargs="+", choices=CASES, metavar="CASE", help=f"of {[*CASES]}")
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--no-peer", action="store_true", help="without JuPedSim")
    parser.add_argument("--plots", type=Path, help="draw paths from above into this folder")
    parser.add_argument("--films", type=Path, help="film the first seed into this folder (GIF)")
    parser.add_argument("--cost", action="store_true", help="measure the rule's cost instead")
    asked: argparse.Namespace = parser.parse_args()
    if asked.cost:
        bench.finish(asked, [rule_cost(density, asked.quick) for density in (1.0, 3.0)])
        return
    bundle = open_bundle(DEFAULT_MODEL, 1)
    has_peer = find_spec("jupedsim") is not None and not asked.no_peer
    found: list[Row] = []
    for name in asked.cases or (QUICK if asked.quick else CASES):
        for who in ("ours", "jupedsim"):
            rows: list[Row] = []
            for seed in range(asked.seeds):
                case = CASES[name](seed)
                if who == "jupedsim" and not (has_peer and case.peer):
                    continue
                if who == "jupedsim":
                    tracks = peer(case)
                    rows.append(figures(case, tracks))
                else:
                    film = asked.films / f"{name}.gif" if asked.films and seed == 0 else None
                    tracks, row = ours(case, bundle, seed, film)
                    rows.append(row)
                if asked.plots and seed == 0:
                    from benchmarks.crowd_plots import draw

                    asked.plots.mkdir(parents=True, exist_ok=True)
                    draw(case, tracks).save(asked.plots / f"{name}_{who}.png")
            if rows:
                found.append({"case": case.name, "of": who, **summed(rows)})
                print(found[-1], flush=True)
    bench.finish(asked, found)


def ours(case: Case, bundle: ModelBundle, seed: int, film: Path | None) -> tuple[Tracks, Row]:
    """Runs the case, and films it into a file if asked."""
    specs = people_of(case, seed)
    skin, filming = Skin(case, specs, bundle.bodies), Filming(case, specs, bundle.bodies)
    watchers = [skin.see] * case.measures_skin + [filming.see] * (film is not None)
    tracks = run(case, bundle, specs, watchers)
    if film is not None:
        film.parent.mkdir(parents=True, exist_ok=True)
        filming.write(film)
    return tracks, figures(case, tracks) | (skin.figures() if case.measures_skin else {})


def peer(case: Case) -> Any:
    """Runs the case in JuPedSim."""
    from benchmarks import crowd_peer

    return crowd_peer.run(case)


if __name__ == "__main__":
    main()
