"""The step of agents with one candidate each, which need not be scored to be chosen."""

from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from openvino import Model

LEFT_OUT: Final = ("terms", "choice")
"""Outputs that a step without scores does not have."""


def without_scores(network: "Model", rows: int) -> "Model":
    """The same network, changed in place: the first candidate is chosen, whatever it costs.

    What led to its cost leads nowhere then, and is left out when the network is compiled: a twelfth
    of a step.
    """
    from openvino import opset13 as ops

    for result in network.get_results():
        chosen = result.input_value(0)
        names = chosen.get_names()
        if not names & set(LEFT_OUT):
            continue
        network.remove_result(result)
        if "choice" in names:
            first = ops.constant(np.zeros(rows, np.int64)).output(0)
            for reader in list(chosen.get_target_inputs()):
                reader.replace_source_output(first)
    network.validate_nodes_and_infer_types()
    return network
