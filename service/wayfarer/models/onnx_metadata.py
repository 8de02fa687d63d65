"""The metadata of an ONNX file, read without opening the graph: onnxruntime takes a hundred times
as long, and serving has no `onnx`.
"""

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any, Final

from google.protobuf import descriptor_pb2, descriptor_pool, message, message_factory

_FIELD: Final = descriptor_pb2.FieldDescriptorProto
METADATA_PROPS: Final = 14
"""Number of `ModelProto.metadata_props` in onnx.proto; its entries are key (1) and value (2)."""


def read_metadata(path: Path) -> Mapping[str, str]:
    """`ModelProto.metadata_props` of a file.

    Raises OSError when it cannot be read, ValueError when it is no ONNX file.
    """
    model = _model_type()()
    try:
        model.ParseFromString(path.read_bytes())
    except message.DecodeError as error:
        raise ValueError(f"not an ONNX file: {error}") from None
    return {entry.key: entry.value for entry in model.metadata_props}


@cache
def _model_type() -> Any:
    """`ModelProto` with that one field: the parser skips unknown fields."""
    file = descriptor_pb2.FileDescriptorProto(
        name="wayfarer/onnx_metadata.proto", package="wayfarer.onnx", syntax="proto2"
    )
    entry = file.message_type.add(name="Entry")
    for number, name in enumerate(("key", "value"), start=1):
        entry.field.add(
            name=name, number=number, type=_FIELD.TYPE_STRING, label=_FIELD.LABEL_OPTIONAL
        )
    file.message_type.add(name="Model").field.add(
        name="metadata_props",
        number=METADATA_PROPS,
        type=_FIELD.TYPE_MESSAGE,
        type_name=".wayfarer.onnx.Entry",
        label=_FIELD.LABEL_REPEATED,
    )
    pool = descriptor_pool.DescriptorPool()
    pool.Add(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName("wayfarer.onnx.Model"))
