"""Where settings come from: read from all sources, named, and told by their origin."""

import os
import re
import tomllib
from collections.abc import Mapping, Sequence
from difflib import get_close_matches
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

    Raises InvalidArgument that names every wrong key, a line each, and what is wrong with it.
    """
    file = settings_file(file)
    wrong = _unknown_variables()
    settings = None
    try:
        settings = _from(file)(**command_line)
    except tomllib.TOMLDecodeError as error:
        wrong.append(("config", f"{file} is not TOML: {error}"))
    except ValidationError as error:
        wrong += [_told(one) for one in error.errors(include_url=False)]
    if settings is None or wrong:
        raise InvalidArgument("\n".join(what for _, what in wrong), wrong[0][0])
    return settings


def _told(error: Any) -> tuple[str, str]:
    """Key, and a sentence, of an error that pydantic has found."""
    key = ".".join(str(part) for part in error["loc"])
    if error["type"] == "extra_forbidden":
        what = _unknown(key, keys())
    elif "error" in error.get("ctx", {}):  # raised by a check of ours
        what = str(error["ctx"]["error"])
    else:
        what = f"{error['msg']} (got {error['input']!r})"
    return key, f"setting {key}: {what}" if key else what


def _unknown(name: str, known: Sequence[str]) -> str:
    """What a name may have been meant to be."""
    meant = get_close_matches(name, known, n=1)
    if meant:
        return f"unknown; did you mean {meant[0]}?"
    return f"unknown; known are {', '.join(known)}"


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


def _unknown_variables() -> list[tuple[str, str]]:
    """Names, and a sentence each. pydantic-settings ignores them; a typing error must not pass."""
    known = {variable(key) for key in keys()} | {FILE_VARIABLE}
    known |= {variable(key.partition(".")[0]) for key in keys() if "." in key}  # whole, as JSON
    unknown = sorted(
        key
        for key in os.environ
        if key.startswith(PREFIX) and key not in known and not SERVICE_LINK.fullmatch(key)
    )
    return [
        (key, f"setting {key} in the environment: {_unknown(key, sorted(known))}")
        for key in unknown
    ]
