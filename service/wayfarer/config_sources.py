"""Where settings come from: read from all sources, named, and told by their origin."""

import os
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo
from pydantic_settings import EnvSettingsSource, SettingsConfigDict, TomlConfigSettingsSource

from wayfarer.config import PREFIX, Settings
from wayfarer.errors import InvalidArgument

FILE_VARIABLE: Final = PREFIX + "CONFIG"
SERVICE_LINK: Final = re.compile(PREFIX + r"(SERVICE_HOST|SERVICE_PORT(_.+)?|PORT(_\d+_.+)?)")
"""Variables that Kubernetes sets in every pod beside a service named wayfarer."""


def load(command_line: Mapping[str, Any], file: Path | None = None) -> Settings:
    """Settings from all sources; `command_line` holds only what was given there.

    Raises InvalidArgument that names the key, what is wrong with it, and where it may stand.
    """
    _refuse_unknown_variables()
    file = settings_file(file)
    try:
        return _from(file)(**command_line)
    except tomllib.TOMLDecodeError as error:
        raise InvalidArgument(f"{file} is not TOML: {error}", "config") from None
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        key = ".".join(str(part) for part in first["loc"])
        if first["type"] == "extra_forbidden":
            what = f"unknown; known are {', '.join(keys())}"
        elif "error" in first.get("ctx", {}):  # raised by a check of ours
            what = str(first["ctx"]["error"])
        else:
            what = f"{first['msg']} (got {first['input']!r})"
        raise InvalidArgument(f"setting {key}: {what}" if key else what, key) from None


def settings_file(named: Path | None = None) -> Path | None:
    """The file that is read: `named`, or that of the environment. Raises InvalidArgument."""
    if named is None and (variable := os.environ.get(FILE_VARIABLE)):
        named = Path(variable)
    if named is not None and not named.is_file():
        raise InvalidArgument(f"there is no settings file {named}", "config")
    return named


def origins(command_line: Mapping[str, Any], file: Path | None = None) -> dict[str, str]:
    """Where each setting that `load` would give comes from, by dotted key."""
    file = settings_file(file)
    sources = {
        "command line": dict(command_line),
        "environment": EnvSettingsSource(Settings)(),
        str(file): TomlConfigSettingsSource(Settings, file)() if file else {},
    }
    return {
        key: next((name for name, values in sources.items() if _holds(values, key)), "default")
        for key in keys()
    }


def keys(model: type[BaseModel] | None = None, separator: str = ".") -> list[str]:
    """Names of all settings, nested ones joined."""
    found: list[str] = []
    for name, field in (model or Settings).model_fields.items():
        if isinstance(field.annotation, type) and issubclass(field.annotation, BaseModel):
            found += [name + separator + inner for inner in keys(field.annotation, separator)]
        else:
            found.append(name)
    return found


def field_of(key: str) -> FieldInfo:
    """Of a setting."""
    group, _, name = key.rpartition(".")
    if not group:
        return Settings.model_fields[name]
    model: Any = Settings.model_fields[group].annotation
    found: FieldInfo = model.model_fields[name]
    return found


def variable(key: str) -> str:
    """Name of a setting in the environment."""
    return PREFIX + key.replace(".", "__").upper()


def _from(file: Path | None) -> type[Settings]:
    class FileSettings(Settings):
        model_config = SettingsConfigDict(toml_file=file)

    return FileSettings


def _holds(values: Mapping[str, Any], key: str) -> bool:
    first, _, rest = key.partition(".")
    if first not in values:
        return False
    return not rest or (isinstance(values[first], Mapping) and _holds(values[first], rest))


def _refuse_unknown_variables() -> None:
    """pydantic-settings ignores variables that it does not know; a typing error must not pass."""
    known = {variable(key) for key in keys()} | {FILE_VARIABLE}
    known |= {variable(key.partition(".")[0]) for key in keys() if "." in key}  # whole, as JSON
    unknown = sorted(
        key
        for key in os.environ
        if key.startswith(PREFIX) and key not in known and not SERVICE_LINK.fullmatch(key)
    )
    if unknown:
        raise InvalidArgument(
            f"unknown setting {', '.join(unknown)} in the environment; "
            f"known are {', '.join(sorted(known))}",
            unknown[0],
        )
