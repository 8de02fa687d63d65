"""The page paper.md from results: nothing but the paper's own figures is typed in."""

import shlex
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

from wayfarer_lab.evaluation.paper.orderings import ORDERINGS, against_mojo, state
from wayfarer_lab.evaluation.paper.published import (
    COMMANDS,
    EXHIBITS,
    MOTIONS,
    PICTURES,
    S3,
    Exhibit,
    Line,
)
from wayfarer_lab.evaluation.paper.results import Measured, ResultsFolder, number

INTRO: Final = """# The paper's tables and figures, and ours

Made by `wayfarer eval paper` from the JSON results in `{folder}`; of the figures only the paper's
own are typed in. Of each figure the first column is the paper's, the second ours. "–": not given or
not measured; a row that is missing says why. *Recordings* are measured by the same code.

**Data.** The paper trains and tests on AMASS, on SMPL-X bodies; its recordings may not be used
here. Ours are trained on CMU's recordings on the anny52 body (those *trained alike* also on
100STYLE's) and tested on three other people of CMU (08, 09, 32; not untouched:
[what that means](README.md)), without the held-out takes of 100STYLE. So compare
orders, not values.
[models.md](../../docs/models.md#where-we-deviate-from-the-paper-and-why) lists all deviations.

**Trainings.** "Made by" has steps × batch and minutes of processor time. No row of the shipped
model stands for more than one training, nor does one of predictors that are *trained alike*: by the
paper's equations, with the same data, steps and batch, from nothing, with one seed. Those called
*short* had a tenth of that or less, with seeds 0, 1 and 2: the mean, and the least and the largest
figure. All are far shorter than the paper's. *policy(10)* and *policy(1)* are three trainings each,
of 40 epochs in 10 minutes of one core, by the paper's rewards with another estimator of the same
gradient ([what was tried](../../docs/models.md#ppo-from-scratch)); the g-CVAE is one of 783 of
4,000 steps × 256. All seven act on the shipped predictor, are told 1.2 m/s and the goal alone, and
begin, as the paper's, with a primitive of the 1-frame model. Other rows of Table 1 are told
1.5 m/s, by the service's steering, and begin at rest. The shipped predictors' rollout stages were
short (300 and 80 steps): rows of the shipped *1-frame* model say little about it. Minutes were
not counted before 2026-11-23.
"""


def page(
    results: ResultsFolder,
    folder: str,
    s3: Mapping[int, float] | None,
    drawn: Mapping[str, str] | None = None,
) -> str:
    """The page. `s3`: bodies → seconds of a primitive as served; None: no such result.

    `drawn`: the files in `images/` of the pictures of motion, by name.
    """
    parts = [INTRO.format(folder=folder), _orderings(results)]
    parts += [_exhibit(exhibit, results) for exhibit in EXHIBITS[:3]]
    parts.append(_runtime(s3))
    parts += [_exhibit(exhibit, results) for exhibit in EXHIBITS[3:]]
    pictures = [f"- {name}: {where}." for name, where in PICTURES.items()]
    parts.append("\n".join(["## Pictures", "", *pictures, ""]))
    for name, (title, about) in MOTIONS.items():
        file = (drawn or {}).get(name)
        shown = f"![{title}](images/{file})" if file else "Missing: no result of "
        shown += "" if file else f"`wayfarer eval {'failures' if name == 'fig_s3' else 'figures'}`."
        parts.append(f"### {title}\n\n{about}\n\n{shown}\n")
    return "\n".join(parts)


def _orderings(results: ResultsFolder) -> str:
    lines = []
    for ordering in ORDERINGS:
        said = state(ordering, results)
        lines.append([ordering.claim, ordering.where, f"**{said.verdict}**", said.figures])
    table = _table(["the paper says", "where", "here", ""], lines)
    return f"## What is better than what\n\n{table}\n\n{against_mojo(results)}\n"


def _exhibit(exhibit: Exhibit, results: ResultsFolder) -> str:
    origins: list[str] = []
    cells = [_cells(line, exhibit, results, origins) for line in exhibit.lines]
    head = ["", *(f"{name}, {who}" for name in exhibit.figures.values() for who in WHO), "made by"]
    kept = [k for k, _ in enumerate(head) if k == 0 or any(row[k] != "–" for row in cells)]
    table = _table([head[k] for k in kept], [[row[k] for k in kept] for row in cells])
    missing = [
        f"- **{line.name}** is missing: {line.why}."
        for line in exhibit.lines
        if line.why and (line.source is None or results.measured(line.source) is None)
    ]
    notes = [f"{k}. {origin}" for k, origin in enumerate(origins, 1)]
    body = "\n".join([*missing, *([""] if missing and notes else []), *notes])
    return f"## {exhibit.title}\n\n{exhibit.about}\n\n{table}\n\n{body}\n"


WHO: Final = ("paper", "ours")


def _cells(line: Line, exhibit: Exhibit, results: ResultsFolder, origins: list[str]) -> list[str]:
    """Cells of a row; what made it joins `origins`, and the last cell has its number there."""
    row = results.measured(line.source) if line.source else None
    cells = [line.name]
    for k, figure in enumerate(exhibit.figures):
        cells.append(number(line.paper[k]) if k < len(line.paper) else "–")
        cells.append(row.text(figure) if row else "–")
    if row is None:
        return [*cells, "–"]
    numbers = []
    for text in dict.fromkeys(_origins(row)):
        if text not in origins:
            origins.append(text)
        numbers.append(str(origins.index(text) + 1))
    return [*cells, ", ".join(numbers)]


def _origins(row: Measured) -> Iterable[str]:
    """What made each file of a row: command, seed, commit, date, machine, minutes of training."""
    for result in row.results:
        meta = result.meta
        machine, stem = meta["machine"], result.path.stem
        known = (made for pattern, made in COMMANDS.items() if result.path.match(f"{pattern}.json"))
        command = meta.get("command") or next(known, f"wayfarer eval …, into {stem}.json")
        yield (
            f"`{_shown(command)}`, seed {meta.get('seed')}, split "
            f"{meta.get('split')}, commit {meta['commit'][:7]}, {meta['date'][:10]}, "
            f"{machine['cpu']}, {machine['cores']} cores. {_trained(meta)} (`{result.path.name}`)"
        )


OPTIONS: Final = {
    "--data": "PREPARED",
    "--models": "MODELS",
    "--runs": "RUNS",
    "--policy-10": "MODELS_10",
    "--policy-1": "MODELS_1",
    "--g-cvae": "GCVAE",
}
"""Options whose value is a folder of who measured, and what stands for it."""


def _shown(command: str) -> str:
    """A command without the folders of the machine on which it ran."""
    words = command.split() if "…" in command else shlex.split(command)
    shown: list[str] = []
    for before, word in zip(["", *words], words, strict=False):
        if word != "--json" and before != "--json":
            shown.append(OPTIONS.get(before, word))
    return " ".join(shown)


def _trained(meta: Mapping[str, Any]) -> str:
    minutes = meta.get("cpu_minutes") or {}
    if not minutes:
        return "Minutes of training: not counted"
    steps = meta.get("steps") or {}
    minutes = [
        f"{name} {'not counted' if m is None else f'{m:.0f}'}"
        + (f" ({steps[name]})" if name in steps else "")
        for name, m in sorted(minutes.items())
    ]
    counted = " (steps × batch)" if steps else ""
    return f"Minutes of training{counted}: " + ", ".join(minutes)


def _runtime(s3: Mapping[int, float] | None) -> str:
    title = "## Table S3: seconds for a primitive of N bodies\n\n"
    if s3 is None:
        return title + "Missing: no result of `python -m benchmarks.paper_s3`.\n"
    rows = [
        [str(bodies), number(seconds), number(s3[bodies]) if bodies in s3 else "–"]
        for bodies, seconds in sorted(S3.items())
    ]
    table = _table(["bodies", "paper, Quadro 6000", "ours, two cores, onnxruntime"], rows)
    made = "`python -m benchmarks.paper_s3`; more in [performance.md](performance.md)."
    return f"{title}{table}\n\n{made}\n"


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(
        f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in line)} |" for line in lines
    )
