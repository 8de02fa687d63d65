"""`wayfarer load`."""

import math
import os
import platform
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from wayfarer import __version__
from wayfarer.process import event_loop
from wayfarer.process.processor import cores
from wayfarer_lab.load import report
from wayfarer_lab.load.knee import find_knee
from wayfarer_lab.load.plan import LoadPlan
from wayfarer_lab.load.rings import parse_rings
from wayfarer_lab.load.run import run
from wayfarer_lab.load.tally import Tally
from wayfarer_lab.load.target import Target, own_server, room

KEY_VARIABLE = "WAYFARER_LOAD_KEY"


def load(
    target: Annotated[
        str,
        typer.Option(help="gRPC address of a running server, host:port. Without it, start one."),
    ] = "",
    http: Annotated[
        str, typer.Option(help="HTTP address of that server, for --transport websocket.")
    ] = "http://127.0.0.1:8080",
    sessions: Annotated[int, typer.Option(help="Sessions, each with a stream.", min=1)] = 8,
    agents: Annotated[int, typer.Option(help="Agents per session.", min=1)] = 8,
    seconds: Annotated[float, typer.Option(help="Seconds to measure.")] = 30.0,
    warm_up: Annotated[float, typer.Option(help="Seconds of load before the measurement.")] = 5.0,
    transport: Annotated[str, typer.Option(help="grpc or websocket.")] = "grpc",
    goal_rate: Annotated[
        float,
        typer.Option(help="New goals per second and agent, at random instants; 0: all stand."),
    ] = 0.1,
    slow: Annotated[int, typer.Option(help="Extra streams with a reader that is too slow.")] = 0,
    vanishing: Annotated[
        int, typer.Option(help="Extra streams that disconnect about every second.")
    ] = 0,
    rings: Annotated[
        str,
        typer.Option(
            help="Levels of detail: rings around a viewpoint that walks through each session's "
            "crowd, as DETAIL:METRES from the inside out. full: as without rings; part: 13 bones, "
            "20 frames a second; root: place and heading, 10 a second. Without a radius, the last "
            "ring has all the others; with one, who is beyond is not sent. With --area 50, "
            "full:8.5,part:17,root has some 5, 15 and 80 % of the people in its rings."
        ),
    ] = "",
    viewpoint_speed: Annotated[
        float,
        typer.Option(help="With --rings: metres per second of the viewpoint; 0: it stands."),
    ] = LoadPlan.viewpoint_speed,
    area: Annotated[
        float, typer.Option(help="Metres: radius of the disc in which each session's agents walk.")
    ] = LoadPlan.area,
    knee: Annotated[
        int,
        typer.Option(
            help="Find the largest number of agents served in time, up to this; 0: do not."
        ),
    ] = 0,
    p99_ms: Annotated[
        float, typer.Option(help="With --knee: largest p99 of lateness that counts as in time.")
    ] = 50.0,
    seed: Annotated[
        int, typer.Option(help="The same seed gives the same goals at the same times.")
    ] = 0,
    serve: Annotated[
        list[str] | None,
        typer.Option(
            "--serve", help="Option of the server that is started, e.g. --candidates=1; repeatable."
        ),
    ] = None,
    json: Annotated[
        Path | None, typer.Option(help="File for the figures; a plot goes beside it.")
    ] = None,
) -> None:
    """Load a server with streams and goals, and measure how late its motion is.

    Lateness is the time from the scheduled display of a primitive to its arrival, by the clock of
    this machine: run the generator on the server's machine, or synchronise both clocks. A miss is a
    primitive that never came, or came more than 0.2 s late. New goals are sent at random instants
    without waiting for answers (open loop); their latency runs from those instants. The output
    shows the CPU use of generator and server.

    Environment variables: WAYFARER_LOAD_KEY is the API key for --target; others that begin with
    WAYFARER_, such as WAYFARER_ADMISSION=false, are settings of the server that is started.

    docs/measuring.md explains the figures.
    """
    plan = LoadPlan(
        *(sessions, agents, seconds, warm_up, transport, goal_rate, slow, vanishing),
        seed=seed,
        rings=parse_rings(rings),
        viewpoint_speed=viewpoint_speed,
        area=area,
    )
    event_loop.run(_load(plan, target, http, tuple(serve or ()), knee, p99_ms, json))


async def _load(
    plan: LoadPlan, address: str, http: str, serve: tuple[str, ...], knee: int, p99_ms: float,
    json: Path | None,
) -> None:  # fmt: skip
    console = Console()
    meta: dict[str, Any] = {
        "wayfarer": __version__,
        "machine": f"{platform.processor() or platform.machine()}, {cores()} cores",
        "plan": vars(plan),
        "serve": list(serve),
    }
    if address:
        key = os.environ.get(KEY_VARIABLE)
        metadata = (("authorization", f"Bearer {key}"),) if key else ()
        await _measure(Target(address, http, metadata), plan, knee, p99_ms, json, meta, console)
        return
    async with own_server(serve, room(max(knee, plan.sessions * plan.agents), plan)) as target:
        await _measure(target, plan, knee, p99_ms, json, meta, console)


async def _measure(
    target: Target, plan: LoadPlan, knee: int, p99_ms: float, json: Path | None,
    meta: dict[str, Any], console: Console,
) -> None:  # fmt: skip
    if not knee:
        summary, tally = await _watched(target, plan, console)
        report.show(summary, console)
        if json:
            report.write(json, summary, meta, tally)
        return

    sessions = min(plan.sessions, knee)

    async def trial(each: int) -> dict[str, Any]:
        wanted = replace(plan, sessions=sessions, agents=each)
        summary, _ = await _watched(target, wanted, console)
        report.show(summary, console)
        return summary

    each, trials = await find_knee(trial, math.ceil(knee / sessions), p99_ms)
    found = each * sessions
    console.print(f"[bold]{found} agents[/bold] are served in time (p99 within {p99_ms:g} ms)")
    if json:
        report.write_knee(json, found, trials, p99_ms, meta)


async def _watched(
    target: Target, plan: LoadPlan, console: Console
) -> tuple[dict[str, Any], Tally]:
    """A run with a progress bar."""
    columns = (
        TextColumn("{task.description}"), BarColumn(), TimeRemainingColumn(),
        TextColumn("{task.fields[note]}"),
    )  # fmt: skip
    with Progress(*columns, console=console, transient=True) as bar:
        title = f"{plan.sessions} × {plan.agents} agents"
        task = bar.add_task(title, total=plan.seconds, note="")

        def progress(done: float, tally: Tally) -> None:
            bar.update(task, completed=done, note=f"{tally.misses} missed")

        return await run(target, plan, progress)
