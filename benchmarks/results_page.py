"""Write docs/results.md from the JSON files of `wayfarer eval … --json benchmarks/results/…`.

The page has the main figures of each table. All of them are in benchmarks/results/README.md,
which is written at the same time.

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
ALL = RESULTS / "README.md"

INTRO = """# Results

Made by `python benchmarks/results_page.py` from `benchmarks/results/*.json`; nothing is typed in.
{which} "mocap" rows are recordings, measured by the same code. [figures.md]({results}figures.md)
defines the figures.

**What `heldout` means.** No network was trained on three people of the CMU recordings (08, 09,
32). They are not untouched: a feasibility experiment chose the predictor's KL weight, the origin on
the floor and the regressor's passes on them. Some of them run or stride, so their mocap rows lean
and hurry more than other people's. No held-out person takes part in `control`, `long`, `bodies` and
`arrival` from standing: agents begin in the shipped start poses, with random shapes, and the split
changes the mocap row only.
"""
SHORT = "These are the main figures; [all are here](../benchmarks/results/README.md)."
FULL = "All figures; the main ones are in [docs/results.md](../../docs/results.md)."

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
    "arrival": f"wayfarer eval arrival {HELDOUT} --seed 7",
    "maneuvers": "wayfarer eval maneuvers --data PREPARED --seed 7",
    "long": "wayfarer eval long --seed 3 --data PREPARED",
    "realism": f"wayfarer eval realism {HELDOUT} --seed 7",
    "skating": f"wayfarer eval skating {HELDOUT} --seed 7",
    "bodies": f"wayfarer eval bodies {HELDOUT} --seed 7",
    "predictor": f"wayfarer eval predictor {HELDOUT} --seed 7",
    "regressor": f"wayfarer eval regressor {HELDOUT} --seed 7",
    "scenes": "wayfarer eval scenes --only cubes,slope,storeys,doors,crates --seed 0",
    "scenes_streams": "wayfarer eval scenes --only corridor,doorway --repeats 5 --seed 0",
    "scenes_square": "wayfarer eval scenes --only square --seed 0",
}
WORTH = frozenset(
    (
        # control, arrival
        *("success", "success_03m", "success_075m", "steps", "avg_dist", "stopped"),
        *("walk_slide_cm_s", "arrival_error_median_m", "drift_5s_max_m", "facing_error_median_deg"),
        *("reached_15", "speed_error_mps", "faced_15", "facing_error_mean_deg", "passed", "detour"),
        # how they move
        *("speed_mps", "contact_strict", "slide_cm_s", "lost"),
        *("seam_ratio", "trunk_tilt_deg", "frechet_v1", "pose_prior", "heel_skating_75mm_s"),
        "marker_speed_cm_s",
        # predictor, regressor
        *(
            "ade_m",
            "fde_m",
            "mmade_m",
            "apd_m",
            "amd_mm",
            "amd_p95_mm",
            "avd_mm",
            "joint_angle_deg",
        ),
        # long, scenes
        *("minutes_each", "resets", "fallen_agents", "tilted_agents", "floating_agents"),
        *("spinning_agents", "goals_reached", "path_ratio", "walked_ratio", "penetration_5cm"),
        *(
            "overlap_frames",
            "stuck_agents",
            "foot_gap_p95_cm",
            "shut_seen_s_max",
            "crate_seen_s_max",
        ),
    )
)
"""Figures of the short page."""

SPEED = ", 0.9-1.4 m/s"
Row = dict[str, Any]


def tables(rows: list[Row], every: bool) -> list[list[Row]]:
    """Rows in groups that share their metrics (rows without any figure are left out).

    Unless `every`, with the metrics of `WORTH` only; walking at all speeds is then left out where
    the same is there at one speed.
    """
    groups: dict[tuple[str, ...], list[Row]] = {}
    names = [row["name"] for row in rows]
    for row in rows:
        keys = tuple(k for k in row if k != "name" and (every or k in WORTH))
        if len(keys) > every:  # the number of windows alone is no figure
            groups.setdefault(keys, []).append({"name": row["name"]} | {k: row[k] for k in keys})
    if every:
        return list(groups.values())
    at_speed = {f"{name}{SPEED}" for name in names} & set(names)
    return [
        kept
        for group in groups.values()
        if (kept := [r for r in group if "speed_mps" not in r or r["name"] + SPEED not in at_speed])
    ]


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
    """When, where and of what a result was made; **stale** when it is not of the release."""
    where = f"{meta['machine']['cpu']}, {meta['machine']['cores']} cores"
    told = f"{meta['date'][:10]}, {where}, commit {meta['commit'][:7]}"
    return told if meta["commit"] == release else f"{told}, **stale**"


def commits() -> dict[str, str]:
    """The commit that each result on the page was made by."""
    paths = {name: RESULTS / f"{name}.json" for name in COMMANDS}
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
    PAGE.write_text(page(release, bool(stale), every=False))
    ALL.write_text(page(release, bool(stale), every=True))


def page(release: str, stale: bool, every: bool) -> str:
    """One of the two pages."""
    intro = INTRO.format(
        which=FULL if every else SHORT, results="" if every else "../benchmarks/results/"
    )
    parts = [intro, *([STALE] if stale else [])]
    for name, command in COMMANDS.items():
        path = RESULTS / f"{name}.json"
        if not path.exists():
            continue
        result = json.loads(path.read_text())
        parts.append(f"## {name}\n\n`{command}`  \n{made(result['meta'], release)}\n")
        if name == "maneuvers":
            parts.append(bars(result))
            continue
        parts += [markdown(rows) + "\n" for rows in tables(result["rows"], every)]
    return "\n".join(parts)


if __name__ == "__main__":
    main()
