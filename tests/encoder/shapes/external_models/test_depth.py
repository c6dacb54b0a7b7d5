import numpy as np
import pytest

from proxyimg_codec import plugins
from proxyimg_codec.encoder.encode import encode
from proxyimg_codec.encoder.settings import Settings
from proxyimg_codec.encoder.shapes.external_models.depth import nearness_by_depth, ordered_by_depth
from proxyimg_codec.encoder.shapes.external_models.segmenters import find_depth
from proxyimg_codec.encoder.shapes.masks import Region
from proxyimg_codec.errors import InputError
from tests.support import onnx_models
from tests.support.pictures import smooth


@pytest.mark.parametrize("sides", [("h", "w"), ("70", "98"), ("h", "98")])
@pytest.mark.parametrize("four", [False, True])
def test_depth_is_what_the_model_says(tmp_path, sides, four):
    path = onnx_models.write(tmp_path / "m.onnx", onnx_models.depth(*sides, four=four))
    rgb = np.zeros((83, 131, 3), np.uint8)
    rgb[..., 0] = np.arange(131)
    found = find_depth(str(path))(rgb)
    assert found.shape == (83, 131)
    assert np.abs(found - rgb[..., 0] / 255).max() < 0.02


def test_a_lawn_lies_behind_the_dog_on_it():
    depth = np.tile(np.linspace(0, 1, 120, dtype=np.float32)[:, None], (1, 90))
    lawn = np.zeros((120, 90), bool)
    lawn[40:] = True
    dog = np.zeros_like(lawn)
    dog[45:75, 30:60] = True
    depth[dog] = depth[74, 0]  # it stands upright
    lawn &= ~dog
    assert np.median(depth[lawn]) > np.median(depth[dog])
    sky = ~lawn & ~dog
    for order in ((0, 1, 2), (2, 0, 1), (1, 2, 0)):
        masks = [(sky, lawn, dog)[i] for i in order]
        assert [order[i] for i in np.argsort(nearness_by_depth(depth, masks))] == [0, 1, 2]


def test_masks_that_do_not_touch_are_ordered_by_their_depth():
    depth = np.zeros((50, 90), np.float32)
    masks = [np.zeros((50, 90), bool) for _ in range(3)]
    for mask, x, value in zip(masks, (5, 35, 65), (7, -2, 3), strict=True):
        mask[10:30, x : x + 15] = True
        depth[mask] = value
    assert list(np.argsort(nearness_by_depth(depth, masks))) == [1, 2, 0]


def test_the_back_stays_where_it_is():
    depth = np.tile(np.linspace(1, 0, 60, dtype=np.float32)[:, None], (1, 50))
    top = np.zeros((60, 50), bool)
    top[:30] = True
    regions = [Region("back", top), Region("near", ~top)]
    assert [r.name for r in ordered_by_depth(regions, depth, opaque=True)] == ["back", "near"]
    assert [r.name for r in ordered_by_depth(regions, depth, opaque=False)] == ["near", "back"]


def test_true_disparity_puts_parts_of_a_photograph_in_order(data_dir):
    with np.load(data_dir / "depth" / "motorcycle_disp.npz") as stored:
        depth = next(iter(stored.values())).astype(np.float32)[::3, ::3]
    depth = np.where(np.isfinite(depth), depth, 0)
    ends = np.quantile(depth[depth > 0], (0.35, 0.7))
    bands = np.digitize(depth, ends)
    order = [2, 0, 1]
    near = nearness_by_depth(depth, [bands == i for i in order])
    assert [order[i] for i in np.argsort(near)] == [0, 1, 2]


@pytest.fixture
def depth_of_right(monkeypatch):
    """A plug-in: what lies to the right is near; and a segmenter that found three stripes."""

    def stripes(rgb, max_layers, support):
        names = ("back", "right", "left")
        masks = np.zeros((3, *rgb.shape[:2]), bool)
        for mask, part in zip(masks, np.array_split(np.arange(rgb.shape[1]), 3), strict=True):
            mask[:, part] = True
        return [Region(n, masks[i]) for n, i in zip(names, (1, 2, 0), strict=True)]

    def near(rgb):
        return np.tile(np.arange(rgb.shape[1], dtype=float), (len(rgb), 1))

    stand_ins = {"near": near, "flat": lambda rgb: near(rgb)[..., 0], "stripes": stripes,
                 "hole": lambda rgb: near(rgb) * np.nan}  # fmt: skip
    monkeypatch.setattr(plugins, "names", lambda kind: list(stand_ins))
    monkeypatch.setattr(plugins, "find", lambda kind, name: stand_ins[name])


def test_depth_decides_the_order_of_layers(depth_of_right):
    settings = {"segmenter": "stripes", "effort": 1}
    image = encode(smooth(48, 40), Settings(**settings))
    assert [layer.name for layer in image.layers] == ["back", "right", "left"]
    image = encode(smooth(48, 40), Settings(**settings, depth="near"))
    assert [layer.name for layer in image.layers] == ["back", "left", "right"]


@pytest.mark.parametrize("name", ["flat", "hole"])
def test_plugins_that_give_no_depth_are_told(depth_of_right, name):
    with pytest.raises(InputError, match=f"the depth of {name}"):
        find_depth(name)(smooth(48, 40))


def test_files_do_not_tell_folders():
    settings = Settings(segmenter="/home/me/u2netp.onnx", depth="/b/d.onnx")
    assert settings.record() == {"segmenter": "u2netp.onnx", "depth": "d.onnx"}
    pair = Settings(segmenter="/home/me/e.onnx:/home/me/d.onnx")
    assert pair.record() == {"segmenter": "e.onnx:d.onnx"}
