"""Reading and writing from many threads at once, which changes nothing of the process."""

import contextlib
import os
import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from proxyimg_codec.errors import InputError, PxiError
from proxyimg_codec.io import color
from proxyimg_codec.io.raster import parse, read, write
from tests.support.profiles import P3, chrm, cmyk_icc, gama, grey_icc, iccp, png_of

pytest.importorskip("OpenImageIO")
pytest.importorskip("imagecodecs")
Image = pytest.importorskip("PIL.Image")

THREADS = 8
PIXELS = np.random.default_rng(2).integers(0, 256, (33, 47, 3), np.uint8)
EXIF = b"II*\0\x08\0\0\0\x01\0\x0f\x01\x02\0\x03\0\0\0Mk\0\0\0\0\0\0"


def inputs(folder):
    """Files of every kind of conversion, and some that are damaged."""
    for suffix in (".png", ".jpg", ".tif", ".webp", ".exr", ".hdr", ".bmp", ".tga"):
        write(folder / f"a{suffix}", PIXELS, {"exif": EXIF, "cicp": bytes([12, 13, 0, 1])})
    parts = [Image.fromarray(np.roll(PIXELS, 9 * k, axis=1)) for k in range(3)]
    for kind in ("gif", "webp", "png", "tiff"):
        parts[0].save(folder / f"b.{kind}", save_all=True, append_images=parts[1:])
    (folder / "c.png").write_bytes(png_of(PIXELS, gama(60000), chrm(P3)))
    (folder / "d.png").write_bytes(png_of(PIXELS[..., :1], iccp(grey_icc(1.9))))
    inks = Image.fromarray(np.dstack([PIXELS, PIXELS[..., :1]]), "CMYK")
    inks.save(folder / "e.tif", icc_profile=cmyk_icc(np.linspace(100, 0, 16)))
    for path in sorted(folder.iterdir()):
        if path.suffix in (".png", ".jpg", ".tif", ".gif", ".webp"):
            data = path.read_bytes()
            (folder / f"cut-{path.name}").write_bytes(data[: len(data) * 2 // 3])
    return sorted(folder.iterdir())


def outcome(path):
    """Pixels and blocks of a file, or the error."""
    try:
        picture = read(path)
    except InputError as error:
        return str(error)
    return picture.pixels.tobytes(), dict(picture.blocks), picture.notes


def at_once(work, items):
    """Results of a function of each item, begun in all threads at one time."""
    ready = threading.Barrier(THREADS)

    def run(k):
        ready.wait()
        return [work(item) for item in [*items[k:], *items[:k]]]

    with ThreadPoolExecutor(THREADS) as pool:
        found = list(pool.map(run, range(THREADS)))
    return [[*one[len(items) - k :], *one[: len(items) - k]] if k else one
            for k, one in ((k, one) for k, one in enumerate(found))]  # fmt: skip


def state():
    """What a library could change of the process."""
    streams = [os.fstat(fd)[:2] for fd in (0, 1, 2)]
    mask = os.umask(0o22)
    os.umask(mask)
    return streams, mask, os.getcwd(), dict(os.environ)


def test_eight_threads_read_what_one_reads(tmp_path):
    paths = inputs(tmp_path)
    before, wanted = state(), [outcome(path) for path in paths]
    for found in at_once(outcome, paths):
        assert found == wanted
    assert state() == before


def test_eight_threads_write_what_one_writes(tmp_path):
    blocks = {"exif": EXIF, "icc": color.profile_of(bytes([12, 13, 0, 1]))}

    def made(suffix):
        path = tmp_path / f"{threading.get_ident()}{suffix}"
        write(path, PIXELS, blocks)
        return path.read_bytes()

    kinds = [".png", ".jpg", ".tif", ".webp", ".bmp", ".tga", ".jp2", ".jxl", ".ppm", ".npy"]
    before, wanted = state(), [made(kind) for kind in kinds]
    for found in at_once(made, kinds):
        assert found == wanted
    assert state() == before


def test_damaged_files_print_nothing(tmp_path, capfd):
    """Libraries print about damage beside what they report; libpng does to file descriptor 2."""
    rng = np.random.default_rng(6)
    for path in inputs(tmp_path):
        data = path.read_bytes()
        for count in range(12):
            broken = bytearray(data)
            if count < 4:
                del broken[len(broken) * (count + 1) // 6 :]
            for at in rng.integers(0, len(broken), 3 * (count > 3)):
                broken[at] = rng.integers(0, 256)
            with contextlib.suppress(PxiError):
                parse(bytes(broken), f"a{path.suffix}")
    assert capfd.readouterr() == ("", "")
