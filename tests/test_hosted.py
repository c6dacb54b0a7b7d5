"""Images in numpy, notebooks and Dask."""

import pickle
import subprocess
import sys

import numpy as np
import pytest

import proxyimg_codec as pxi
from proxyimg_codec.hosted import SHOWN_MAX
from proxyimg_codec.io import raster
from tests.support import moving
from tests.support.files import MOVING, SMALL
from tests.support.images import changed
from tests.support.paths import ROOT


def test_numpy_takes_the_pixels():
    image = pxi.open(SMALL)
    drawn = image.render()
    np.testing.assert_array_equal(np.asarray(image), drawn)
    assert np.asarray(image).dtype == np.uint8
    for dtype in (np.float32, np.uint16, np.int64):
        given = np.asarray(image, dtype)
        assert given.dtype == dtype
        np.testing.assert_array_equal(given, drawn.astype(dtype))
    mean = np.mean(image, axis=(0, 1))
    np.testing.assert_allclose(mean, drawn.mean((0, 1)))
    one, two = np.array(image), np.array(image)
    assert not np.shares_memory(one, two)
    with pytest.raises(ValueError, match="copy=False"):
        np.array(image, copy=False)


def test_an_image_without_its_back_has_alpha():
    image = pxi.open(SMALL).layers["back"].hidden()
    assert np.asarray(image).shape == (48, 64, 4)


def test_notebooks_show_it():
    formatters = pytest.importorskip("IPython.core.formatters")
    image = pxi.open(SMALL)
    forms, facts = formatters.DisplayFormatter().format(image)
    pixels = raster.parse(forms["image/png"], "shown.png").pixels
    np.testing.assert_array_equal(pixels, image.render())
    assert facts["image/png"] == {"width": 64, "height": 48}
    assert forms["text/plain"] == repr(image)
    only, _ = formatters.DisplayFormatter().format(image, include={"text/plain"})
    assert set(only) == {"text/plain"}
    without, _ = formatters.DisplayFormatter().format(image, exclude={"image/png"})
    assert set(without) == {"text/plain"}


def test_an_interactive_shell_shows_it():
    interactive = pytest.importorskip("IPython.core.interactiveshell")
    capture = pytest.importorskip("IPython.utils.capture")
    shell = interactive.InteractiveShell.instance()
    with capture.capture_output() as got:
        shell.run_cell(f"import proxyimg_codec as pxi; display(pxi.open({str(SMALL)!r}))")
    interactive.InteractiveShell.clear_instance()
    assert got.outputs[0].data["image/png"][:8] == b"\x89PNG\r\n\x1a\n"


@pytest.mark.parametrize("size", [(3000, 41), (41, 3000), (SHOWN_MAX, 7), (5, 5)])
def test_what_is_shown_is_small(size):
    class Picture(pxi.Image):
        width, height = size

        def render(self, *, width=None, height=None):
            return np.zeros((height, width, 3), np.uint8)

    _, facts = Picture(pxi.open(SMALL))._repr_png_()
    wide, high = facts["width"], facts["height"]
    assert max(wide, high) == min(SHOWN_MAX, max(size))
    assert abs(wide / high / (size[0] / size[1]) - 1) < 0.5 / min(wide, high)


def test_what_is_shown_has_its_colours_and_no_more():
    blocks = {"cicp": bytes((12, 13, 0, 1)), "xmp": b"<x/>"}
    png, _ = changed(pxi.open(SMALL), blocks=blocks)._repr_png_()
    assert raster.parse(png, "a.png").blocks == {"cicp": blocks["cicp"]}


def test_pickles_carry_the_file_beside_them():
    image = pxi.open(SMALL)
    beside = []
    pickled = pickle.dumps(image, protocol=5, buffer_callback=beside.append)
    assert len(pickled) < 200
    assert beside[0].raw() == image.to_bytes()
    assert pickle.loads(pickled, buffers=beside) == image
    assert pickle.loads(pickled, buffers=[bytearray(beside[0].raw())]) == image
    assert pickle.loads(pickle.dumps(image, protocol=5)) == image
    swaying = moving.picture().at(0.3)
    assert pickle.loads(pickle.dumps(swaying, protocol=5)) == swaying


def test_dask_names_equal_images_alike():
    tokenize = pytest.importorskip("dask.base").tokenize
    image = pxi.open(SMALL)
    assert tokenize(image) == tokenize(pxi.open(SMALL))
    assert tokenize(image) != tokenize(image.layers["disc"].hidden())
    motion = pxi.open(MOVING)
    assert tokenize(motion.at(0.1)) != tokenize(motion.at(0.2))
    code = f"""import proxyimg_codec as pxi
from dask.base import tokenize
print(tokenize(pxi.open({str(SMALL)!r})), tokenize(pxi.open({str(MOVING)!r}).at(0.1)))"""
    ran = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)
    assert ran.stdout.split() == [tokenize(image), tokenize(motion.at(0.1))], ran.stderr


def test_dask_computes_with_images():
    dask = pytest.importorskip("dask")
    draw = dask.delayed(lambda image, width: image.render(width=width).shape)
    edit = dask.delayed(lambda image: image.layers["disc"].moved(2, 3))
    image = dask.delayed(pxi.open(SMALL))
    jobs = [draw(edit(image), width) for width in (9, 17)]
    assert dask.compute(*jobs, scheduler="threads") == ((7, 9, 3), (13, 17, 3))
