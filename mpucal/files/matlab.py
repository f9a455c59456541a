"""Arrays of a MATLAB file of level 5, as written by `save(NAME, '-v7')` or `'-v6'` (MAT-File Format, MathWorks).

SciPy's reader crashes the interpreter on damaged files. This one reads arrays of numbers and structures of them. Files
of `'-v7.3'` are HDF5, which h5py reads.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from io import BytesIO
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .budget import allowed_bytes, check_size
from .reading import import_extra

HEAD = 128
MATLAB, HDF5 = b"MATLAB", b"MATLAB 7.3"
ORDERS = {b"IM": "<", b"MI": ">"}
# data types of elements, and classes of arrays
MATRIX, COMPRESSED = 14, 15
DTYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
STRUCTURE, NUMBERS = 2, range(6, 16)
DEEPEST, MOST_DIMENSIONS = 8, 8


def read_matlab_arrays(content: bytes, path: Path) -> Iterator[tuple[str, NDArray[Any]]]:
    """Yield name and array; an array in a structure is `name.field`.

    Raises
    ------
    RecordingError : h5py is not installed. ValueError, zlib.error : it is not a whole file.
    """
    if content.startswith(HDF5):
        yield from _hdf5_arrays(content, path)
        return
    data = memoryview(content)
    order = ORDERS.get(bytes(data[HEAD - 2 : HEAD]))
    if order is None:
        raise ValueError("it does not begin as a file of MATLAB 5 or later")
    for kind, element in _elements(data[HEAD:], order):
        if kind == COMPRESSED:
            whole = memoryview(zlib.decompressobj().decompress(element, allowed_bytes()))
            for inner, matrix in _elements(whole, order):
                yield from _matrix(matrix, order, "") if inner == MATRIX else ()
        elif kind == MATRIX:
            yield from _matrix(element, order, "")


def _hdf5_arrays(content: bytes, path: Path) -> Iterator[tuple[str, NDArray[Any]]]:
    h5py = import_extra("h5py", "matlab", path)
    names: list[str] = []
    try:
        with h5py.File(BytesIO(content), "r") as file:
            file.visit(names.append)
            for name in names:
                item = file[name]
                if isinstance(item, h5py.Dataset) and item.dtype.kind in "iuf" and item.ndim == 2:
                    check_size(path, item.size * item.dtype.itemsize)
                    # MATLAB stores by columns
                    yield name.replace("/", "."), item[()].T
    except (OSError, RuntimeError, KeyError, TypeError) as error:
        raise ValueError(f"h5py: {error}") from error


def _elements(data: memoryview, order: str) -> Iterator[tuple[int, memoryview]]:
    """Yield the type and the data of each element."""
    at = 0
    while at + 8 <= len(data):
        kind, size = struct.unpack_from(f"{order}II", data, at)
        # up to four bytes of data may be in the tag
        begin = at + 8
        if kind >> 16:
            kind, size, begin = kind & 0xFFFF, kind >> 16, at + 4
        element = data[begin : begin + size]
        if len(element) < size or (begin == at + 4 and size > 4):
            raise ValueError("it is cut short")
        yield kind, element
        at = at + 8 if begin == at + 4 else begin + size + (0 if kind == COMPRESSED else -size % 8)


def _matrix(data: memoryview, order: str, within: str, depth: int = 0) -> Iterator[tuple[str, NDArray[Any]]]:
    """Yield the arrays of a matrix: itself, or those in a structure's fields."""
    parts = list(_elements(data, order))
    if len(parts) < 3 or depth > DEEPEST or len(parts[0][1]) < 4:
        return
    of = struct.unpack_from(f"{order}I", parts[0][1])[0] & 0xFF
    shape = _numbers(*parts[1], order).tolist()
    name = within or bytes(parts[2][1]).decode("ascii", "replace")
    if not 0 < len(shape) <= MOST_DIMENSIONS or min(shape) < 0:
        raise ValueError("an array has no shape")
    if of in NUMBERS and len(parts) > 3 and name:
        values = _numbers(*parts[3], order)
        if len(values) != prod(shape):
            raise ValueError(f"{name} holds {len(values)} numbers")
        yield name, values.reshape(shape, order="F")
    elif of == STRUCTURE and prod(shape) == 1 and len(parts) > 4:
        length = int(_numbers(*parts[3], order)[0])
        names = bytes(parts[4][1])
        fields = [names[at : at + length].partition(b"\0")[0] for at in range(0, len(names), max(length, 1))]
        for field, (kind, element) in zip(fields, parts[5:], strict=False):
            if kind == MATRIX:
                yield from _matrix(element, order, f"{name}.{field.decode('ascii', 'replace')}", depth + 1)


def _numbers(kind: int, data: memoryview, order: str) -> NDArray[Any]:
    if kind not in DTYPES:
        raise ValueError(f"it holds numbers of the type {kind}")
    return np.frombuffer(data, f"{order}{DTYPES[kind]}")
