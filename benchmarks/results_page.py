"""Write docs/results.md from the JSON files of `wayfarer eval … --json benchmarks/results/…`.

python benchmarks/results_page.py            # refuses tables that are not all of one commit
python benchmarks/results_page.py --stale    # marks them instead
"""

import json
import sys
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
RESULTS = HERE / "results"
PAGE = HERE.parent / "docs" / "results.md"

INTRO = """# Results

Made by `python benchmarks/results_page.py` from `benchmarks/results/*.json`; nothing is typed in.
Each section names the command and the machine. "mocap" rows are recordings, judged by the same
code. The metrics are defined in `lab/wayfarer_lab/evaluation/` (docstrings).

**What `heldout` means.** Three people of the CMU recordings (08, 09, 32) whom no network was
trained on. They are not untouched: the predictor's KL weight and the origin on the floor were
chosen in a feasibility experiment on them, and so were the passes of the regressor
(docs/models.md). Some of them run or stride, so their mocap rows lean and hurry more than other
people's. In `control`, `long`, `bodies` and in `arrival` from standing no held-out person takes
part at all: agents begin in the shipped start poses, with random shapes, and the split changes the
mocap row only.
"""

STALE = """**Not of one release.** Tables marked stale were made by another commit than most of this
page, or by one that nobody can name: their figures need not hold for the shipped models.
"""

HELDOUT = "--data PREPARED --split heldout"
COMMANDS = {
    "control": f"wayfarer eval control --g-cvae GCVAE --speed 1.5 {HELDOUT} --seed 7",
    "arrival": f"wayfarer eval arrival {HELDOUT} --seed 7",
    "maneuvers": "wayfarer eval maneuvers --data PREPARED --seed 7",
    "long": "wayfarer eval long --seed 3",
    "realism": f"wayfarer eval realism {HELDOUT} --seed 7",
    "skating": f"wayfarer eval skating {HELDOUT} --seed 7",
    "bodies": f"wayfarer eval bodies {HELDOUT} --seed 7",
    "predictor": f"wayfarer eval predictor {HELDOUT} --seed 7",
    "regressor": f"wayfarer eval regressor {HELDOUT} --seed 7",
    "scenes": "wayfarer eval scenes --only cubes,corridor,slope,storeys,doors,crates --seed 0",
    "scenes_square": "wayfarer eval scenes --only square --seed 0",
}
SEEDS = """## control, three trainings of the policy

`wayfarer train policy-analytic --config CONFIG` with `steps = 600` and `seed` 0, 1 and 2; of each
`wayfarer export` and `wayfarer eval control --models MODELS --speed 1.5 {HELDOUT} --seed 7`
{when}
"""
OF_SEEDS = ("policy & top1", "search K=8 π", "search K=8 N(0, I)")
WORTH = ("name", "success", "success_03m", "steps", "avg_dist", "contact", "walk_slide_cm_s")
Row = dict[str, Any]


def tables(rows: list[Row]) -> list[list[Row]]:
    """Rows in groups that share their metrics (rows without any figure are left out)."""
    groups: dict[tuple[str, ...], list[Row]] = {}
    for row in rows:
        keys = tuple(k for k in row if k != "name")
        if len(keys) > 1:
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


def of_seeds(release: str) -> list[str]:
    """The section that compares trainings which differ in their seed alone."""
    results = [json.loads(path.read_text()) for path in sorted(RESULTS.glob("control_seed_*.json"))]
    rows = [
        {key: f"{row['name']}, seed {seed}" if key == "name" else row[key] for key in WORTH}
        for name in OF_SEEDS
        for seed, result in enumerate(results)
        for row in result["rows"]
        if row["name"] == name and "success" in row
    ]
    heading = SEEDS.format(HELDOUT=HELDOUT, when=made(results[0]["meta"], release))
    return [heading, markdown(rows) + "\n"]


def made(meta: dict[str, Any], release: str) -> str:
    """When, where and of what a result was made; **stale** when it is not of the release."""
    where = f"{meta['machine']['cpu']}, {meta['machine']['cores']} cores"
    told = f"{meta['date'][:10]}, {where}, commit {meta['commit'][:7]}"
    return told if meta["commit"] == release else f"{told}, **stale**"


def commits() -> dict[str, str]:
    """The commit that each result on the page was made by."""
    names = [*COMMANDS, *(path.stem for path in sorted(RESULTS.glob("control_seed_*.json")))]
    paths = {name: RESULTS / f"{name}.json" for name in names}
    return {
        name: json.loads(path.read_text())["meta"]["commit"]
        for name, path in paths.items()
        if path.exists()
    }


def release_of(found: dict[str, str]) -> str:
    """The commit of most results, of those from which the sources can be had again."""
    named = [c for c in found.values() if c != "unknown" and not c.endswith("-dirty")]
    return max(named, key=named.count) if named else ""


def bars(result: dict[str, Any]) -> str:
    """The bars of manoeuvres, with what was recorded beside."""
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
    """Write the page."""
    found = commits()
    release = release_of(found)
    stale = sorted(name for name, commit in found.items() if commit != release)
    if stale and "--stale" not in sys.argv[1:]:
        told = ", ".join(f"{name} ({found[name][:7]})" for name in stale)
        sys.exit(
            f"these results are not of commit {release[:7] or 'that can be named'}: {told}. "
            "Make them again with `wayfarer eval all`, or mark them with --stale."
        )
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
        if name == "control":
            parts += of_seeds(release)
    PAGE.write_text("\n".join(parts))


if __name__ == "__main__":
    main()
