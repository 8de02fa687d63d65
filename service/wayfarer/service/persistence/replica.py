"""A session's copy for when its server dies: its snapshot and, if it has one, its crowd; of a
recorded one also what is new in its log (log_copy.py).

A session without a crowd is copied as the snapshot that it is. Between servers only.
"""

from dataclasses import dataclass
from typing import Final

from pydantic import BaseModel, ConfigDict

from wayfarer.limits import Limits
from wayfarer.service.persistence.container import ContainerKind, seal, unseal
from wayfarer.service.persistence.record import UNCOPIED, LogMark
from wayfarer.service.persistence.snapshot import most_bytes, parse
from wayfarer.world.scenes.populate import CrowdPeople

STORED: Final = 0  # zlib's level: the snapshot has been compressed


@dataclass(frozen=True, slots=True)
class Replica:
    """A session, and its log since the replica before."""

    state: bytes
    log_part: bytes = b""  # empty: nothing is new, or it is not recorded
    mark: LogMark = UNCOPIED  # how far its log has come


class _Header(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, ser_json_inf_nan="strings")

    crowd: CrowdPeople


def seal_replica(snapshot: bytes, crowd: CrowdPeople | None) -> bytes:
    """The copy."""
    if crowd is None:
        return snapshot
    header = _Header(crowd=crowd).model_dump_json().encode()
    return seal(ContainerKind.REPLICA, header, snapshot, STORED)


def open_replica(data: bytes, limits: Limits) -> tuple[bytes, CrowdPeople | None]:
    """The snapshot, and the crowd. Raises InvalidArgument, FailedPrecondition."""
    if not data.startswith(ContainerKind.REPLICA.value):
        return data, None
    content = unseal(ContainerKind.REPLICA, data, 2 * most_bytes(limits))
    values = 100 + 4 * limits.agents_per_session
    header = parse(_Header, content.header, ContainerKind.REPLICA, values)
    return content.arrays, header.crowd
