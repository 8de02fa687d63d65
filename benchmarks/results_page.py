"""Writes benchmarks/results/README.md from the results of `wayfarer eval … --json` in its folder.

python benchmarks/results_page.py            # refuses tables that are not all of one commit
python benchmarks/results_page.py --stale    # marks them instead
"""

import json
import sys
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
RESULTS = HERE / "results"
PAGE = RESULTS / "README.md"

INTRO = """# Results

Made by `python benchmarks/results_page.py` from `benchmarks/results/*.json`; nothing is typed in.
"mocap" rows are recordings, measured by the same code. [figures.md](figures.md) defines all
figures.

**What `heldout` means.** No network was trained on three people of the CMU recordings (08, 09,
32). They are not untouched: a feasibility experiment chose the predictor's KL weight, the origin on
the floor and the regressor's passes on them. Some of them run or stride, so their mocap rows lean
and hurry more than other people's. No held-out person takes part in `control` and `bodies`: agents
begin in the shipped start poses, with random shapes, and the split changes the mocap row only.
"""
STALE = """**Not of one release.** Tables marked stale were made by another commit than most of this
page, or by an unknown one: their figures need not hold for the shipped models. **Nor is any table
here of the model that serves since 2026-11-26**: models.md has what is measured of it so far.
"""

HELDOUT = "--data PREPARED --split heldout"
COMMANDS = {
    "control": f"wayfarer eval control --speed 1.5 {HELDOUT} --seed 7",
    **{
        f"control_sent_{speed}": f"wayfarer eval control --only 'search K=8 π, foot lock' "
        f"--speed {speed} --seed 7"
        for speed in ("1.0", "1.2", "1.5")
    },
    "maneuvers": "wayfarer eval maneuvers --data PREPARED --seed 7",
    "realism": f"wayfarer eval realism {HELDOUT} --seed 7",
    "skating": f"wayfarer eval skating {HELDOUT} --seed 7",
    "bodies": f"wayfarer eval bodies {HELDOUT} --seed 7",
    "predictor": f"wayfarer eval predictor {HELDOUT} --seed 7",
    "regressor": f"wayfarer eval regressor {HELDOUT} --seed 7",
    "scenes": "wayfarer eval scenes --only cubes,slope,storeys,doors,crates --seed 0",
    "scenes_streams": "wayfarer eval scenes --only corridor,doorway --repeats 5 --seed 0",
    "scenes_square": "wayfarer eval scenes --only square --seed 0",
}
Row = dict[str, Any]


def tables(rows: list[Row]) -> list[list[Row]]:
    """Rows in groups that share their metrics; rows without any figure are left out."""
    groups: dict[tuple[str, ...], list[Row]] = {}
    for row in rows:
        keys = tuple(k for k in row if k != "name")
        if len(keys) > 1:  # the number of windows alone is no figure
            groups.setdefault(keys, []).append(row)
    return list(groups.values())


def shown(value: object) -> str:
    """A figure with as many digits as are worth reading."""
    if isinstance(value, float):
        return f"{value:.3f}" if abs(value) < 100 else f"{value:.0f}"
    return str(value)


def markdown(rows: list[Row]) -> str:
    """One table: metrics down, rows across."""
    names = [str(r["name"]) for r in rows]
    lines = [f"| | {' | '.join(names)} |", "|---" * (len(names) + 1) + "|"]
    metrics = [k for k in rows[0] if k != "name"]
    lines += [f"| {m} | {' | '.join(shown(r[m]) for r in rows)} |" for m in metrics]
    return "\n".join(lines)


def made(meta: dict[str, Any], release: str) -> str:
    """Date, machine and commit of a result; **stale** if it is not of the release."""
    where = f"{meta['machine']['cpu']}, {meta['machine']['cores']} cores"
    origin = f"{meta['date'][:10]}, {where}, commit {meta['commit'][:7]}"
    return origin if meta["commit"] == release else f"{origin}, **stale**"


def commits() -> dict[str, str]:
    """The commit that each result on the page was made by."""
    paths = {name: RESULTS / f"{name}.json" for name in COMMANDS}
    return {
        name: json.loads(path.read_text())["meta"]["commit"]
        for name, path in paths.items()
        if path.exists()
    }


def release_of(found: dict[str, str]) -> str:
    """The commit of most results, among commits whose sources are available."""
    named = [c for c in found.values() if c != "unknown" and not c.endswith("-dirty")]
    return max(named, key=named.count) if named else ""


def bars(result: dict[str, Any]) -> str:
    """The bars of manoeuvres, with recorded figures."""
    rows = {(r["maneuver"], r["case"], r["source"]): r for r in result["rows"]}
    lines = ["| | case | figure | sent | raw | recorded | bar | |", "|---" * 8 + "|"]
    for bar in result["bars"]:
        beside = [
            rows.get((bar["maneuver"], bar["case"], source), {}).get(bar["figure"])
            for source in ("raw", "recorded")
        ]
        figures = ["–" if v is None else shown(v) for v in (bar["value"], *beside)]
        cells = [bar["maneuver"], bar["case"], bar["figure"], *figures, bar["bar"], bar["verdict"]]
        lines.append(f"| {' | '.join(cells)} |")
    met = sum(bar["verdict"] == "met" for bar in result["bars"])
    return "\n".join([*lines, "", f"{met} of {len(result['bars'])} bars are met.\n"])


def main() -> None:
    """Writes the page."""
    found = commits()
    release = release_of(found)
    stale = sorted(name for name, commit in found.items() if commit != release)
    if stale and "--stale" not in sys.argv[1:]:
        others = ", ".join(f"{name} ({found[name][:7]})" for name in stale)
        sys.exit(
            f"these results are not of commit {release[:7] or 'that can be named'}: {others}. "
            "Make them again with `wayfarer eval all`, or mark them with --stale."
        )
    PAGE.write_text(page(release, bool(stale)))


def page(release: str, stale: bool) -> str:
    """All results."""
    parts = [INTRO, *([STALE] if stale else [])]
    for name, command in COMMANDS.items():
        path = RESULTS / f"{name}.json"
        if not path.exists():
            continue
        result = json.loads(path.read_text())
        parts.append(f"## {name}\n\n`{command}`  \n{made(result['meta'], release)}\n")
        if name == "maneuvers":
            parts.append(bars(result))
            continue
        parts += [markdown(rows) + "\n" for rows in tables(result["rows"])]
    return "\n".join(parts)


if __name__ == "__main__":
    main()
