"""Log lines of this project and of its libraries: text for people, JSON for machines.

Keys and tokens are removed from every line, at any place.
"""

import logging
import re
import sys
from typing import Any, Final

import structlog

HIDDEN: Final = "[hidden]"

SECRET_NAMES: Final = re.compile(
    r"authorization|api[-_]?key|token|secret|password|cookie|sec-websocket-protocol", re.IGNORECASE
)
"""Fields of a line whose values are never shown."""

GRPC: Final = "grpc._cython.cygrpc"
"""Logger of grpcio's core."""

_SECRETS: Final = re.compile(
    r"wf_[\w-]{16,}"  # API keys
    r"|eyJ[\w-]{8,}(?:\.[\w-]*){1,4}"  # JWTs
    r"|(?<=wayfarer\.token\.)[\w-]+"  # either, in a WebSocket's subprotocol
    r"|(?<=bearer )[^\s\"',\\]+"
    r"|(?<=(?:[?&])token=)[^\s&\"'\\]+|(?<=(?:[?&])key=)[^\s&\"'\\]+"
    r"|(?<=api_key=)[^\s&\"'\\]+|(?<=access_token=)[^\s&\"'\\]+"
    r"|(?<=://)[^\s/@\"'\\]+:[^\s/@\"'\\]+(?=@)",  # user and password of a URL
    re.IGNORECASE,
)


def configure_logging(level: str, form: str, **fields: Any) -> None:
    """Sends everything to stderr. `form`: "text", "json", or "auto": text on a terminal.

    `fields` are part of every line.
    """
    as_json = form == "json" or (form == "auto" and not sys.stderr.isatty())
    shared: list[Any] = [
        lambda logger, method, event: {**fields, **event},
        structlog.contextvars.merge_contextvars,
        structlog.processors.add_log_level,
        structlog.processors.TimeStamper(fmt="iso", utc=True),
    ]
    if as_json:
        # Local variables in traces are slow to print and may hold what a log should not.
        traces = structlog.tracebacks.ExceptionDictTransformer(show_locals=False)
        finish: list[Any] = [
            structlog.processors.ExceptionRenderer(traces),
            structlog.processors.JSONRenderer(),
        ]
    else:
        finish = [
            structlog.dev.ConsoleRenderer(
                colors=sys.stderr.isatty(), exception_formatter=structlog.dev.plain_traceback
            )
        ]
    structlog.configure(
        processors=[*shared, structlog.stdlib.ProcessorFormatter.wrap_for_formatter],
        wrapper_class=structlog.make_filtering_bound_logger(logging.getLevelName(level.upper())),
        logger_factory=structlog.stdlib.LoggerFactory(),
        cache_logger_on_first_use=True,
    )
    meta = structlog.stdlib.ProcessorFormatter.remove_processors_meta
    last: list[Any] = [meta, hide_fields, *finish, hide_text]
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(
        structlog.stdlib.ProcessorFormatter(foreign_pre_chain=shared, processors=last)
    )
    handler.addFilter(is_news)
    root = logging.getLogger()
    root.handlers[:] = [handler]
    root.setLevel(level.upper())
    for chatty in ("asyncio", "grpc"):
        logging.getLogger(chatty).setLevel(max(root.level, logging.WARNING))
    logging.getLogger("uvicorn").setLevel(logging.ERROR)  # it warns of every malformed request


def is_news(record: logging.LogRecord) -> bool:
    """Filter without grpcio's trace about a reader that left during a send."""
    return record.name != GRPC or not str(record.msg).startswith("ExecuteBatchError raised in core")


def hide_fields(logger: Any, method: str, event: dict[str, Any]) -> dict[str, Any]:
    """Processor that hides values of fields with secret names."""
    return {
        key: HIDDEN if isinstance(key, str) and SECRET_NAMES.search(key) else value
        for key, value in event.items()
    }


def hide_text(logger: Any, method: str, line: str) -> str:
    """Last processor: removes keys and tokens from a finished line, traces included."""
    return hidden(line)


def hidden(text: str) -> str:
    """A text without the keys, tokens and passwords in it."""
    return _SECRETS.sub(HIDDEN, text)
