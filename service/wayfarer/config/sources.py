"""Sources of settings: reads them all, and names the origin of each setting."""

import os
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo
from pydantic_settings import EnvSettingsSource, TomlConfigSettingsSource

from wayfarer.config.settings import PREFIX, Settings
from wayfarer.errors import InvalidArgument, unknown_name

FILE_VARIABLE: Final = PREFIX + "CONFIG"
SERVICE_LINK: Final = re.compile(PREFIX + r"(SERVICE_HOST|SERVICE_PORT(_.+)?|PORT(_\d+_.+)?)")
"""Variables that Kubernetes sets in every pod beside a service named wayfarer."""


def load(command_line: Mapping[str, Any], file: Path | None = None) -> Settings:
    """Settings from all sources; `command_line` holds only what was given there.

    Raises InvalidArgument that names every wrong key, a line each, and what is wrong with it.
    """
    wrong = _unknown_variables()
    try:
        given = _sources(command_line, file)
        settings = Settings(**_merged(*given.values()))
    except tomllib.TOMLDecodeError as error:
        wrong.append(("config", f"{settings_file(file)} is not TOML: {error}"))
    except ValidationError as error:
        wrong += [_explained(one) for one in error.errors(include_url=False)]
    if wrong:
        raise InvalidArgument("\n".join(what for _, what in wrong), wrong[0][0])
    return settings


def origins(command_line: Mapping[str, Any], file: Path | None = None) -> dict[str, str]:
    """The source of each setting that `load` would give, by dotted key."""
    given = _sources(command_line, file)
    return {
        key: next((name for name, values in given.items() if _holds(values, key)), "default")
        for key in fields()
    }


def _sources(command_line: Mapping[str, Any], file: Path | None) -> dict[str, dict[str, Any]]:
    """Values of each source, highest precedence first."""
    file = settings_file(file)
    return {
        "command line": dict(command_line),
        "environment": EnvSettingsSource(Settings)(),
        str(file): TomlConfigSettingsSource(Settings, file)() if file else {},
    }


def _merged(*sources: Mapping[str, Any]) -> dict[str, Any]:
    """All values; an earlier source overrides a later one, key by key within a group."""
    found: dict[str, Any] = {}
    for source in reversed(sources):
        for name, value in source.items():
            is_group = isinstance(value, Mapping) and isinstance(found.get(name), Mapping)
            found[name] = {**found[name], **value} if is_group else value
    return found


def _explained(error: Any) -> tuple[str, str]:
    """Key and sentence of an error that pydantic has found."""
    key = ".".join(str(part) for part in error["loc"])
    if error["type"] == "extra_forbidden":
        what = unknown_name(key, list(fields()))
    elif "error" in error.get("ctx", {}):  # raised by a check of ours
        what = str(error["ctx"]["error"])
    else:
        what = f"{error['msg']} (got {error['input']!r})"
    return key, f"setting {key}: {what}" if key else what


def settings_file(named: Path | None = None) -> Path | None:
    """The settings file: `named`, or that of the environment. Raises InvalidArgument."""
    if named is None and (variable := os.environ.get(FILE_VARIABLE)):
        named = Path(variable)
    if named is not None and not named.is_file():
        raise InvalidArgument(f"there is no settings file {named}", "config")
    return named


def fields(model: type[BaseModel] = Settings, group: str = "") -> dict[str, FieldInfo]:
    """All settings by dotted key."""
    found: dict[str, FieldInfo] = {}
    for name, field in model.model_fields.items():
        if isinstance(field.annotation, type) and issubclass(field.annotation, BaseModel):
            found |= fields(field.annotation, f"{name}.")
        else:
            found[group + name] = field
    return found


def variable(key: str) -> str:
    """Name of a setting in the environment."""
    return PREFIX + key.replace(".", "__").upper()


def _holds(values: Mapping[str, Any], key: str) -> bool:
    first, _, rest = key.partition(".")
    if first not in values:
        return False
    return not rest or (isinstance(values[first], Mapping) and _holds(values[first], rest))


def _unknown_variables() -> list[tuple[str, str]]:
    """Names, and a sentence each. pydantic-settings ignores them, but misspelt names must fail."""
    known = {variable(key) for key in (*fields(), *Settings.model_fields)} | {FILE_VARIABLE}
    unknown = sorted(
        key
        for key in os.environ
        if key.startswith(PREFIX) and key not in known and not SERVICE_LINK.fullmatch(key)
    )
    return [
        (key, f"setting {key} in the environment: {unknown_name(key, sorted(known))}")
        for key in unknown
    ]
