"""Files outside the suite, and the results of the decoder for them.

They are pictures that the encoder makes, edits and motions of these and of the suite's pictures,
and damaged files. They are made independently of the suite, so that a fault that the suite misses
may show in them.
"""

from __future__ import annotations

import functools
import json
import os
import random
import signal
import tempfile
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import msgpack
import numpy as np
from numpy.typing import NDArray

from .. import cases as suite
from ..cases import Case
from .runs import forked, limit_memory

PHOTO = Path(__file__).parents[2] / "docs" / "images" / "photo.png"

SEED = 7

TAKEN, MOVING, DAMAGED = 120, 40, 2
"""Numbers of pictures of the suite to edit, of pictures to move, and of damaged files of each."""

PATIENCE, PIXELS = 10, 1 << 15
"""Most processor time in seconds that a file may take, and most pixels of its canvas."""

PEAK, RMS = 0.05, 0.01
"""Tolerances in 8-bit levels, as in the suite."""

Args = Mapping[str, Any]


@functools.cache
def folder() -> tempfile.TemporaryDirectory[str]:
    """Folder of the files, which exists until the program ends."""
    return tempfile.TemporaryDirectory(prefix="pxi-inputs-")


def cases() -> list[Case]:
    """Makes the files as cases; their expected results are those of the decoder without a fault.

    Raises:
        RuntimeError: The files could not be made.
    """
    place = Path(folder().name)
    said, status = forked(lambda out: _make(place, lambda name: print(name, file=out)))
    if status:
        raise RuntimeError(f"the files could not be made: status {status} after {said[-3:]}")
    return suite.load(place)


def _make(place: Path, say: Callable[[str], None]) -> None:
    """Writes all cases into a folder."""
    from proxyimg_codec import errors
    from proxyimg_codec.native import kernel

    limit_memory()
    signal.signal(signal.SIGPROF, _too_slow)
    dice = random.Random(SEED)
    files = dict(_files(dice))
    os.environ["PROXYIMG_NO_KERNEL"] = "1"
    kernel.library.cache_clear()
    for name, data in files.items():
        say(name)
        target = place / name
        target.mkdir()
        (target / "input.pxi").write_bytes(data)
        content: dict[str, Any] = {"title": name, "tests": ["REN-1"], "profile": suite.PROFILES[-1]}
        signal.setitimer(signal.ITIMER_PROF, PATIENCE)
        try:
            content |= _expected(target, data, None if "-damaged-" in name else dice)
        except errors.PxiError as error:
            codes = {code: name for name, code in suite.EXIT_CODES.items()}
            content |= {"error": codes[error.exit_code]}
        except (MemoryError, TimeoutError):
            continue
        finally:
            signal.setitimer(signal.ITIMER_PROF, 0)
        (target / "case.json").write_text(json.dumps(content))


def _too_slow(*_: object) -> None:
    """Signal handler that raises `TimeoutError`."""
    raise TimeoutError


def _expected(target: Path, data: bytes, dice: random.Random | None) -> dict[str, Any]:
    """Content of `case.json` for a valid file: renders, level and latents.

    Raises:
        MemoryError: The canvas is too large to try all mutants on the file.
    """
    from proxyimg_codec import from_bytes
    from proxyimg_codec.io.png import encode_png

    from ..symbols import digest

    image = from_bytes(data)
    if image.width * image.height > PIXELS:
        raise MemoryError
    renders = []
    for number, args in enumerate(_views(image, dice)):
        wanted = dict(args)
        pixels = image.render(t=wanted.pop("time", None), **wanted, dtype=np.uint16, engine="numpy")
        name = f"expected-{number}.png"
        (target / name).write_bytes(encode_png(pixels))
        renders.append({"args": args, "expected": name, "peak": PEAK, "rms": RMS})
    latents = digest(data)
    return {"renders": renders, "level": 1} | ({"latents": latents} if latents else {})


def _views(image: Any, dice: random.Random | None) -> Iterator[Args]:
    """Yields arguments of renders: the whole picture, and with `dice` random others."""
    yield {}
    if dice is None:
        return
    x, y = dice.randrange(image.width), dice.randrange(image.height)
    w, h = dice.randint(1, image.width - x), dice.randint(1, image.height - y)
    w, h = min(w, 64), min(h, 64)
    yield {"region": [x, y, w, h], "width": dice.randint(1, 90)}
    if image.timeline is not None:
        for _ in range(3):
            yield {"time": round(dice.uniform(-0.5, 1.5) * image.timeline.seconds, 4)}


def _files(dice: random.Random) -> Iterator[tuple[str, bytes]]:
    """Yields the files and their names."""
    from proxyimg_codec import from_bytes
    from proxyimg_codec.errors import PxiError

    good = {name: image.to_bytes() for name, image in _encoded()}
    yield from good.items()
    others = [case for case in suite.load() if not case.error]
    good |= {c.name: c.input.read_bytes() for c in dice.sample(others, min(TAKEN, len(others)))}
    for number, (name, data) in enumerate(good.items()):
        try:
            image = from_bytes(data)
            yield f"{name}-edited", image.edited(*_edits(image, dice)).to_bytes()
            if number < MOVING and image.timeline is None:
                yield f"{name}-moving", _moving(image, dice).to_bytes()
        except PxiError:
            continue  # some edits are not possible for some pictures
    for name, data in good.items():
        for number in range(DAMAGED):
            yield f"{name}-damaged-{number}", _damaged(data, dice)


def _encoded() -> Iterator[tuple[str, Any]]:
    """Yields small pictures that are encoded in several ways, and their names."""
    import proxyimg_codec as pxi
    from proxyimg_codec.io.raster import read

    photo = read(PHOTO).pixels
    top, left = photo.shape[0] // 3, photo.shape[1] // 3
    y, x = np.mgrid[:40, :56]
    round_ = (x - 25) ** 2 + (y - 18) ** 2 < 200
    drawn = np.stack([4 * x, 5 * y, 255 * round_], 2).astype(np.uint8)
    faded = np.dstack([drawn, np.where(round_, 255, 3 * x).astype(np.uint8)])
    pictures: dict[str, NDArray[Any]] = {
        "photo": photo[top : top + 56, left : left + 80, :3],
        "drawn": drawn,
        "faded": faded,
        "grey": photo[:36, :52, 1],
    }
    masks = [pxi.Region("back", np.ones_like(round_)), pxi.Region("ring", round_ & (x % 9 > 2))]
    settings: dict[str, dict[str, Any]] = {
        "pyramid": {"effort": 1},
        "fine": {"effort": 2, "quality": 95.0, "max_layers": 1},
        "meshed": {"effort": 1, "mesh": "delaunay", "quality": 20.0},
        "implicit": {"effort": 1, "texture": "implicit"},
        "node": {"effort": 1, "texture": "implicit", "sampling": "node"},
        "complete": {"effort": 1, "texture": "implicit", "background": "complete"},
    }
    for kind, pixels in pictures.items():
        for how, options in settings.items():
            regions = masks if kind == "drawn" and how != "fine" else None
            try:
                yield f"{kind}-{how}", pxi.encode(pixels, masks=regions, jobs=1, **options)
            except pxi.UsageError:
                continue  # some settings are not possible for some pictures


def _edits(image: Any, dice: random.Random) -> list[dict[str, Any]]:
    """Makes three random operations, on layers other than the back if there are any."""
    names = [layer.name for layer in image.layers][1 if image.opaque else 0 :]
    if not names:
        return [{"op": "recolour", "layer": 0, "hue": 40}]
    x, y = image.width / 2, image.height / 2

    def some(low: float, high: float) -> float:
        return round(dice.uniform(low, high), 3)

    made: list[dict[str, Any]] = [
        {"op": "move", "by": [some(-x, x) / 2, some(-y, y) / 2]},
        {"op": "rotate", "degrees": some(-180, 180)},
        {"op": "scale", "by": [some(0.4, 2), some(-2, -0.4)]},
        {"op": "shear", "by": [some(-1, 1), 0]},
        {"op": "drag", "handles": [[x, y, some(-6, 6), some(-6, 6)], [1, 1, 0, 0]]},
        {"op": "opacity", "value": some(0, 1)},
        {"op": "recolour", "saturation": some(0, 2), "brightness": some(0.5, 2)},
        {"op": "hide"},
        {"op": "duplicate"},
        {"op": "order", "to": "front"},
    ]
    return [{**dice.choice(made), "layer": dice.choice(names)} for _ in range(3)]


def _moving(image: Any, dice: random.Random) -> Any:
    """Adds a random preset motion to a picture."""
    from proxyimg_codec.animate.animate import preset
    from proxyimg_codec.animate.motion import PRESETS

    name = dice.choice(sorted(PRESETS))
    return image.animated(preset(image, name, duration=0.5, fps=8))


def _damaged(data: bytes, dice: random.Random) -> bytes:
    """Changes one value or bit of one chunk; the checksums are valid."""
    from dataclasses import replace

    from proxyimg_codec.container.chunks import read, write

    chunks = read(data)
    at = dice.choice([i for i, chunk in enumerate(chunks) if chunk.payload])
    payload = chunks[at].payload
    try:
        content = msgpack.unpackb(payload, strict_map_key=False)
        values = [*content.values()] if isinstance(content, dict) else content
        place = dice.randrange(len(values))
        values[place] = _other(values[place], dice)
        keyed = dict(zip(content, values, strict=True)) if isinstance(content, dict) else values
        payload = msgpack.packb(keyed)
    except (ValueError, TypeError, OverflowError):
        payload = _flipped(payload, dice)
    chunks[at] = replace(chunks[at], payload=payload)
    return write(chunks)


def _other(value: Any, dice: random.Random) -> Any:
    """Value that differs a little from another."""
    if isinstance(value, int):
        return dice.choice([value + 1, value - 1, -value, 2 * value, 0, 1, value ^ 1 << 7])
    if isinstance(value, bytes):
        return _flipped(value, dice) if dice.random() < 0.8 else value[:-1] + value[-1:] * 2
    if isinstance(value, list) and value:
        place = dice.randrange(len(value))
        value[place] = _other(value[place], dice)
        return value if dice.random() < 0.8 else value[1:]
    return value * 2


def _flipped(data: bytes, dice: random.Random) -> bytes:
    """Flips one bit."""
    if not data:
        return b"\1"
    at = dice.randrange(len(data))
    return data[:at] + bytes([data[at] ^ 1 << dice.randrange(8)]) + data[at + 1 :]
