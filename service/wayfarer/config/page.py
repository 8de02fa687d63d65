"""Settings as text: their values and sources, their JSON schema, their table."""

import json
from collections.abc import Mapping
from typing import Any

import typer

from wayfarer.config.settings import Settings
from wayfarer.config.sources import fields
from wayfarer.process.logs import hidden

app = typer.Typer(no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False)


@app.callback()
def _group() -> None:
    """Settings of the service."""


@app.command()
def schema() -> None:
    """Print the JSON schema of the settings file, for editors."""
    typer.echo(json.dumps(Settings.model_json_schema(), indent=2))


@app.command()
def table() -> None:
    """Print the settings as a Markdown table, as in docs/operations.md."""
    typer.echo(as_markdown())


def as_markdown() -> str:
    """All settings with their defaults."""
    rows = ["| setting | default | |", "|---|---|---|"]
    for key, field in fields().items():
        default = field.get_default(call_default_factory=True)
        shown = "–" if default in (None, "", ()) else f"`{_plain(default)}`"
        rows.append(f"| `{key}` | {shown} | {field.description} |")
    return "\n".join(rows)


def _plain(value: Any) -> str:
    if isinstance(value, tuple):
        return json.dumps(value)
    return str(value).lower() if isinstance(value, bool) else f"{value}"


def as_toml(settings: Settings, origins: Mapping[str, str]) -> str:
    """A settings file with these values, and the origin of each; passwords are hidden."""
    values = settings.model_dump(mode="json")
    width = max(map(len, origins))
    return "\n".join(
        f"{key:{width}} = {_literal(_at(values, key))}  # {origin}"
        if _at(values, key) is not None
        else f"# {key} is not set"
        for key, origin in origins.items()
    )


def _at(values: Mapping[str, Any], key: str) -> Any:
    found: Any = values
    for part in key.split("."):
        found = found[part]
    return found


def _literal(value: Any) -> str:
    """A value in TOML: numbers, texts, lists and booleans are written as in JSON."""
    return hidden(json.dumps(value, ensure_ascii=False))
