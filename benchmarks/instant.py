"""`wayfarer serve` whose engine computes nothing: to measure the rest of the service.

python -m benchmarks.instant [options of `wayfarer serve`]
"""

import typer

from benchmarks.driven import InstantEngine
from wayfarer.commands.serve import serve_command
from wayfarer.engines.onnx_engine import OnnxEngine

if __name__ == "__main__":
    OnnxEngine.stride = InstantEngine.stride  # type: ignore[attr-defined]
    OnnxEngine.step = InstantEngine.step  # type: ignore[assignment,method-assign]
    typer.run(serve_command)
