"""`wayfarer keys`: make API keys."""

import sys
from typing import Annotated

import typer
from pydantic import TypeAdapter, ValidationError

from wayfarer.errors import InvalidArgument
from wayfarer.transport.auth.keys import Name, new_key
from wayfarer.transport.edge.caller import Scope

app = typer.Typer(no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False)


@app.callback()
def _group() -> None:
    """API keys of the server."""


@app.command()
def new(
    name: Annotated[
        str,
        typer.Argument(help="Name of the caller who will use the key, and own what it creates."),
    ],
    scopes: Annotated[
        str,
        typer.Option(
            help="read: describe and follow; control: create and change; admin: everything, "
            "also models, drain and other callers' sessions."
        ),
    ] = "read,control",
) -> None:
    """Make an API key.

    Writes the entry for the keys file to stdout, and the key itself, once, to stderr. For example:

    wayfarer keys new studio --scopes read,control >> keys.toml
    """
    try:
        TypeAdapter(Name).validate_python(name)
        wanted = [Scope(scope) for scope in scopes.replace(",", " ").split()]
    except ValidationError:
        raise InvalidArgument(
            f"{name!r}: a name has 1 to 64 letters, digits, '.', '_', '@' and '-'", "name"
        ) from None
    except ValueError as error:
        raise InvalidArgument(f"{error}; there are {', '.join(Scope)}", "scopes") from None
    if not wanted:
        raise InvalidArgument(f"a key has one scope at least of {', '.join(Scope)}", "scopes")
    key, digest = new_key()
    listed = ", ".join(f'"{scope}"' for scope in wanted)
    typer.echo(f'[keys."{name}"]\nsha256 = "{digest}"\nscopes = [{listed}]')
    sys.stdout.flush()
    typer.echo(f"\nThe key, shown only now; hand it to {name} safely:\n\n  {key}\n", err=True)
