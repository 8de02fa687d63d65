"""All settings: one frozen, validated value, read only by the composition root (serve.py).

A setting comes from, first wins: the command line; the environment (`WAYFARER_HTTP_PORT=9000`,
nested `WAYFARER_LIMITS__AGENTS=128`); a TOML file (`--config` or `WAYFARER_CONFIG`); its default.
Unknown keys are refused wherever they stand.
"""

import os
import re
import tomllib
from collections.abc import Mapping
from ipaddress import ip_address
from pathlib import Path
from typing import Any, Final, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError
from pydantic_settings import (
    BaseSettings,
    PydanticBaseSettingsSource,
    SettingsConfigDict,
    TomlConfigSettingsSource,
)

from wayfarer.errors import InvalidArgument

PREFIX: Final = "WAYFARER_"
FILE_VARIABLE: Final = PREFIX + "CONFIG"

SERVICE_LINK: Final = re.compile(PREFIX + r"(SERVICE_HOST|SERVICE_PORT(_.+)?|PORT(_\d+_.+)?)")
"""Variables that Kubernetes sets in every pod beside a service named wayfarer."""


class Limits(BaseModel):
    """What a client may ask for; reported by GetServerInfo."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    agents_per_call: int = Field(
        default=64, ge=1, le=1024, description="agents in one CreateAgents call"
    )
    agents_per_session: int = Field(default=64, ge=1, description="agents of one session")
    agents: int = Field(default=256, ge=1, description="agents on the server")
    sessions: int = Field(default=64, ge=1, description="sessions on the server")
    streams_per_session: int = Field(default=8, ge=1, description="streams of one session")
    streams: int = Field(default=64, ge=1, description="streams on the server")
    message_bytes: int = Field(default=1 << 20, ge=1024, description="bytes of one request")
    goal_distance_m: float = Field(
        default=1000.0, gt=0, description="metres from an agent to its goal, or from goal to goal"
    )
    lease_s: float = Field(
        default=86_400.0, ge=1, description="longest time a session may outlive its last call"
    )
    path_goals: int = Field(default=256, ge=1, le=1024, description="goals of one path")
    queue_s: float = Field(
        default=0.5, ge=0.2, le=60, description="seconds of motion that wait for a slow reader"
    )
    resume_s: float = Field(
        default=5.0, ge=0, le=60, description="seconds of motion held for streams that resume"
    )
    lead_s: float = Field(
        default=0.5, ge=0.2, le=60, description="seconds sent ahead of an acknowledged playhead"
    )
    clip_s: float = Field(default=120.0, gt=0, le=3600, description="seconds of one clip")
    clips: int = Field(default=2, ge=1, le=64, description="clips and replays made at a time")
    steps_per_call: int = Field(
        default=50, ge=1, le=1000, description="primitives of one StepAgents call"
    )
    log_entries: int = Field(
        default=100_000, ge=1, description="commands of one session that are recorded"
    )
    sessions_per_caller: int = Field(default=32, ge=1, description="sessions of one caller")
    calls_per_second: int = Field(
        default=100, ge=1, description="calls of one caller per second; bursts of twice as many"
    )


class Settings(BaseSettings):
    """Everything that can be set."""

    model_config = SettingsConfigDict(
        frozen=True, extra="forbid", env_prefix=PREFIX, env_nested_delimiter="__"
    )

    host: str = Field(default="127.0.0.1", description="address to listen on")
    http_port: int = Field(
        default=8080, ge=0, le=65535, description="HTTP and WebSocket; 0: any free port"
    )
    grpc_port: int = Field(default=50051, ge=0, le=65535, description="gRPC; 0: any free port")
    model: str = Field(
        default="gamma-anny52", description="motion model: a shipped name or a folder"
    )
    threads: int = Field(default=0, ge=0, le=256, description="threads of the engine; 0: all cores")
    candidates: int = Field(
        default=4, ge=1, le=256, description="candidate primitives tried per step"
    )
    limits: Limits = Limits()
    log_level: Literal["debug", "info", "warning", "error"] = "info"
    log_format: Literal["auto", "text", "json"] = Field(
        default="auto", description="auto: text on a terminal, JSON elsewhere"
    )

    @property
    def is_loopback(self) -> bool:
        """Whether only this machine can reach the server."""
        try:
            return ip_address(self.host).is_loopback
        except ValueError:
            return self.host == "localhost"

    @classmethod
    def settings_customise_sources(
        cls,
        settings_cls: type[BaseSettings],
        init_settings: PydanticBaseSettingsSource,
        env_settings: PydanticBaseSettingsSource,
        dotenv_settings: PydanticBaseSettingsSource,
        file_secret_settings: PydanticBaseSettingsSource,
    ) -> tuple[PydanticBaseSettingsSource, ...]:
        """Command line, environment, file."""
        return init_settings, env_settings, TomlConfigSettingsSource(settings_cls)


def load(command_line: Mapping[str, Any], file: Path | None = None) -> Settings:
    """Settings from all sources; `command_line` holds only what was given there.

    Raises InvalidArgument that names the key, what is wrong with it, and where it may stand.
    """
    _refuse_unknown_variables()
    if file is None and (named := os.environ.get(FILE_VARIABLE)):
        file = Path(named)
    if file is not None and not file.is_file():
        raise InvalidArgument(f"there is no settings file {file}", "config")

    class FileSettings(Settings):
        model_config = SettingsConfigDict(toml_file=file)

    try:
        return FileSettings(**command_line)
    except tomllib.TOMLDecodeError as error:
        raise InvalidArgument(f"{file} is not TOML: {error}", "config") from None
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        key = ".".join(str(part) for part in first["loc"])
        known = _keys(Settings, ".")
        what = (
            f"unknown; known are {', '.join(known)}"
            if first["type"] == "extra_forbidden"
            else f"{first['msg']} (got {first['input']!r})"
        )
        raise InvalidArgument(f"setting {key}: {what}", key) from None


def _refuse_unknown_variables() -> None:
    """pydantic-settings ignores variables that it does not know; a typing error must not pass."""
    known = {PREFIX + key.upper() for key in _keys(Settings, "__")} | {FILE_VARIABLE}
    known.add(PREFIX + "LIMITS")
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


def _keys(model: type[BaseModel], separator: str) -> list[str]:
    """Names of all settings, nested ones joined."""
    keys: list[str] = []
    for name, field in model.model_fields.items():
        if isinstance(field.annotation, type) and issubclass(field.annotation, BaseModel):
            keys += [name + separator + inner for inner in _keys(field.annotation, separator)]
        else:
            keys.append(name)
    return keys
