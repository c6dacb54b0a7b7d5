"""Files of up to 2^20 bytes that ask for as much as they may, and what it costs to read them.

    python -m fuzz.bombs [NAME ...] [--numpy]

prints for each the seconds of processor time and the peak of memory that it takes to open it (with
all that is decoded, short of planes), to check it (`pxi-validate`), and to draw 256 pixels.
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import msgpack
import numpy as np
import zstandard

from proxyimg_codec import from_bytes
from proxyimg_codec.container import file, texr, undo
from proxyimg_codec.container.chunks import Chunk, write
from proxyimg_codec.container.content import Container
from proxyimg_codec.entropy import arrays
from proxyimg_codec.errors import PxiError
from proxyimg_codec.geometry import deltas
from proxyimg_codec.geometry.connectivity import BORDER, NEW, RANKED, Border
from proxyimg_codec.geometry.mesh import Base, Mesh
from proxyimg_codec.texture import planes
from proxyimg_codec.texture.latents import Latents
from proxyimg_codec.texture.pyramid import PyramidTexture
from proxyimg_codec.validation import validate

Values = dict[str, Any]
BOMBS: dict[str, Callable[[], bytes]] = {}

SECONDS, BYTES = 300, 12 << 30
"""Most processor time in seconds, and most memory in bytes, that a measurement may take."""


def bomb(build: Callable[[], bytes]) -> Callable[[], bytes]:
    """Registers a builder of a file under its own name."""
    BOMBS[build.__name__] = build
    return build


def zeros(channels: int, rows: int, columns: int, bits: int = 4) -> bytes:
    """Coded array of zeros; the adaptive model soon codes each in next to no bits."""
    values = np.zeros((channels, rows, columns), np.int8)
    return arrays.encode(values, bits, np.ones((rows, columns), bool))


def lonely(rows: int, columns: int) -> bytes:
    """Coded array of bits of which only the first is set."""
    values = np.zeros((1, rows, columns), np.int8)
    values[0, 0, 0] = 1
    return arrays.encode(values, 1, np.ones((rows, columns), bool))


def layer(number: int = 0, **values: Any) -> Values:
    """Fields of a LAYR that covers the canvas."""
    plain = {"box": [0, 0, 256, 256], "sampling": 0, "unit": 0, "segments": [], "classes": b"",
             "deltas": b""}  # fmt: skip
    return {"name": str(number), **plain, **values}


def outlined(number: int, count: int, size: int = 256) -> Values:
    """Fields of a LAYR whose boundary has `count` segments that cross the canvas."""
    points = np.zeros((count, 6), np.int64)
    points[0::2, ::2], points[1::2, ::2] = size // 3, -(size // 3)
    points[0::2, 1::2], points[1::2, 1::2] = size // 3, -(size // 3)
    classes, raw = deltas.encode(points.T)
    return layer(number, segments=[count], classes=classes, deltas=raw)


def network(hidden: int = 4, depth: int = 1, dim: int = 1) -> Values:
    """Fields of a NETW whose weights take as few bytes as possible."""
    sizes = [dim, *[hidden] * depth, 3]
    weights = b""
    for inputs, outputs in pairwise(sizes):
        coded = zeros(1, outputs, inputs, 2)
        weights += len(coded).to_bytes(4, "little") + coded
    rows = sum(sizes[1:])
    return {
        "dim": dim, "octaves": 0, "hidden": hidden, "depth": depth, "channels": 3, "bits": 2,
        "steps": b"\0\x3c" * rows, "biases": bytes(2 * rows), "weights": weights,
    }  # fmt: skip


def codes(columns: int = 2, rows: int = 2, data: bytes = b"", stored: bytes = b"") -> Values:
    """Fields of a TEXR with codes."""
    data = data or zeros(1, rows, columns)
    return {"coder": 1, "network": 0, "grid": [columns, rows], "bits": 4, "steps": b"\0\x3c",
            "stored": stored, "codes": data}  # fmt: skip


def plan(columns: int, rows: int, levels: int = 3, data: bytes = b"") -> Values:
    """Fields of a PLAN whose latents are all certain, so that they take no bytes."""
    return {
        "model": 1, "size": [columns, rows], "components": 3, "step": 512, "levels": levels,
        "grey": 0, "lowest": [0, 0, 0], "shifts": [0, 0] * levels, "cell": 8, "support": b"",
        "tile": 0, "details": [], "escapes": b"",
        "data": data or b"\0" + (1 << 16).to_bytes(4, "little") + bytes(4),
    }  # fmt: skip


def view(columns: int, rows: int, planes: int = 0, **values: Any) -> Values:
    """Fields of a TEXR that shows planes."""
    plain = {"alpha": 0, "part": [0, 0, columns, rows], "cell": 0, "mask": b"", "cuts": []}
    return {"coder": 2, "planes": planes, **plain, **texr.ABSENT, **values}


def made(
    layers: Sequence[Values], textures: Sequence[Values], networks: Sequence[Values] = (),
    size: int = 256, **more: Any,
) -> bytes:  # fmt: skip
    """Bytes of a file."""
    channels = 4 if any(texture.get("matte") for texture in textures) else 3
    head = {"size": [size, size], "channels": channels, "opaque": 0, "depth": 8}
    head |= {"layers": len(layers), "networks": len(networks)}
    return file.serialize(Container(head, tuple(layers), tuple(networks), tuple(textures), **more))


def meshed(base: Base, levels: int = 0, number: int = 0) -> Values:
    """Fields of a MESH whose triangles are all split `levels` times."""
    mesh = Mesh.build(base)
    count = len(base.triangles)
    mesh = mesh.split([np.ones(count << 2 * k, bool) for k in range(levels)])
    return {"layer": number, **mesh.fields}


def grid(columns: int, rows: int) -> Base:
    """Base mesh of squares of two triangles each."""
    step = (256 * 1024 // 255 // 16 * 16,) * 2
    x, y = np.meshgrid(np.arange(columns + 1), np.arange(rows + 1))
    points = np.stack([x.ravel() * (255 // columns), y.ravel() * (255 // rows)], 1)
    a = (np.arange(rows)[:, None] * (columns + 1) + np.arange(columns)).ravel()
    b, c, d = a + 1, a + columns + 1, a + columns + 2
    triangles = np.stack([a, b, c, b, d, c], 1).reshape(-1, 3)
    return Base((0, 0), step, points.astype(np.uint8), triangles.astype(np.int32))


def plain(**more: Any) -> bytes:
    """Bytes of a file of one small layer, and of other chunks."""
    return made([layer()], [codes()], [network()], **more)


# Parts that are read before anything is decoded.


@bomb
def chunks() -> bytes:
    """File of as many chunks as are allowed."""
    return plain(extra=(Chunk("abCd", b""),) * ((1 << 16) - 5))


@bomb
def blocks() -> bytes:
    """Three metadata blocks that together hold almost 192 MiB when decompressed."""
    block = bytes((1 << 26) - 1)
    return plain(blocks={"icc": block, "exif": block, "xmp": block})


@bomb
def window() -> bytes:
    """Metadata blocks with as large a window as is allowed."""
    parameters = zstandard.ZstdCompressionParameters(window_log=27, compression_level=1)
    compressor = zstandard.ZstdCompressor(compression_params=parameters).compressobj()
    frame = compressor.compress(b"a") + compressor.flush()
    payload = msgpack.packb([1, frame])
    return plain(extra=tuple(Chunk(t, payload) for t in ("iCCp", "eXIf", "xMPd")))


def _history(content: bytes) -> bytes:
    """Bytes of a small file with a history."""
    chunks = file.present(file.parse(plain()))
    frame = zstandard.ZstdCompressor(level=9).compress(content)
    own = msgpack.packb([undo.digest(chunks), len(content), frame])
    return write([*chunks, Chunk("uNDO", own), Chunk("TAIL", b"")])


@bomb
def history_arrays() -> bytes:
    """History of 60 million empty arrays."""
    return _history(b"\x92\xdc\0\x3c" + (b"\xdd\0\x0f\xff\xff" + b"\x90" * 0xFFFFF) * 60 + b"\x90")


@bomb
def history_numbers() -> bytes:
    """History of 60 million numbers."""
    return _history(b"\x92\x90\xdc\0\x3c" + (b"\x92\xa0\xdd\0\x0f\xff\xff" + b"\0" * 0xFFFFF) * 60)


@bomb
def history_states() -> bytes:
    """History with as many references to chunks as are allowed."""
    steps = [["", [0] * 256] for _ in range(4096)]
    return _history(msgpack.packb([[], steps]))


@bomb
def history_chunks() -> bytes:
    """History of large chunks, all of which must be parsed to go back."""
    kept = [["TEXR", msgpack.packb([1, bytes(1000)])] for _ in range(60000)]
    return _history(msgpack.packb([kept, [["", [7]]]]))


@bomb
def arrays_in_payload() -> bytes:
    """Chunk of a megabyte of empty arrays."""
    payload = b"\x93" + (b"\xdd\0\x05\0\0" + b"\x90" * 0x50000) * 3
    return plain(extra=(Chunk("tREE", payload),))


@bomb
def numbers_in_payload() -> bytes:
    """Chunk of many numbers."""
    more = msgpack.packb(["", "", [300] * 330_000])
    return plain(extra=(Chunk("iNFO", more),))


@bomb
def tree() -> bytes:
    """Chain of groups, each in the next."""
    count = 100_000
    names = [f"{k:x}g" for k in range(count)]
    parents = [2, *range(3, count + 2), 0]
    return plain(tree={"groups": names, "parents": parents})


# Shapes.


@bomb
def segments() -> bytes:
    """One boundary of as many segments as are allowed."""
    return made([outlined(0, (1 << 16) - 2)], [codes()], [network()])


@bomb
def long_segments() -> bytes:
    """One boundary of as many segments on a huge canvas."""
    return made([outlined(0, 1 << 16, 1 << 20)], [codes()], [network()], size=1 << 20)


@bomb
def layers() -> bytes:
    """As many layers as are allowed, which together have as many segments as are allowed."""
    return made(
        [outlined(k, 64) for k in range(1024)],
        [codes(), *[{"coder": 0, "texture": 0}] * 1023],
        [network()],
    )


@bomb
def gates() -> bytes:
    """Mesh whose gates are all open at once, and are closed with vertices of high rank."""
    count, total = 10_500, 1 << 15
    border = Border(count)
    symbols, places = [NEW] * 3, [(100, 100), (10, 0), (0, 10)]
    corners = [border.add(100, 100), border.add(110, 100), border.add(110, 110)]
    border.place_triangle(*corners)
    rng = np.random.default_rng(1)
    while (gate := border.next_gate()) is not None:
        (a, b), near = gate
        if len(symbols) == total:
            break
        expected = border.predicted((a, b), near)
        if border.known < count:
            # A new vertex must lie on the far side of the gate, seen from `near`.
            (ax, ay), (bx, by) = border.at(a), border.at(b)
            some = rng.integers(0, 256, (200, 2)).tolist()
            good = [p for p in some if (ax - bx) * (p[1] - by) > (ay - by) * (p[0] - bx)]
            if not good:
                symbols.append(BORDER)
                continue
            (x, y), *_ = good
            border.place_triangle(b, a, border.add(x, y))
            places.append((_wrap(x - expected[0]), _wrap(y - expected[1])))
            symbols.append(NEW)
            continue
        for rank, vertex in enumerate(border.ranked((a, b), near)[:13]):
            if border.place_triangle(b, a, int(vertex)):
                symbols.append(RANKED + rank)
                break
        else:
            symbols.append(BORDER)
    return _connected(symbols, places)


def _wrap(value: int) -> int:
    """Residual of a coordinate, modulo 256, in -128..127."""
    return (value + 128) % 256 - 128


def _connected(symbols: list[int], places: list[tuple[int, int]]) -> bytes:
    """Bytes of a file with a mesh of given symbols and residuals."""
    classes, raw = deltas.encode(np.array(places, np.int64).T)
    stored = np.ones((1, len(symbols)), bool)
    mesh = {
        "layer": 0, "origin": [0, 0], "step": [1024, 1024], "vertices": len(places),
        "gates": len(symbols), "symbols": arrays.encode(np.array(symbols)[None, None], 4, stored),
        "far": [], "classes": classes, "deltas": raw, "levels": 0, "splits": b"",
    }  # fmt: skip
    return made([layer()], [codes()], [network()], meshes=(mesh,), poses=(bent(0, 1),))


def bent(number: int, nodes: int) -> Values:
    """Fields of a POSE that displaces the first of `nodes` nodes."""
    values = np.zeros((2, 1, nodes), np.int64)
    values[0, 0, 0] = 16
    classes, raw = deltas.encode(values)
    return {
        "layer": number, "matrix": [1 << 24, 0, 0, 1 << 24], "shift": [0, 0], "opacity": 65535,
        "hidden": 0, "colour": [], "node_classes": classes, "node_deltas": raw,
        "place_classes": b"", "place_deltas": b"",
    }  # fmt: skip


def _nodes(values: Mapping[str, Any]) -> int:
    """Number of nodes of a mesh."""
    return len(Mesh({k: v for k, v in values.items() if k != "layer"}).refined.nodes)


@bomb
def gate_grid() -> bytes:
    """Mesh of as many gates as are allowed."""
    mesh = meshed(grid(127, 127))
    return made([layer()], [codes()], [network()], meshes=(mesh,), poses=(bent(0, _nodes(mesh)),))


@bomb
def faces() -> bytes:
    """Mesh of as many faces as are allowed."""
    mesh = meshed(grid(16, 24), 4)
    return made([layer()], [codes()], [network()], meshes=(mesh,), poses=(bent(0, _nodes(mesh)),))


@bomb
def meshes() -> bytes:
    """Many small meshes of many faces each."""
    one = meshed(grid(2, 2), 4)
    pose, count = bent(0, _nodes(one)), 96
    return made(
        [layer(k) for k in range(count)], [codes(), *[{"coder": 0, "texture": 0}] * (count - 1)],
        [network()], meshes=tuple(one | {"layer": k} for k in range(count)),
        poses=tuple(pose | {"layer": k} for k in range(count)),
    )  # fmt: skip


@bomb
def riders() -> bytes:
    """Boundary of many pieces on a mesh of many faces."""
    mesh = meshed(grid(16, 16), 3)
    return made(
        [outlined(0, 1 << 12, 4096)], [codes()], [network()], size=4096, meshes=(mesh,),
        poses=(bent(0, _nodes(mesh)),),
    )  # fmt: skip


def _motion(coefficients: int, modes: int, mesh: Values) -> Values:
    """Fields of an mOTN whose numbers are all 0."""
    return {
        "duration": 1000, "fps": 24, "loop": 1, "intervals": coefficients, "unit": 0,
        "layers": [0], "bodies": [0], "modes": modes, "size": 0, "script": b"",
        "curve_classes": zeros(modes, 1, coefficients), "curve_deltas": b"",
        "shape_classes": zeros(2, modes, _nodes(mesh)), "shape_deltas": b"",
    }  # fmt: skip


def _moving(coefficients: int, modes: int, mesh: Values) -> bytes:
    """Bytes of a file with a motion."""
    return plain(meshes=(mesh,), motion=_motion(coefficients, modes, mesh))


@bomb
def curves() -> bytes:
    """Curves as long as are allowed."""
    return _moving(65_500, 63, meshed(grid(1, 1)))


@bomb
def shapes() -> bytes:
    """As many shapes of as many nodes as are allowed."""
    mesh = meshed(grid(15, 16), 3)
    return _moving(1, 60, mesh)


# Textures.


@bomb
def parameters() -> bytes:
    """One network of as many parameters as are allowed."""
    net = network(1024, 4)
    return made([layer()], [codes()], [net])


@bomb
def wide_network() -> bytes:
    """Network of a quarter of a million multiplications a sample, on many layers."""
    return made(
        [layer(k, box=[0, 0, 256, 256]) for k in range(256)],
        [codes(), *[{"coder": 0, "texture": 0}] * 255], [network(512, 2)],
    )  # fmt: skip


@bomb
def networks() -> bytes:
    """Many networks."""
    return made([layer()], [codes()], [network(250, 2)] * 64)


@bomb
def one_plane_of_codes() -> bytes:
    """Plane of as many codes as are allowed."""
    return made([layer()], [codes(4096, 2048)], [network()])


@bomb
def columns_of_codes() -> bytes:
    """Planes of codes that are high and narrow, which have many wavefronts."""
    data = codes(2, 32_760)
    count = 2
    return made([layer(k) for k in range(count)], [data] * count, [network()])


@bomb
def holes() -> bytes:
    """Plane of codes of which one is stored, so that all others are filled."""
    mask, one = lonely(2048, 4096), zeros(1, 1, 1)
    return made([layer()], [codes(4096, 2048, one, mask)], [network()])


@bomb
def mask() -> bytes:
    """Mask of as many cells as are allowed."""
    masked = view(4096, 2048, mask=lonely(2048, 4096))
    return made([layer()], [masked], planes=(plan(4096, 4096),))


@bomb
def masks() -> bytes:
    """Narrow masks, which have many wavefronts."""
    coded = lonely(16_000, 2)
    count = 2
    return made(
        [layer(k) for k in range(count)], [view(2, 16_000, mask=coded)] * count,
        planes=(plan(2, 16_000, 1),),
    )  # fmt: skip


@bomb
def sources() -> bytes:
    """References of as many cells as are allowed, each of one sample that shows nowhere."""
    width, height = 256, 256
    masked: Values = {"cell": 6, "mask": lonely(4, 4), "offsets": [1, 1] * 16}
    copied = view(width, height, sources=_ones(2, height, width), **masked)
    return made([layer()], [copied], planes=(plan(width, height),))


@bomb
def copies() -> bytes:
    """View of as many samples as are allowed, most of them copied; another raster behind it."""
    width, height = 4096, 2048
    masked: Values = {"cell": 6, "mask": lonely(32, 64), "behind": 2}
    copied = view(width, height, grain=6, offsets=[64, 0], sources=_ones(1, 32, 64), **masked)
    behind = plan(width, height) | {"cell": 7, "support": _halves(16, 32)}
    return made([layer()], [copied], planes=(plan(width, height), behind))


@bomb
def mattes() -> bytes:
    """Soft layers over each other, of which every other sample is soft."""
    side, count = 1024, 4
    soft = {"cell": 2, "support": _halves(256, 256), "components": 1, "grey": 3, "lowest": [0]}
    rasters = plan(side, side), plan(side, side), plan(side, side) | soft
    return made(
        [layer(k) for k in range(count)], [view(side, side, behind=2, matte=3)] * count,
        planes=rasters,
    )  # fmt: skip


def _ones(channels: int, rows: int, columns: int) -> bytes:
    """Coded array of sources that are all 1."""
    values = np.zeros((channels, rows, columns), np.int8)
    values[0] = 1
    return arrays.encode(values, 4 if channels == 2 else 1, np.ones((rows, columns), bool))


def _halves(rows: int, columns: int) -> bytes:
    """Coded array of bits, of which every other is set."""
    values = np.indices((rows, columns)).sum(0)[None] % 2
    return arrays.encode(values, 1, np.ones((rows, columns), bool))


@bomb
def samples() -> bytes:
    """Raster of as many samples as are allowed."""
    return made([layer()], [view(4096, 4096)], planes=(plan(4096, 4096),))


@bomb
def rasters() -> bytes:
    """Rasters of one sample each, with as many levels as are allowed."""
    data = planes.encoded(
        Latents(tuple(np.zeros((9, 1 << k, 1 << k), np.int32) for k in range(7, -1, -1)),
                       np.zeros((3, 1, 1), np.int32)), (1, 1), 512, cell=8,
    ).packed  # fmt: skip
    count = 120
    return made(
        [layer(k) for k in range(count)], [view(1, 1, k) for k in range(count)],
        planes=(data,) * count,
    )  # fmt: skip


@bomb
def latents() -> bytes:
    """Raster of random latents, in a megabyte."""
    words = np.random.default_rng(1).integers(0, 1 << 16, 480_000).astype("<u2").tobytes()
    data = b"\0" + (1 << 17).to_bytes(4, "little") + (480_000).to_bytes(4, "little") + words
    own = plan(2048, 2048, 3, data) | {"lowest": [30] * 3, "shifts": [15] * 6, "step": 0}
    return made([layer()], [view(2048, 2048)], planes=(own,))


@bomb
def cuts() -> bytes:
    """View that many boundaries cut."""
    side, count = 2048, 400
    box = [0, 0, side, side]
    back = view(side, side, cuts=list(range(1, count)))
    return made(
        [layer(0, box=box), *(outlined(k, 100, side) for k in range(1, count))],
        [back, *[view(side, side)] * (count - 1)], planes=(plan(side, side),), size=side,
    )  # fmt: skip


@bomb
def together() -> bytes:
    """Most of the above at once."""
    mesh, (columns, rows) = meshed(grid(16, 24), 4), (4096, 2048)
    holes = codes(columns, rows, zeros(1, 1, 1), lonely(rows, columns))
    return made(
        [layer(0), layer(1)], [holes, view(4096, 4096)], [network(), *[network(250, 2)] * 63],
        planes=(plan(4096, 4096),), meshes=(mesh,), poses=(bent(0, _nodes(mesh)),),
        motion=_motion(1, 20, mesh), blocks={"xmp": bytes((1 << 26) - 1)},
    )  # fmt: skip


def opened(data: bytes) -> None:
    """Opens a file and decodes everything but planes."""
    image = from_bytes(data)
    for own in image.layers:
        if own.mesh is not None:
            _ = own.mesh.refined
        if not isinstance(own.texture, PyramidTexture):
            _ = own.texture.table


def drawn(data: bytes) -> None:
    """Draws a file at 256 pixels for its longer side."""
    image = from_bytes(data)
    size = {"width": 256} if image.width >= image.height else {"height": 256}
    image.render(**size)  # type: ignore[arg-type]  # width or height


STAGES = {"open": opened, "check": lambda data: bool(validate.validate(data)), "draw": drawn}


def _stage(name: str, path: str) -> None:
    """Runs a stage, and prints the time and memory that it took."""
    resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS))
    resource.setrlimit(resource.RLIMIT_AS, (BYTES, BYTES))
    data = Path(path).read_bytes()
    before = resource.getrusage(resource.RUSAGE_SELF)
    try:
        STAGES[name](data)
        said = "ok"
    except PxiError as error:
        said = f"{type(error).__name__} {error.rule}"
    except MemoryError:
        said = "MemoryError"
    used = resource.getrusage(resource.RUSAGE_SELF)
    seconds = used.ru_utime + used.ru_stime - before.ru_utime - before.ru_stime
    print(f"{seconds:6.1f} s {used.ru_maxrss >> 10:6} MB  {said}")


def measure(name: str, numpy_only: bool) -> None:
    """Measures all stages of a file, and prints a line for each.

    Args:
        name: Name of the file, a key of `BOMBS`.
        numpy_only: Whether to run without the compiled kernel.
    """
    import os

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "bomb.pxi"
        # The file is made in another process: this one would hand down its peak of memory.
        code = f"from fuzz.bombs import BOMBS; open({str(path)!r}, 'wb').write(BOMBS[{name!r}]())"
        subprocess.run([sys.executable, "-c", code], check=True)
        size = path.stat().st_size
        for stage in STAGES:
            command = [sys.executable, "-m", "fuzz.bombs", "--stage", stage, str(path)]
            environment = {**os.environ, "OMP_NUM_THREADS": "1"}
            if numpy_only:
                environment["PROXYIMG_NO_KERNEL"] = "1"
            ran = subprocess.run(command, capture_output=True, text=True, env=environment)
            lines = (ran.stdout or f"died: {ran.returncode} {ran.stderr[-200:]}").splitlines()
            print(f"{name:20} {size:8} {stage:6} {lines[-1]}", flush=True)


def main() -> None:
    """Entry point."""
    p = argparse.ArgumentParser("fuzz.bombs", description=__doc__)
    p.add_argument("names", nargs="*", metavar="NAME")
    p.add_argument("--numpy", action="store_true", help="without the compiled kernel")
    p.add_argument("--stage", choices=STAGES, help=argparse.SUPPRESS)
    args = p.parse_args()
    if args.stage:
        _stage(args.stage, *args.names)
        return
    for name in args.names or BOMBS:
        measure(name, args.numpy)


if __name__ == "__main__":
    main()
