"""The machine's ceiling: the speed of libraries for large matrices, and for those of a step.

    python -m benchmarks.gemm [--threads 1 2] [--quick]

A row shows library, matrices, precision, and billions of operations per second. *large* are square
matrices, where a processor comes nearest to its limit; *ours* are all products of a step, one after
the other, each as in the graph. The ceiling of a precision is the best of all its rows with this
number of threads, of torch or onnxruntime.
"""

import argparse
from collections import Counter
from collections.abc import Callable, Sequence

import numpy as np
import onnx
import onnxruntime
import torch

from benchmarks import bench
from benchmarks.bench import Row
from benchmarks.flops import Product, products
from benchmarks.models import step_graph

LARGE = (1024, 2048)
BATCH = 128

Multiply = Callable[[Product], Callable[[], object]]
"""Makes a call that does one product."""


def ceilings(rows: Sequence[Row]) -> dict[tuple[str, int], float]:
    """The best GFLOP/s for each precision and number of threads."""
    found: dict[tuple[str, int], float] = {}
    for row in rows:
        key = (row["precision"], row["threads"])
        found[key] = max(found.get(key, 0.0), row["gflops"])
    return found


def measure(threads: Sequence[int], ours: Sequence[Product], seconds: float) -> list[Row]:
    """Rows for large squares, and for the products of a step, by library and precision."""
    rows = []
    for count in threads:
        libraries: dict[tuple[str, str], Multiply] = {
            ("torch", "fp32"): _torch(torch.float32),
            ("torch", "bf16"): _torch(torch.bfloat16),
            ("onnxruntime", "fp32"): _onnxruntime(count),
        }
        torch.set_num_threads(count)
        for (library, precision), multiply in libraries.items():
            kinds: dict[str, list[Product]] = {
                f"large {size}": [Product(size, size, size)] for size in LARGE
            }
            kinds["ours"] = list(ours)
            for kind, wanted in kinds.items():
                rows.append(
                    {
                        "library": library,
                        "precision": precision,
                        "threads": count,
                        "products": kind,
                        "gflops": _speed(multiply, wanted, count, seconds),
                    }
                )
    return rows


def _speed(multiply: Multiply, wanted: Sequence[Product], threads: int, seconds: float) -> float:
    clock, spent, flops = bench.clock_of(threads), 0.0, 0
    repeats = Counter(wanted)
    for product, times in repeats.items():
        spent += times * bench.best(multiply(product), seconds / len(repeats), clock)
        flops += times * product.flops
    return flops / spent / 1e9


def _torch(kind: torch.dtype) -> Multiply:
    def multiply(product: Product) -> Callable[[], object]:
        batch = (product.count,) if product.count > 1 else ()
        left = torch.rand(*batch, product.m, product.k).to(kind)
        right = torch.rand(*batch, product.k, product.n).to(kind)
        out = torch.empty(*batch, product.m, product.n, dtype=kind)
        return lambda: torch.matmul(left, right, out=out)

    return multiply


def _onnxruntime(threads: int) -> Multiply:
    """The right matrix is a constant, as weights are: onnxruntime packs it once."""

    def multiply(product: Product) -> Callable[[], object]:
        batch = [product.count] if product.count > 1 else []
        random = np.random.default_rng(0)
        left = random.random((*batch, product.m, product.k), np.float32)
        right = random.random((*batch, product.k, product.n), np.float32)
        floats = onnx.TensorProto.FLOAT
        graph = onnx.helper.make_graph(
            [onnx.helper.make_node("MatMul", ["left", "right"], ["out"])],
            "product",
            [onnx.helper.make_tensor_value_info("left", floats, left.shape)],
            [onnx.helper.make_tensor_value_info("out", floats, [*batch, product.m, product.n])],
            [onnx.numpy_helper.from_array(right, "right")],
        )
        model = onnx.helper.make_model(
            graph, opset_imports=[onnx.helper.make_opsetid("", 20)], ir_version=10
        )
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = threads
        options.add_session_config_entry("session.intra_op.allow_spinning", "0")
        session = onnxruntime.InferenceSession(
            model.SerializeToString(), options, ["CPUExecutionProvider"]
        )
        return lambda: session.run(None, {"left": left})

    return multiply


def main() -> None:
    """Prints the table."""
    parser = bench.parser(__doc__)
    parser.add_argument("--threads", type=int, nargs="+", default=[1, 2])
    asked: argparse.Namespace = parser.parse_args()
    ours = products(step_graph(), agents=BATCH, candidates=1)
    bench.finish(asked, measure(asked.threads, ours, 0.3 if asked.quick else 2.0))


if __name__ == "__main__":
    main()
