"""`wayfarer load`."""

import asyncio
import math
import os
import platform
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from wayfarer import __version__
from wayfarer_lab.load import report
from wayfarer_lab.load.knee import find_knee
from wayfarer_lab.load.plan import Plan
from wayfarer_lab.load.run import run
from wayfarer_lab.load.tally import Tally
from wayfarer_lab.load.target import Target, own_server, room

KEY_VARIABLE = "WAYFARER_LOAD_KEY"


def load(
    target: Annotated[
        str, typer.Option(help="gRPC address of a running server, host:port; none: start one.")
    ] = "",
    http: Annotated[
        str, typer.Option(help="Its HTTP address, for --transport websocket.")
    ] = "http://127.0.0.1:8080",
    sessions: Annotated[int, typer.Option(help="Sessions, each with a stream.", min=1)] = 8,
    agents: Annotated[int, typer.Option(help="Agents of each session.", min=1)] = 8,
    seconds: Annotated[float, typer.Option(help="Seconds that are measured.")] = 30.0,
    warm_up: Annotated[float, typer.Option(help="Seconds before that.")] = 5.0,
    transport: Annotated[str, typer.Option(help="grpc or websocket.")] = "grpc",
    goal_rate: Annotated[
        float, typer.Option(help="New goals a second for each agent, at random instants.")
    ] = 0.1,
    slow: Annotated[int, typer.Option(help="Extra streams that are read too slowly.")] = 0,
    vanishing: Annotated[
        int, typer.Option(help="Extra streams, each cut off every second or so.")
    ] = 0,
    knee: Annotated[
        int, typer.Option(help="Find the most agents in all, up to this, that are served in time.")
    ] = 0,
    p99_ms: Annotated[float, typer.Option(help="In time: p99 of lateness within this.")] = 50.0,
    seed: Annotated[int, typer.Option(help="The same seed asks for the same.")] = 0,
    serve: Annotated[
        list[str] | None,
        typer.Option("--serve", help="Option for the server that is started, e.g. --candidates=1."),
    ] = None,
    json: Annotated[
        Path | None, typer.Option(help="Write the figures here, and a plot beside it.")
    ] = None,
) -> None:
    """Load a server with streams and goals, and measure how late its motion is.

    Lateness counts from the instant at which a primitive is to be shown, by the clock of this
    machine: run it on the server's machine, or keep both clocks in step. A miss is a primitive that
    never came, or after its last frame's time (0.2 s): also one that the server left out of its
    schedule, or that a broken stream did not bring. Goals are given at random instants whatever the
    answers do (open loop), and their latency counts from those. The generator's own use of the
    processor is told beside the server's. A key for the server goes into the environment as
    WAYFARER_LOAD_KEY; settings of a server that is started, as WAYFARER_ADMISSION=false, too.
    """
    plan = Plan(
        sessions, agents, seconds, warm_up, transport, goal_rate, slow, vanishing, seed=seed
    )
    with asyncio.Runner(loop_factory=_loop_factory()) as runner:
        runner.run(_load(plan, target, http, tuple(serve or ()), knee, p99_ms, json))


def _loop_factory() -> Callable[[], asyncio.AbstractEventLoop] | None:
    """Of uvloop, where there is one: the generator shall take little from the server."""
    try:
        import uvloop
    except ImportError:  # Windows has none
        return None
    factory: Callable[[], asyncio.AbstractEventLoop] = uvloop.new_event_loop
    return factory


async def _load(
    plan: Plan, address: str, http: str, serve: tuple[str, ...], knee: int, p99_ms: float,
    json: Path | None,
) -> None:  # fmt: skip
    console = Console()
    meta: dict[str, Any] = {
        "wayfarer": __version__,
        "machine": f"{platform.processor() or platform.machine()}, {os.cpu_count()} cores",
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
    target: Target, plan: Plan, knee: int, p99_ms: float, json: Path | None,
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


async def _watched(target: Target, plan: Plan, console: Console) -> tuple[dict[str, Any], Tally]:
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
