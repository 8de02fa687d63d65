"""Write docs/results.md from the JSON files of `wayfarer eval … --json benchmarks/results/…`.

python benchmarks/results_page.py
"""

import json
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
RESULTS = HERE / "results"
PAGE = HERE.parent / "docs" / "results.md"

INTRO = """# Results

Made by `python benchmarks/results_page.py` from `benchmarks/results/*.json`; nothing is typed in.
Each section names the command and the machine. `heldout` are people that no training and no
tuning has seen; "mocap" rows are recordings, judged by the same code. The metrics are defined in
`lab/wayfarer_lab/evaluation/` (docstrings).
"""

HELDOUT = "--data PREPARED --split heldout"
COMMANDS = {
    "control": f"wayfarer eval control --g-cvae GCVAE --speed 1.5 {HELDOUT} --seed 7",
    "arrival": f"wayfarer eval arrival {HELDOUT} --seed 7",
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
OF_SEEDS = ("policy(10) & top1", "search K=8 π", "search K=8 N(0, I)")
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


def of_seeds() -> list[str]:
    """The section that compares trainings which differ in their seed alone."""
    results = [json.loads(path.read_text()) for path in sorted(RESULTS.glob("control_seed_*.json"))]
    rows = [
        {key: f"{row['name']}, seed {seed}" if key == "name" else row[key] for key in WORTH}
        for name in OF_SEEDS
        for seed, result in enumerate(results)
        for row in result["rows"]
        if row["name"] == name and "success" in row
    ]
    heading = SEEDS.format(HELDOUT=HELDOUT, when=made(results[0]["meta"]))
    return [heading, markdown(rows) + "\n"]


def made(meta: dict[str, Any]) -> str:
    """When, where and of what a result was made."""
    where = f"{meta['machine']['cpu']}, {meta['machine']['cores']} cores"
    return f"{meta['date'][:10]}, {where}, commit {meta['commit'][:7]}"


def main() -> None:
    """Write the page."""
    parts = [INTRO]
    for name, command in COMMANDS.items():
        path = RESULTS / f"{name}.json"
        if not path.exists():
            continue
        result = json.loads(path.read_text())
        parts.append(f"## {name}\n\n`{command}`  \n{made(result['meta'])}\n")
        parts += [markdown(rows) + "\n" for rows in tables(result["rows"])]
        if name == "control":
            parts += of_seeds()
    PAGE.write_text("\n".join(parts))


if __name__ == "__main__":
    main()
