"""The C interface, as ctypes sees it."""

import ctypes as ct
from pathlib import Path

U32, SIZE, TEXT, POINTER = ct.c_uint32, ct.c_size_t, ct.c_char_p, ct.c_void_p
PROGRESS = ct.CFUNCTYPE(ct.c_int, POINTER, ct.c_double)
READ = ct.CFUNCTYPE(ct.c_int64, POINTER, POINTER, SIZE)
MODEL = ct.CFUNCTYPE(ct.c_int, POINTER, TEXT, ct.POINTER(POINTER), ct.POINTER(SIZE))

OK, USAGE, IO, INVALID, UNSUPPORTED, LIMIT, CANCELLED, MEMORY = 0, 2, 3, 4, 5, 6, 7, 8
RGBA8, RGBA16, RGBAF = range(3)


class Structure(ct.Structure):
    """A structure that knows its size."""

    def __init__(self, **values):
        super().__init__(**{"size": ct.sizeof(self), **values})


class Error(Structure):
    _fields_ = (
        ("size", U32),
        ("status", U32),
        ("offset", ct.c_int64),
        ("rule", ct.c_char * 16),
        ("message", ct.c_char * 240),
    )


class Limit(ct.Structure):
    _fields_ = (
        ("name", TEXT),
        ("value", ct.c_uint64),
    )


class Options(Structure):
    _fields_ = (
        ("size", U32),
        ("limit_count", U32),
        ("limits", ct.POINTER(Limit)),
        ("model", MODEL),
        ("model_context", POINTER),
        ("progress", PROGRESS),
        ("progress_context", POINTER),
    )


class Info(Structure):
    _fields_ = (
        ("size", U32),
        ("width", U32),
        ("height", U32),
        ("opaque", U32),
        ("depth", U32),
        ("layers", U32),
        ("metadata", U32),
        ("duration", U32),
        ("fps", U32),
        ("loop", U32),
        ("primaries", U32),
        ("transfer", U32),
    )


class Layer(Structure):
    _fields_ = (
        ("size", U32),
        ("hidden", U32),
        ("moves", U32),
        ("name_bytes", U32),
        ("name", TEXT),
        ("x", ct.c_int32),
        ("y", ct.c_int32),
        ("width", U32),
        ("height", U32),
    )


class Metadata(Structure):
    _fields_ = (
        ("size", U32),
        ("kind", ct.c_char * 12),
        ("count", SIZE),
        ("bytes", POINTER),
    )


class Request(Structure):
    _fields_ = (
        ("size", U32),
        ("format", U32),
        ("x", U32),
        ("y", U32),
        ("region_width", U32),
        ("region_height", U32),
        ("width", U32),
        ("height", U32),
        ("scale", ct.c_double),
        ("moving", U32),
        ("without_background", U32),
        ("time", ct.c_double),
        ("layers", ct.POINTER(U32)),
        ("layer_count", SIZE),
        ("threads", U32),
        ("limit_count", U32),
        ("limits", ct.POINTER(Limit)),
        ("progress", PROGRESS),
        ("progress_context", POINTER),
    )


class Output(Structure):
    _fields_ = (
        ("size", U32),
        ("width", U32),
        ("height", U32),
        ("opaque", U32),
        ("row_bytes", SIZE),
        ("bytes", SIZE),
    )


ARGUMENTS = {
    "pxi_abi": [],
    "pxi_open": [POINTER, SIZE, POINTER, ct.POINTER(POINTER), POINTER],
    "pxi_open_callback": [READ, POINTER, POINTER, ct.POINTER(POINTER), POINTER],
    "pxi_close": [POINTER],
    "pxi_describe": [POINTER, POINTER, POINTER],
    "pxi_describe_layer": [POINTER, U32, POINTER, POINTER],
    "pxi_describe_metadata": [POINTER, U32, POINTER, POINTER],
    "pxi_measure": [POINTER, POINTER, POINTER, POINTER],
    "pxi_latents": [POINTER, U32, POINTER, ct.POINTER(SIZE), POINTER],
    "pxi_render": [POINTER, POINTER, POINTER, SIZE, SIZE, POINTER],
}


def load(build: Path) -> ct.CDLL:
    """The library of a build."""
    library = ct.CDLL(str(build / "libpxi.so"))
    for name, arguments in ARGUMENTS.items():
        getattr(library, name).argtypes = arguments
    return library
