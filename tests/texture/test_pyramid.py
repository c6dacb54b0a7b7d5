import numpy as np
import pytest

from proxyimg_codec.entropy import arrays
from proxyimg_codec.errors import FormatError
from proxyimg_codec.texture import cubic
from proxyimg_codec.texture.diffusion import diffused
from proxyimg_codec.texture.pyramid import FILL_ONE, PyramidTexture, unpack
from tests.support.pyramids import filled, planes, raster, view

PART = 7, 4, 21, 18
"""Of planes of 40x30."""


@pytest.fixture
def source():
    return planes("a", (40, 30))


def samples(texture):
    """float64 [height, width, 3 or 4] of the part, premultiplied."""
    x, y, w, h = texture.part
    crop = [p.raster[y : y + h, x : x + w].astype(float) for p in texture.sources]
    colour = np.broadcast_to(crop[0], (h, w, 3))
    return colour if len(crop) == 1 else np.dstack([colour * crop[1], crop[1]])


def keys(distance):
    """The cubic convolution kernel as Keys (1981) has it, a = -1/2."""
    s = np.abs(distance)
    near, far = 1.5 * s**3 - 2.5 * s**2 + 1, -0.5 * s**3 + 2.5 * s**2 - 4 * s + 2
    return np.where(s < 1, near, np.where(s < 2, far, 0))


def interpolated(known, x, y):
    """Colours at sample coordinates x, y in float64, from every sample of the part."""
    h, w = known.shape[:2]
    out = []
    for u, v in zip(np.clip(x, 0, w - 1), np.clip(y, 0, h - 1), strict=True):
        row, column = np.arange(-3, h + 3), np.arange(-3, w + 3)
        wide = known[np.clip(row, 0, h - 1)][:, np.clip(column, 0, w - 1)]
        out.append(np.einsum("y,x,yxc->c", keys(v - row), keys(u - column), wide))
    return np.array(out)


def centres(box):
    """Centres of the pixels of a box: x, y [N] in rows."""
    x0, y0, w, h = box
    y, x = np.mgrid[0:h, 0:w] + 0.5
    return x.ravel() + x0, y.ravel() + y0


@pytest.mark.parametrize("corner", [(7, 4), (0, 0), (-300, 1 << 20)])
def test_pixels_at_rest_are_the_samples_themselves(source, corner):
    texture, box = view(source, part=PART), (*corner, *PART[2:])
    got = texture.sample(*centres(box), box)
    assert got.dtype == np.float32
    np.testing.assert_array_equal(got.reshape(18, 21, 3), source.raster[4:22, 7:28])


def test_samples_come_out_beside_points_between_them(source):
    """Those that are exact stay so in the company of others."""
    texture = view(source, part=PART)
    x, y = centres(PART)
    odd = np.arange(len(x)) % 2
    got = texture.sample(x + 0.3 * odd, y, PART)
    np.testing.assert_array_equal(got[::2], source.raster[4:22, 7:28].reshape(-1, 3)[::2])


@pytest.mark.parametrize("box", [(7, 4, 21, 18), (0, 0, 50, 9), (-3, 2, 8, 80)])
@pytest.mark.parametrize("alpha", [False, True])
@pytest.mark.parametrize("components", [1, 3])
def test_points_between_samples_are_interpolated(box, alpha, components):
    """By the published kernel, from premultiplied samples, with the edges of the part repeated."""
    soft = planes("soft", (40, 30), 1) if alpha else None
    texture = view(planes("a", (40, 30), components), soft, PART)
    rng = np.random.default_rng(0)
    x = rng.uniform(box[0] - 5, box[0] + box[2] + 5, 400)
    y = rng.uniform(box[1] - 5, box[1] + box[3] + 5, 400)
    u = (x - box[0]) * 21 / box[2] - 0.5
    v = (y - box[1]) * 18 / box[3] - 0.5
    got = texture.sample(x, y, box)
    assert got.shape == (400, 4 if alpha else 3)
    np.testing.assert_allclose(got, interpolated(samples(texture), u, v), atol=1e-6)


def test_chunks_do_not_show(source, monkeypatch):
    texture = view(source, part=PART)
    x, y = centres(PART)
    whole = texture.sample(x + 0.2, y - 0.4, PART)
    monkeypatch.setattr(cubic, "CHUNK", 37)
    np.testing.assert_array_equal(texture.sample(x + 0.2, y - 0.4, PART), whole)


def test_far_away_is_the_outermost_sample(source):
    texture = view(source, part=PART)
    far = np.array([-1e9, 1e9])
    got = texture.sample(far, far, PART)
    np.testing.assert_array_equal(got, [source.raster[4, 7], source.raster[21, 27]])


@pytest.mark.parametrize("size", [(1, 1), (1, 9), (9, 1)])
def test_thin_parts(size):
    texture = view(planes("thin", size))
    x, y = np.array([0.5, size[0] - 0.25]), np.array([0.5, size[1] - 0.25])
    got = texture.sample(x, y, (0, 0, *size))
    np.testing.assert_allclose(got, interpolated(samples(texture), x - 0.5, y - 0.5), atol=1e-6)


CELLS = np.array([[1, 1, 0, 1, 1, 0], [1, 0, 0, 0, 1, 1], [0, 1, 0, 1, 1, 1],
                  [1, 1, 1, 0, 0, 1], [1, 1, 1, 1, 1, 0]], bool)  # fmt: skip
"""Of 4x4 samples over `PART`: the last ones are cut off."""


def inside():
    return np.kron(CELLS, np.ones((4, 4), bool))[:18, :21]


@pytest.mark.parametrize("alpha", [False, True])
def test_outside_the_mask_is_filled(source, alpha):
    """By the normative fill of what is inside; nothing outside has any influence."""
    soft = planes("soft", (40, 30), 1) if alpha else None
    texture = view(source, soft, PART, 2, CELLS)
    known = inside()
    values = np.concatenate([p.raster[4:22, 7:28] for p in texture.sources], axis=2)
    fixed = np.rint(values * FILL_ONE).astype(np.int32)
    fixed[~known] = 0
    fill = np.moveaxis(diffused(np.moveaxis(fixed, 2, 0), known), 0, 2) / FILL_ONE
    expected = np.where(known[..., None], values, fill)
    if alpha:
        expected = np.dstack([expected[..., :3] * expected[..., 3:], expected[..., 3:]])
    got = texture.sample(*centres(PART), PART).reshape(18, 21, -1)
    np.testing.assert_allclose(got, expected, atol=1e-6)
    np.testing.assert_array_equal(got[known], samples(texture)[known].astype(np.float32))

    changed = source.raster.copy()
    changed[4:22, 7:28][~known] = 0.123
    changed[:4] = changed[22:] = 0.9
    other = planes("a", (40, 30))
    other.__dict__["raster"] = changed
    rng = np.random.default_rng(1)
    x, y = rng.uniform(7, 28, 500), rng.uniform(4, 22, 500)
    np.testing.assert_array_equal(
        view(other, soft, PART, 2, CELLS).sample(x, y, PART), texture.sample(x, y, PART)
    )


def test_filling_waits_until_it_is_needed(source):
    texture = view(source, part=PART, cell=2, mask=CELLS)
    known = inside().ravel()
    x, y = centres(PART)
    texture.sample(x[known], y[known], PART)
    assert not filled(texture)
    texture.sample(x[~known][:1], y[~known][:1], PART)
    assert filled(texture)


def test_a_mask_of_single_samples(source):
    """A hole of one sample has the mean of its neighbours, on the way to which it starts."""
    mask = np.ones((18, 21), bool)
    mask[9, 10] = False
    got = view(source, part=PART, mask=mask).sample(*centres(PART), PART).reshape(18, 21, 3)
    crop = source.raster[4:22, 7:28]
    np.testing.assert_array_equal(got[mask], crop[mask])
    mean = (crop[8, 10] + crop[10, 10] + crop[9, 9] + crop[9, 11]) / 4
    np.testing.assert_allclose(got[9, 10], mean, atol=2 / FILL_ONE)


@pytest.mark.parametrize("mask", [None, CELLS])
def test_fields_come_back(source, mask):
    soft = planes("soft", (40, 30), 1)
    texture = view(source, soft, PART, 2, mask)
    fields = texture.fields({source: 3, soft: 1})
    assert (fields["planes"], fields["alpha"], fields["part"]) == (3, 2, list(PART))
    assert fields["cell"] == (0 if mask is None else 2)
    again = unpack(fields, [None, soft, None, source])
    assert again.sources == (source, soft)
    assert (again.part, again.cell) == (PART, fields["cell"])
    assert (mask is again.mask is None) or (again.mask == mask).all()
    assert again.fields({source: 0, soft: 1})["mask"] == fields["mask"]


def test_a_full_mask_is_none(source):
    full = view(source, part=PART, cell=2, mask=np.ones((5, 6), bool))
    assert full.fields({source: 0}) == view(source, part=PART).fields({source: 0})


def test_the_mask_keeps_the_bytes_it_was_read_from(source):
    """Another encoder may have chosen more lanes."""
    fields = view(source, part=PART, cell=2, mask=CELLS).fields({source: 0})
    read = unpack({**fields, "mask": fields["mask"]}, [source])
    assert read.coded_mask is fields["mask"]


def masked(data):
    return {"coder": 2, "planes": 0, "alpha": 0, "part": list(PART), "cell": 2, "mask": data}


@pytest.mark.parametrize("value", [0, 1])
def test_full_and_empty_masks_are_refused(source, value):
    data = arrays.encode(np.full((1, 5, 6), value), 1, np.ones((5, 6), bool))
    with pytest.raises(FormatError, match="full or empty"):
        unpack(masked(data), [source])


@pytest.mark.parametrize("shape", [(5, 5), (4, 6), (6, 5)])
def test_masks_of_another_size_are_refused(source, shape):
    cells = np.random.default_rng(3).random((1, *shape)) < 0.5
    with pytest.raises(FormatError):
        unpack(masked(arrays.encode(cells.astype(int), 1, np.ones(shape, bool))), [source])


def test_channels(source):
    soft = planes("soft", (40, 30), 1)
    assert view(source).channels(()) == 3
    assert view(source, soft).channels(()) == 4
    assert PyramidTexture.network is None


def test_made_up_samples_differ():
    """What these tests build on."""
    a, b = raster("a", (40, 30), 3), raster("b", (40, 30), 3)
    assert np.abs(a - b).mean() > 0.1
    assert np.ptp(a) > 0.6
