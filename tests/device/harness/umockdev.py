"""Part of libumockdev by ctypes: a test bed with a device node whose ioctls are answered here.

It knows no I2C. The structures that an ioctl's argument points to are read from and written to the calling process.
"""

from __future__ import annotations

import ctypes
import ctypes.util
from collections.abc import Callable

Answer = Callable[["Memory", int, int], int]

_POINTER, _SIZE, _LONG, _INT, _TEXT = (
    ctypes.c_void_p,
    ctypes.c_uint64,
    ctypes.c_long,
    ctypes.c_int,
    ctypes.c_char_p,
)
_HANDLER = ctypes.CFUNCTYPE(_INT, _POINTER, _POINTER, _POINTER)

# name: result, arguments; libumockdev 0.17, src/umockdev-ioctl.vala and src/umockdev.vala
_FUNCTIONS = {
    "umockdev_testbed_new": (_POINTER,),
    "umockdev_testbed_get_root_dir": (_TEXT, _POINTER),
    "umockdev_testbed_add_from_string": (_INT, _POINTER, _TEXT, _POINTER),
    "umockdev_testbed_attach_ioctl": (_INT, _POINTER, _TEXT, _POINTER, _POINTER),
    "umockdev_ioctl_base_new": (_POINTER,),
    "umockdev_ioctl_client_get_request": (ctypes.c_ulong, _POINTER),
    "umockdev_ioctl_client_get_arg": (_POINTER, _POINTER),
    "umockdev_ioctl_client_complete": (None, _POINTER, _LONG, _INT),
    "umockdev_ioctl_data_resolve": (_POINTER, _POINTER, _SIZE, _SIZE, _POINTER),
    "umockdev_ioctl_data_retrieve": (None, _POINTER, ctypes.POINTER(_POINTER), ctypes.POINTER(_INT)),
    "umockdev_ioctl_data_update": (None, _POINTER, _SIZE, ctypes.c_char_p, _INT),
}


def _load() -> tuple[ctypes.CDLL, ctypes.CDLL]:
    library = ctypes.CDLL("libumockdev.so.0")
    for name, (result, *arguments) in _FUNCTIONS.items():
        function = getattr(library, name)
        function.restype, function.argtypes = result, arguments
    glib = ctypes.CDLL("libgobject-2.0.so.0")
    glib.g_signal_connect_data.restype = ctypes.c_ulong
    glib.g_signal_connect_data.argtypes = [_POINTER, _TEXT, _HANDLER, _POINTER, _POINTER, _INT]
    glib.g_object_unref.argtypes = glib.g_free.argtypes = [_POINTER]
    return library, glib


class Memory:
    """Part of the calling process's memory that an ioctl's argument points to."""

    def __init__(self, library: ctypes.CDLL, glib: ctypes.CDLL, data: int) -> None:
        self._library, self._glib, self._data = library, glib, data

    def at(self, offset: int, size: int) -> Memory | None:
        """Return the `size` bytes to which the pointer at `offset` points; None if it is null."""
        data = self._library.umockdev_ioctl_data_resolve(self._data, offset, size, None)
        if not data:
            return None
        # the owner of the pointer keeps a reference to the target
        self._glib.g_object_unref(data)
        return Memory(self._library, self._glib, data)

    def bytes(self) -> bytes:
        """Return the bytes."""
        data, size = _POINTER(), _INT()
        self._library.umockdev_ioctl_data_retrieve(self._data, ctypes.byref(data), ctypes.byref(size))
        try:
            return ctypes.string_at(data, size.value)
        finally:
            self._glib.g_free(data)

    def write(self, data: bytes, offset: int = 0) -> None:
        """Write `data` from `offset` on, for the caller when its ioctl returns."""
        self._library.umockdev_ioctl_data_update(self._data, offset, data, len(data))


class Testbed:
    """Folder that replaces /dev and /sys for programs with libumockdev-preload.so.0 and UMOCKDEV_DIR."""

    def __init__(self) -> None:
        self._library, self._glib = _load()
        self._testbed = self._library.umockdev_testbed_new()
        self._handlers: list[object] = []

    @property
    def folder(self) -> str:
        """Value of UMOCKDEV_DIR."""
        return self._library.umockdev_testbed_get_root_dir(self._testbed).decode()

    def add(self, description: str) -> None:
        """Add devices in the format of `umockdev-record`."""
        if not self._library.umockdev_testbed_add_from_string(self._testbed, description.encode(), None):
            raise ValueError(f"libumockdev does not understand {description!r}")

    def attach(self, node: str, answer: Answer) -> None:
        """Answer the ioctls of `node` by `answer(memory, request, value)`: 0, or an errno.

        memory : target of the argument if it is a pointer. value : the argument itself.
        """

        def handle(_handler: int, client: int, _data: int) -> int:
            library = self._library
            request = library.umockdev_ioctl_client_get_request(client)
            argument = Memory(library, self._glib, library.umockdev_ioctl_client_get_arg(client))
            error = answer(argument, request, int.from_bytes(argument.bytes(), "little"))
            library.umockdev_ioctl_client_complete(client, -1 if error else 0, error)
            return 1

        base, callback = self._library.umockdev_ioctl_base_new(), _HANDLER(handle)
        self._handlers += [base, callback]
        self._glib.g_signal_connect_data(base, b"handle-ioctl", callback, None, None, 0)
        self._library.umockdev_testbed_attach_ioctl(self._testbed, node.encode(), base, None)
