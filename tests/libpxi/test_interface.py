"""The C interface: what it tells and draws, and what it says to callers who are wrong."""

import ctypes as ct
import shutil

import numpy as np
import pytest

import proxyimg_codec as pxi
from tests.libpxi import interface as c
from tests.libpxi.conftest import run
from tests.support.paths import ROOT

CASES = ROOT / "conformance/cases"
PHOTO = CASES / "views/pyramid-cuts"
MOVING = CASES / "motion/moves-loop"
FORMATS = (np.uint8, 255), (np.uint16, 65535), (np.float32, 1)


@pytest.fixture(scope="module")
def library(build):
    return c.load(build)


class File:
    """An open file, with what the last call said."""

    def __init__(self, library, data, **options):
        self.library, self.handle, self.error = library, ct.c_void_p(), c.Error()
        self.status = library.pxi_open(
            data, len(data), ct.byref(c.Options(**options)), ct.byref(self.handle), self.error_at
        )

    @property
    def error_at(self):
        return ct.byref(self.error)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.library.pxi_close(self.handle)

    def measured(self, **request):
        output = c.Output()
        status = self.library.pxi_measure(
            self.handle, ct.byref(c.Request(**request)), ct.byref(output), self.error_at
        )
        assert status == self.error.status
        return output

    def drawn(self, **request):
        """Pixels, or the status if it is not 0."""
        output = self.measured(**request)
        if self.error.status:
            return self.error.status
        kind = (np.uint8, np.uint16, np.float32)[request.get("format", 0)]
        pixels = np.full((output.height, output.width, 4), 7, kind)
        assert pixels.nbytes == output.bytes
        status = self.library.pxi_render(
            self.handle,
            ct.byref(c.Request(**request)),
            pixels.ctypes.data,
            pixels.nbytes,
            0,
            self.error_at,
        )
        assert status == self.error.status
        return status or pixels


def opened(library, path, **options):
    file = File(library, (path / "input.pxi").read_bytes(), **options)
    assert not file.status, file.error.message
    return file


def rgba(pixels, top):
    full = np.full_like(pixels[..., :1], top)
    return pixels if pixels.shape[2] == 4 else np.concatenate([pixels, full], 2)


def cases(*patterns):
    return [p.parent for pattern in patterns for p in sorted(CASES.glob(f"{pattern}/input.pxi"))]


@pytest.mark.parametrize("path", [PHOTO, MOVING, *cases("mattes/matte")], ids=lambda p: p.name)
def test_all_formats_and_layers_are_as_python_draws_them(library, path):
    image = pxi.open(path / "input.pxi")
    with opened(library, path) as file:
        for kind, (dtype, top) in enumerate(FORMATS):
            found = file.drawn(format=kind, width=31).astype(float)
            expected = rgba(image.render(width=31, dtype=dtype), top).astype(float)
            assert np.abs(found - expected).max() <= 1.01 * top / 255
        for k in range(len(image.layers)):
            some = (ct.c_uint32 * 1)(k)
            found = file.drawn(layers=some, layer_count=1).astype(int)
            assert np.abs(found - rgba(image.render(layers=[k]), 255)).max() <= 2


def test_a_file_is_described(library):
    path = MOVING
    image = pxi.open(path / "input.pxi")
    with opened(library, path) as file:
        info, layer = c.Info(), c.Layer()
        assert not library.pxi_describe(file.handle, ct.byref(info), file.error_at)
        assert (info.width, info.height) == image.picture.size
        assert info.layers == len(image.layers)
        assert info.duration == image.picture.timeline.duration
        assert info.loop == image.picture.timeline.loop
        for k, own in enumerate(image.picture.layers):
            assert not library.pxi_describe_layer(file.handle, k, ct.byref(layer), file.error_at)
            assert layer.name.decode() == own.name
            assert (layer.x, layer.y, layer.width, layer.height) == own.box
            assert bool(layer.moves) == (own.track is not None)
            assert bool(layer.hidden) == own.pose.hidden
        assert (
            library.pxi_describe_layer(file.handle, info.layers, ct.byref(layer), file.error_at)
            == c.USAGE
        )


def test_metadata_is_what_was_put_in(library):
    path = CASES / "metadata/metadata"
    image = pxi.open(path / "input.pxi")
    with opened(library, path) as file:
        info, block, blocks = c.Info(), c.Metadata(), {}
        library.pxi_describe(file.handle, ct.byref(info), None)
        for k in range(info.metadata):
            assert not library.pxi_describe_metadata(file.handle, k, ct.byref(block), file.error_at)
            blocks[block.kind.decode()] = ct.string_at(block.bytes, block.count)
        assert blocks["exif"] == image.picture.blocks["exif"]
        assert (
            library.pxi_describe_metadata(file.handle, info.metadata, ct.byref(block), None)
            == c.USAGE
        )


def test_threads_draw_the_same(library):
    with opened(library, PHOTO) as one, opened(library, PHOTO) as several:
        request = {"width": 700, "format": c.RGBAF}
        assert (one.drawn(**request) == several.drawn(threads=5, **request)).all()


def test_what_a_caller_does_wrong_is_refused(library):
    with opened(library, PHOTO) as file:
        wrong = [
            {"format": 3}, {"x": 1}, {"region_width": 1}, {"layer_count": 1}, {"limit_count": 1},
            {"region_width": 10**6, "region_height": 1}, {"scale": -1.0}, {"scale": float("nan")},
            {"x": 2**32 - 1, "region_width": 2, "region_height": 1},
            {"scale": 1.0, "width": 3}, {"moving": 1},
            {"size": 12}, {"layers": (ct.c_uint32 * 1)(99), "layer_count": 1},
            {"layers": (ct.c_uint32 * 1)(0), "layer_count": 0},
            {"limits": (c.Limit * 1)(c.Limit(b"nonsense", 1)), "limit_count": 1},
        ]  # fmt: skip
        for request in wrong:
            assert file.drawn(**request) == c.USAGE, request
            assert file.error.message
        for request in (
            {"width": 2**31},
            {"scale": 1e300},
            {"limits": (c.Limit * 1)(c.Limit(b"work", 3)), "limit_count": 1},
        ):
            assert file.drawn(**request) == c.LIMIT, request
        assert file.error.rule == b"SEC-2"
        assert isinstance(file.drawn(), np.ndarray)


def test_null_and_small_buffers_are_refused(library):
    with opened(library, PHOTO) as file:
        output = file.measured()
        pixels = ct.create_string_buffer(output.bytes)
        render, at = library.pxi_render, file.error_at
        assert render(file.handle, None, None, output.bytes, 0, at) == c.USAGE
        assert render(file.handle, None, pixels, output.bytes - 1, 0, at) == c.USAGE
        assert file.error.message == b"the buffer is too small"
        assert render(file.handle, None, pixels, output.bytes, output.row_bytes - 1, at) == c.USAGE
        assert render(file.handle, None, pixels, output.bytes, output.row_bytes + 1, at) == c.USAGE
        assert render(None, None, pixels, output.bytes, 0, at) == c.USAGE
        assert library.pxi_measure(file.handle, None, None, at) == c.USAGE
        assert library.pxi_measure(file.handle, None, ct.byref(c.Output(size=8)), at) == c.USAGE
        assert library.pxi_describe(None, ct.byref(c.Info()), None) == c.USAGE
        assert (
            render(file.handle, None, pixels, output.bytes, 0, ct.byref(c.Error(size=4))) == c.USAGE
        )
        assert not render(file.handle, None, pixels, output.bytes, 0, None)
        latents, three, count = library.pxi_latents, (ct.c_int32 * 3)(), ct.c_size_t(3)
        assert latents(file.handle, 0, None, None, at) == c.USAGE
        assert latents(file.handle, 99, None, ct.byref(count), at) == c.USAGE
        assert latents(file.handle, 0, three, ct.byref(count), at) == c.USAGE
        assert file.error.message == b"the buffer is too small"
        assert not latents(file.handle, 0, None, ct.byref(count), at)
        assert count.value > 3
    assert library.pxi_open(None, 1, None, ct.byref(file.handle), at) == c.USAGE
    assert library.pxi_open(b"x", 1, None, None, at) == c.USAGE
    assert library.pxi_open(b"", 0, None, ct.byref(file.handle), at) == c.INVALID
    library.pxi_close(None)


def test_a_newer_caller_is_understood_if_it_asks_for_nothing_new(library):
    class Newer(c.Structure):
        _fields_ = (*c.Request._fields_, ("more", ct.c_uint64))

    with opened(library, PHOTO) as file:
        output = c.Output()
        for more, status in ((0, c.OK), (1, c.USAGE)):
            request = Newer(more=more, width=5)
            measured = library.pxi_measure(
                file.handle, ct.byref(request), ct.byref(output), file.error_at
            )
            assert measured == status
        assert output.width == 5
    assert library.pxi_abi() == 1


def test_an_error_tells_the_rule_and_the_place(library):
    data = bytearray((PHOTO / "input.pxi").read_bytes())
    data[40] ^= 1
    with File(library, bytes(data)) as file:
        assert file.status == c.INVALID
        assert not file.handle
        assert file.error.rule.startswith(b"CON-")
        assert 0 <= file.error.offset < len(data)


def test_a_callback_is_read_to_its_end(library):
    data = (PHOTO / "input.pxi").read_bytes()
    for step, status in ((7, c.OK), (10**6, c.OK), (-1, c.IO), (None, c.IO)):
        left = [data]

        @c.READ
        def read(_, to, count, left=left, step=step):
            if step is None:
                return count + 1
            if step < 0:
                return -5
            part, left[0] = left[0][: min(step, count)], left[0][min(step, count) :]
            ct.memmove(to, part, len(part))
            return len(part)

        handle, error = ct.c_void_p(), c.Error()
        assert (
            library.pxi_open_callback(read, None, None, ct.byref(handle), ct.byref(error)) == status
        )
        assert bool(handle) == (status == c.OK)
        library.pxi_close(handle)


@pytest.mark.parametrize("path", [PHOTO, MOVING], ids=lambda p: p.name)
def test_cancelling_at_any_time_leaves_a_file_that_can_be_drawn(library, path):
    data, asked = (path / "input.pxi").read_bytes(), []

    def progress(stop):
        count = 0

        @c.PROGRESS
        def ask(_, share):
            nonlocal count
            asked.append(share)
            count += 1
            return count == stop

        return ask

    keep = progress(0)
    with File(library, data, progress=keep) as file:
        opening = len(asked)
        expected = file.drawn(progress=keep)
        drawing = len(asked) - opening
    assert min(opening, drawing) > 0
    assert all(0 <= share <= 1 for share in asked)
    assert asked[opening:] == sorted(asked[opening:])
    for stop in range(1, opening + 1):
        with File(library, data, progress=progress(stop)) as file:
            assert file.status == c.CANCELLED
    for stop in range(1, drawing + 1, max(drawing // 20, 1)):
        with File(library, data) as file:
            assert file.drawn(progress=progress(stop)) == c.CANCELLED
            assert (file.drawn() == expected).all()


def test_a_caller_may_bring_the_models(library):
    weights = (ROOT / "proxyimg_codec/models/pyramid-1.bin").read_bytes()
    names = []

    def bringing(there):
        @c.MODEL
        def model(_, name, data, count):
            names.append(name)
            data[0], count[0] = ct.cast(ct.c_char_p(weights), ct.c_void_p), len(weights)
            return 0 if there else 1

        return model

    with opened(library, PHOTO) as file:
        expected = file.drawn()
    keep = bringing(True)
    with opened(library, PHOTO, model=keep) as file:
        assert (file.drawn() == expected).all()
    keep = bringing(False)
    with opened(library, PHOTO, model=keep) as file:
        assert file.drawn() == c.UNSUPPORTED
    assert set(names) == {b"pyramid-1.bin"}


def test_nothing_but_the_interface_is_exported(build):
    if shutil.which("nm") is None:
        pytest.skip("nm is not installed")
    names = {
        line.split()[-1]
        for line in run("nm", "-D", "--defined-only", build / "libpxi.so").splitlines()
    }
    assert names == set(c.ARGUMENTS)
