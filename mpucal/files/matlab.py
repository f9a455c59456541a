"""Arrays of a MATLAB file of level 5, as written by `save(NAME, '-v7')` or `'-v6'` (MAT-File Format, MathWorks).

SciPy's reader crashes the interpreter on damaged files. This one reads arrays of numbers, structures of them, and cells
of texts. The contents of objects, such as timetables, stand in a form that MathWorks does not describe: they are
named. Files of `'-v7.3'` are HDF5, which h5py reads.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import RecordingError
from ..strict_json import DEEPEST
from .reading import allowed_bytes, check_size, first_bytes, import_extra

HEAD = 128
MATLAB = b"MATLAB"
# plain, and below a head of MATLAB's
HDF5 = b"\x89HDF", b"MATLAB 7.3"
ORDERS = {b"IM": "<", b"MI": ">"}
# data types of elements, and classes of arrays
MATRIX, COMPRESSED = 14, 15
DTYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
# of letters in UTF-8, UTF-16 and UTF-32
DTYPES |= {16: "u1", 17: "u2", 18: "u4"}
CELLS, STRUCTURE, LETTERS, NUMBERS, OBJECT = 1, 2, 4, range(6, 16), 17
# class of an object that holds columns -> the command of MATLAB that writes it as a table of text
EXPORTS = {
    "timetable": "writetimetable({0}, '{0}.csv')",
    "table": "writetable({0}, '{0}.csv')",
    "timeseries": "writetimetable(timeseries2timetable({0}), '{0}.csv')",
}


def is_matlab(path: Path) -> bool:
    """Return True if a file begins as one of MATLAB."""
    return first_bytes(path, HEAD).startswith((MATLAB, *HDF5))


def read_matlab_arrays(path: Path) -> Iterator[tuple[str, NDArray[Any]]]:
    """Yield name and array; an array in a structure is `name.field`.

    Raises
    ------
    RecordingError : it holds objects alone, or h5py is not installed. ValueError, zlib.error : it is not a whole file.
    """
    if first_bytes(path, HEAD).startswith(HDF5):
        yield from _without_objects(_hdf5_arrays(path), path)
        return
    data = memoryview(path.read_bytes())
    order = ORDERS.get(bytes(data[HEAD - 2 : HEAD]))
    if order is None:
        raise ValueError("it does not begin as a file of MATLAB 5 or later")
    found = [each for matrix in _matrices(data[HEAD:], order) for each in _arrays(*_matrix(matrix, order))]
    yield from _without_objects(found, path)


def _without_objects(found: Iterable[tuple[str, Any]], path: Path) -> Iterator[tuple[str, NDArray[Any]]]:
    """Yield the arrays among arrays and objects.

    Raises
    ------
    RecordingError : there is none of numbers but objects; the message has the commands of MATLAB that export them.
    """
    objects: dict[str, str] = {}
    columns = False
    for name, value in found:
        if isinstance(value, _Object):
            objects[name] = value.kind
        else:
            columns |= value.size > 1 and value.dtype.kind in "iuf"
            yield name, value
    exports = [EXPORTS[kind].format(name) for name, kind in objects.items() if name and kind in EXPORTS]
    if exports and not columns:
        held = ", ".join(f"{name} is a {kind}" for name, kind in objects.items() if kind in EXPORTS)
        these = "the folder of these files" if len(exports) > 1 else "that file"
        raise RecordingError(
            f"{path.name} holds objects, which only MATLAB can read ({held})",
            f"in MATLAB, run `load {path.name}; {'; '.join(exports)}`, and give {these}",
        )


def _hdf5_arrays(path: Path) -> Iterator[tuple[str, Any]]:
    h5py = import_extra("h5py", "matlab", path)
    names: list[str] = []
    try:
        # of a file object of Python, HDF5 would call it again after the interpreter's end, if the file is damaged
        with h5py.File(path, "r", locking=False) as file:
            file.visit(names.append)
            for name in names:
                item = file[name]
                if "MATLAB_object_decode" in item.attrs:
                    yield name.replace("/", "."), _Object(bytes(item.attrs["MATLAB_class"]).decode())
                elif isinstance(item, h5py.Dataset) and item.dtype.kind in "iuf" and item.ndim in (1, 2):
                    check_size(path, item.size * item.dtype.itemsize)
                    # MATLAB stores by columns
                    yield name.replace("/", "."), item[()].T
    except (OSError, RuntimeError, KeyError, TypeError) as error:
        raise ValueError(f"h5py: {error}") from error


def _matrices(data: memoryview, order: str) -> Iterator[memoryview]:
    for kind, element in _elements(data, order):
        if kind == COMPRESSED:
            yield from _matrices(memoryview(zlib.decompressobj().decompress(element, allowed_bytes())), order)
        elif kind == MATRIX:
            yield element


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


@dataclass(frozen=True)
class _Object:
    """An object of MATLAB, by the name of its class."""

    kind: str


def _matrix(data: memoryview, order: str, depth: int = 0) -> tuple[str, Any]:
    """Return the name and the value of a matrix: an array, a dict of fields, or an object; None of any other."""
    parts = list(_elements(data, order))
    if len(parts) < 3 or depth > DEEPEST or len(parts[0][1]) < 4:
        return "", None

    of = struct.unpack_from(f"{order}I", parts[0][1])[0] & 0xFF
    if of == OBJECT:
        return _text(parts[1][1]), _Object(_text(parts[3][1])) if len(parts) > 3 else None
    name, shape = _text(parts[2][1]), _numbers(*parts[1], order).tolist()
    if not 0 < len(shape) <= DEEPEST or min(shape) < 0:
        raise ValueError("an array has no shape")
    if of in NUMBERS and len(parts) > 3:
        found = _numbers(*parts[3], order)
        if len(found) != prod(shape):
            raise ValueError(f"{name} holds {len(found)} numbers")
        return name, found.reshape(shape, order="F")
    if of == LETTERS and len(parts) > 3:
        return name, "".join(map(chr, _numbers(*parts[3], order).tolist()))
    if of == CELLS:
        return name, [_matrix(part, order, depth + 1)[1] for kind, part in parts[3:] if kind == MATRIX]
    if of == STRUCTURE and prod(shape) == 1 and len(parts) > 4:
        length = max(int(_numbers(*parts[3], order)[0]), 1)
        names = bytes(parts[4][1])
        fields = [_text(names[at : at + length].partition(b"\0")[0]) for at in range(0, len(names), length)]
        values = [_matrix(part, order, depth + 1)[1] if kind == MATRIX else None for kind, part in parts[5:]]
        return name, dict(zip(fields, values, strict=False))
    return name, None


def _arrays(name: str, value: Any) -> Iterator[tuple[str, Any]]:
    """Yield the arrays and objects in a value, under their names."""
    if name and isinstance(value, np.ndarray | _Object):
        yield name, value
    elif isinstance(value, list) and value and all(isinstance(each, str) for each in value):
        yield name, np.array(value)
    elif isinstance(value, dict):
        for field, each in value.items():
            yield from _arrays(f"{name}.{field}", each)


def _text(data: bytes | memoryview) -> str:
    return bytes(data).decode("ascii", "replace")


def _numbers(kind: int, data: memoryview, order: str) -> NDArray[Any]:
    if kind not in DTYPES:
        raise ValueError(f"it holds numbers of the type {kind}")
    return np.frombuffer(data, f"{order}{DTYPES[kind]}")
