"""Columns are declared by annotations, which must mean the same with every release of numpy."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
import pytest
from numpy.typing import NDArray

from wayfarer.world.rows import (
    Double,
    Flags,
    Float,
    Int,
    Int8,
    Int16,
    Object,
    Rows,
    Shape,
    UInt8,
    UInt64,
    flat_columns,
)


@dataclass(slots=True)
class Inner(Rows):
    speed: Float
    place: Annotated[Float, Shape(2, 3)]


@dataclass(slots=True)
class Outer(Rows):
    given: Flags
    inner: Inner
    mode: Annotated[Int8, Shape(4)]


def test_columns_are_read_from_the_annotations():
    assert list(flat_columns(Outer)) == [
        ("given", np.dtype(bool), ()),
        ("inner.speed", np.dtype(np.float32), ()),
        ("inner.place", np.dtype(np.float32), (2, 3)),
        ("mode", np.dtype(np.int8), (4,)),
    ]


def test_empty_columns_have_the_declared_dtypes_and_shapes():
    rows = Outer.empty(5)
    assert (rows.given.dtype, rows.given.shape) == (np.dtype(bool), (5,))
    assert (rows.inner.place.dtype, rows.inner.place.shape) == (np.dtype(np.float32), (5, 2, 3))
    assert (rows.mode.dtype, rows.mode.shape) == (np.dtype(np.int8), (5, 4))


def test_join_take_put_and_grow_keep_dtypes():
    rows = Outer.join([Outer.empty(1), Outer.empty(2)])
    rows.inner.speed[:] = [1, 2, 3]
    rows.put(np.array([0]), rows.take(np.array([2])))
    rows.grow(4)
    assert rows.inner.speed.tolist() == [3, 2, 3, 0]
    assert rows.mode.shape == (4, 4) and rows.mode.dtype == np.int8


@pytest.mark.parametrize(
    ("kind", "dtype"),
    [
        (Flags, "bool"),
        (Float, "float32"),
        (Double, "float64"),
        (Int, "int64"),
        (Int8, "int8"),
        (Int16, "int16"),
        (UInt8, "uint8"),
        (UInt64, "uint64"),
        (Object, "object"),
    ],
)
def test_every_column_type_names_its_dtype(kind, dtype):
    @dataclass(slots=True)
    class One(Rows):
        values: kind

    assert [column.dtype for column in flat_columns(One)] == [np.dtype(dtype)]
    assert One.empty(2).values.dtype == dtype


@pytest.mark.parametrize("hint", [NDArray[np.float32], np.ndarray, int])
def test_an_annotation_that_names_no_dtype_is_refused_with_the_column_and_what_is_allowed(hint):
    @dataclass(slots=True)
    class Wrong(Rows):
        given: Flags
        speed: hint

    with pytest.raises(TypeError, match=r"Wrong\.speed is no column.*`Float`"):
        Wrong.empty(1)
