"""Mix two policies that began near each other: `wayfarer train policy-mix`.

A policy that was taught to follow is steady, and its people are alike. A policy that also learned
manners jumps at times. Their weights lie near each other, so the weights between are those of a
policy between (Wortsman et al., Model soups, ICML 2022).
"""

import json
from pathlib import Path

import torch

from wayfarer.errors import ArtifactError, InvalidArgument
from wayfarer_lab.training.run import read_weights


def mix_policies(first: Path, second: Path, share: float, out: Path) -> None:
    """Writes a run of `share` of the second run's weights and the rest of the first's.

    Raises InvalidArgument for a share off 0 to 1, ArtifactError where the runs do not fit.
    """
    if not 0 <= share <= 1:
        raise InvalidArgument(f"share is {share:g}; allowed: 0 to 1", "share")
    one, two = read_weights(first), read_weights(second)
    shapes = [{name: value.shape for name, value in one_of.items()} for one_of in (one, two)]
    if shapes[0] != shapes[1]:
        raise ArtifactError(f"{first} and {second} hold networks of different shapes")
    mixed = {name: torch.lerp(one[name].float(), two[name].float(), share).half() for name in one}
    out.mkdir(parents=True, exist_ok=True)
    config = {"first": str(first), "second": str(second), "share": share}
    (out / "config.json").write_text(json.dumps(config, indent=2) + "\n")
    (out / "log.txt").write_text(
        f"mixed: {1 - share:g} of {first.name}, {share:g} of {second.name}\n"
    )
    torch.save({"model": mixed, "step": 0}, out / "last.pt")  # the last file: it is done
