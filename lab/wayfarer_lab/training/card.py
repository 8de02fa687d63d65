"""The model card of an exported folder, made from the runs themselves: nothing is typed in."""

import json
import platform
import time
from collections import defaultdict
from pathlib import Path

import torch

from wayfarer.spec import FPS
from wayfarer_lab.training.mocap.store import Dataset
from wayfarer_lab.training.run import read_effort, read_run_config

HEADER = """# Model card: {name}

Made on {date} by `wayfarer export` (torch {torch}, Python {python}).

**What.** GAMMA (Zhang and Tang, *The Wanderings of Odysseus in 3D Scenes*, CVPR 2022): a CVAE that
predicts 0.25 s motion primitives of 67 body-surface markers, and a regressor per gender that finds
the body behind them. `step_*.onnx` hold the whole step; `predictor_*` and `regressor_*` the parts.

**Data**, fitted to the anny52 body (`docs/data.md`):
- CMU Graphics Lab Motion Capture Database. "The data used in this project was obtained from
  mocap.cs.cmu.edu. The database was created with funding from NSF EIA-0196217."
- The 100STYLE Dataset, Ian Mason, Sebastian Starke, Taku Komura (CC BY 4.0).
- Open 3D Engine contributors, Motion Matching gem (Apache-2.0).
- ACCAD, The Ohio State University, Open Motion Project (CC BY 3.0).
- High Fidelity, Inc. (Apache-2.0).

All were retargeted, cut and resampled.

**Use.** People walking, standing, starting, stopping, turning, side-stepping and walking backward
on a flat floor. **Not for** uneven ground, sitting, carrying, or judging real people's gait. A few
subjects carry most of the walking, so gaits are less varied than people's. Adults only.

**Licence.** Apache-2.0 (weights and code); see NOTICE.

**Figures**: `benchmarks/results/README.md`, made by `wayfarer eval`.
"""


def model_card(name: str, runs: dict[str, Path], data: Path | None) -> str:
    """Markdown with the networks, their settings, and each run's last validation."""
    parts = [
        HEADER.format(
            name=name,
            date=time.strftime("%Y-%m-%d"),
            torch=torch.__version__,
            python=platform.python_version(),
        )
    ]
    if data is not None:
        parts.append(_data_table(Dataset.load(data)))
    parts += [_run_section(network, folder) for network, folder in runs.items()]
    return "\n".join(parts)


def _data_table(data: Dataset) -> str:
    """Minutes that were learnt from, by split and kind."""
    minutes: defaultdict[tuple[str, str], float] = defaultdict(float)
    for clip in data.clips:
        used = int((data.use[clip.start : clip.stop] > 0).sum())
        minutes[clip.split, clip.augmentation.split(":")[0] or "as recorded"] += used / FPS / 60
    rows = [f"| {split} | {kind} | {m:.1f} |" for (split, kind), m in sorted(minutes.items())]
    head = [
        "## Prepared motion",
        "",
        "Fits to several bodies count each; mirror images do not.",
        "",
    ]
    return "\n".join([*head, "| split | kind | minutes |", "|---|---|---|", *rows, ""])


def _run_section(network: str, folder: Path) -> str:
    """Settings and last validation of one run."""
    config = read_run_config(folder)
    log = (folder / "log.txt").read_text().splitlines()
    effort = read_effort(folder)
    took = "not counted" if effort is None or effort.cpu_minutes is None else effort.cpu_minutes
    lines = [f"## {network}", "", f"Run `{folder.name}`, last log line:", "", f"    {log[-1]}", ""]
    lines += [f"Minutes of processor time, without the runs it started from: {took}.", ""]
    return "\n".join([*lines, "```json", json.dumps(config, indent=2), "```", ""])
