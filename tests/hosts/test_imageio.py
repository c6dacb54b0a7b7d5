"""imageio reads and writes `.pxi` files."""

import io

import numpy as np
import pytest

import proxyimg_codec as pxi
from tests.support.files import SMALL
from tests.support.images import changed
from tests.support.pictures import smooth

iio = pytest.importorskip("imageio.v3", reason="imageio is not installed")
plugin = pytest.importorskip("proxyimg_codec.imageio")
encoder = pytest.mark.encoder

DATA = SMALL.read_bytes()


def test_it_reads_paths_bytes_and_files():
    want = pxi.open(SMALL).render()
    for source in (SMALL, str(SMALL), DATA, io.BytesIO(DATA)):
        options = {} if source in (SMALL, str(SMALL)) else {"extension": ".pxi"}
        np.testing.assert_array_equal(iio.imread(source, **options), want)
    np.testing.assert_array_equal(iio.imread(DATA, plugin="proxyimg"), want)
    np.testing.assert_array_equal(iio.imread(SMALL, index=...), want[None])
    (only,) = iio.imiter(SMALL)
    np.testing.assert_array_equal(only, want)


def test_arguments_are_those_of_the_renderer():
    want = pxi.open(SMALL).render(width=31, layers=["disc"], dtype=np.float32)
    got = iio.imread(SMALL, width=31, layers=["disc"], dtype=np.float32)
    np.testing.assert_array_equal(got, want)
    with pytest.raises(ValueError, match="no layer"):
        iio.imread(SMALL, layers=[])
    with pytest.raises(ValueError, match="index 1"):
        iio.imread(SMALL, index=1)


def test_properties_are_known_without_drawing(monkeypatch, tmp_path):
    pxi.open(SMALL).layers["back"].hidden().save(tmp_path / "a.pxi")
    shapes = {p: iio.imread(p).shape for p in (SMALL, tmp_path / "a.pxi")}
    monkeypatch.setattr(pxi.Image, "render", None)
    for path, shape in shapes.items():
        assert iio.improps(path).shape == shape
        assert iio.improps(path).dtype == np.uint8
        assert not iio.improps(path).is_batch
    every = iio.improps(SMALL, index=...)
    assert (every.shape, every.n_images, every.is_batch) == ((1, 48, 64, 3), 1, True)


def test_metadata(tmp_path):
    changed(pxi.open(SMALL), blocks={"xmp": b"<x/>"}).save(tmp_path / "a.pxi")
    found = iio.immeta(tmp_path / "a.pxi")
    assert found == {"xmp": b"<x/>", "layers": ["back", "bar", "disc"]}


def test_damaged_files_say_so(tmp_path):
    (tmp_path / "a.pxi").write_bytes(DATA[:300])
    with pytest.raises(OSError, match="truncated"):
        iio.imread(tmp_path / "a.pxi")
    (tmp_path / "b.pxi").write_bytes(b"nothing that is known")
    with pytest.raises(OSError, match="can not handle"):
        iio.imread(tmp_path / "b.pxi", plugin="proxyimg")


@encoder
def test_it_writes_paths_bytes_and_files(tmp_path):
    pixels = smooth(61, 43)
    options = {"effort": 1, "max_layers": 1, "quality": 40, "jobs": 1}
    want = pxi.encode(pixels, **options).to_bytes()
    iio.imwrite(tmp_path / "a.pxi", pixels, **options)
    assert (tmp_path / "a.pxi").read_bytes() == want
    assert iio.imwrite("<bytes>", pixels, extension=".pxi", **options) == want
    buffer = io.BytesIO()
    iio.imwrite(buffer, pixels, extension=".pxi", **options)
    assert buffer.getvalue() == want
    iio.imwrite(tmp_path / "b.pxi", [pixels], **options)
    iio.imwrite(tmp_path / "c.pxi", pixels[None], **options)
    assert {(tmp_path / f"{n}.pxi").read_bytes() for n in "abc"} == {want}


@encoder
def test_what_cannot_be_written_is_refused(tmp_path):
    with pytest.raises(ValueError, match="holds one picture, these are 2"):
        iio.imwrite(tmp_path / "a.pxi", [smooth(9, 8)] * 2)
    with pytest.raises(ValueError, match="quality"):
        iio.imwrite(tmp_path / "a.pxi", smooth(9, 8), quality=101)
    with pytest.raises(OSError, match=r"\(3, 4, 5\)"):
        iio.imwrite(tmp_path / "a.pxi", np.zeros((3, 4, 5), np.uint8))
    with pytest.raises(OSError, match="can not handle"):
        iio.imwrite(tmp_path / "a.png", smooth(9, 8), plugin=plugin.PxiPlugin)
