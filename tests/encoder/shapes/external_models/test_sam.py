import numpy as np
import pytest

from proxyimg_codec.encoder.shapes.external_models import everything
from proxyimg_codec.encoder.shapes.external_models.everything import cleaned
from proxyimg_codec.encoder.shapes.external_models.prompting import prompted
from proxyimg_codec.encoder.shapes.external_models.segmenters import find_segmenter
from proxyimg_codec.encoder.shapes.prompts import Prompt
from proxyimg_codec.errors import InputError
from tests.support import onnx_models

HEIGHT, WIDTH = 83, 131
RED, BLUE = np.s_[10:50, 12:51], np.s_[30:75, 70:120]


def place(part):
    mask = np.zeros((HEIGHT, WIDTH), bool)
    mask[part] = True
    return mask


def picture():
    rgb = np.full((HEIGHT, WIDTH, 3), (40, 160, 90), np.uint8)
    rgb[RED] = 220, 30, 40
    rgb[BLUE] = 20, 40, 230
    return rgb


def iou(a, b):
    return (a & b).sum() / (a | b).sum()


@pytest.fixture(autouse=True)
def few_points(monkeypatch):
    """Grids are coarse, so that tests are fast."""
    for name in ("GRID", "COARSE_GRID", "CROP_GRID"):
        monkeypatch.setattr(everything, name, 5)


@pytest.fixture(params=onnx_models.SAMS)
def sam(request, tmp_path):
    return onnx_models.write_sam(tmp_path, request.param)


def test_prompts_find_objects(sam):
    stroke = place(np.s_[40:45, 75:110])
    prompts = [
        Prompt("red", inside=((30.5, 20.5),), outside=((5, 5),)),
        Prompt("blue", box=(71, 31, 48, 43), outside=((5, 5),)),
        Prompt("painted", strokes=stroke, outside=((30, 20),)),
        Prompt("better", mask=place(np.s_[14:44, 16:46]), outside=((5, 5),)),
    ]
    found = prompted(picture(), prompts, str(sam))
    assert [r.name for r in found] == [p.name for p in prompts]
    for region, part in zip(found, (RED, BLUE, BLUE, RED), strict=True):
        assert region.mask.shape == (HEIGHT, WIDTH)
        assert iou(region.mask, place(part)) > 0.85, region.name


def test_what_the_model_believes_in_is_taken_if_nothing_is_against_it(sam):
    (found,) = prompted(picture(), [Prompt("all", inside=((30.5, 20.5),))], str(sam))
    assert found.mask.all()


def test_automatic_masks_become_layers(sam):
    segment = find_segmenter(str(sam))
    regions = segment(picture(), 4, None)
    assert regions[0].name == "back"
    assert (np.sum([r.mask for r in regions], 0) == 1).all()
    assert len(regions) == 3
    for part in (RED, BLUE):
        assert max(iou(r.mask, place(part)) for r in regions[1:]) > 0.85


def test_support_bounds_layers(tmp_path):
    sam = onnx_models.write_sam(tmp_path, "sam")
    support = place(np.s_[5:60, 5:100])
    regions = find_segmenter(str(sam))(picture(), 4, support)
    assert (np.sum([r.mask for r in regions], 0) == support).all()
    assert max(iou(r.mask, place(RED)) for r in regions) > 0.85
    assert find_segmenter(str(sam))(picture(), 4, np.zeros_like(support)) == []
    assert len(find_segmenter(str(sam))(picture(), 2, None)) == 2


def test_nothing_found_is_one_layer_and_said(tmp_path, caplog):
    sam = onnx_models.write_sam(tmp_path, "sam2")
    plain = np.full((HEIGHT, WIDTH, 3), 77, np.uint8)
    (region,) = find_segmenter(str(sam))(plain, 4, None)
    assert region.mask.all()
    assert "no object was found" in caplog.text


def test_empty_masks_of_prompts_are_an_error(tmp_path, monkeypatch):
    monkeypatch.setitem(onnx_models.CONSTANTS, "half", np.float32([-100]))
    monkeypatch.setitem(onnx_models.CONSTANTS, "much", np.float32([-1]))
    sam = onnx_models.write_sam(tmp_path, "sam")
    with pytest.raises(InputError, match=r'"cat": .*finds nothing there; add a point'):
        prompted(picture(), [Prompt("cat", inside=((30, 20),))], str(sam))
    (region,) = find_segmenter(str(sam))(picture(), 4, None)
    assert region.mask.all()


def test_halves_of_different_models_are_refused(tmp_path):
    encoder = onnx_models.write(tmp_path / "x.encoder.onnx", onnx_models.sam_encoder())
    onnx_models.write(tmp_path / "x.decoder.onnx", onnx_models.sam2_decoder())
    with pytest.raises(InputError, match=r"x\.decoder\.onnx: this is a SAM 2 decoder"):
        prompted(picture(), [Prompt("cat", inside=((30, 20),))], str(encoder))


def test_both_files_can_be_named_in_any_order(tmp_path):
    encoder = onnx_models.write(tmp_path / "a.onnx", onnx_models.sam_encoder())
    decoder = onnx_models.write(tmp_path / "b.onnx", onnx_models.sam_decoder())
    prompt = Prompt("red", inside=((30, 20),), outside=((5, 5),))
    for names in (f"{encoder}:{decoder}", f"{decoder}:{encoder}"):
        (region,) = prompted(picture(), [prompt], names)
        assert iou(region.mask, place(RED)) > 0.85
    with pytest.raises(InputError, match=r"encoder of a model in two files.*name both"):
        prompted(picture(), [prompt], str(encoder))


def test_crops_find_small_things_of_large_pictures(tmp_path, monkeypatch):
    monkeypatch.setattr(everything, "LARGE", 200)
    sam = onnx_models.write_sam(tmp_path, "sam")
    rgb = np.full((109, 211, 3), (40, 160, 90), np.uint8)
    thing = np.s_[80:96, 164:186]  # between the points of the grid, not of that of a crop
    rgb[thing] = 220, 30, 40
    regions = find_segmenter(str(sam))(rgb, 2, None)
    truth = np.zeros(rgb.shape[:2], bool)
    truth[thing] = True
    assert len(regions) == 2
    assert iou(regions[1].mask, truth) > 0.65
    monkeypatch.setattr(everything, "LARGE", 2048)
    assert len(find_segmenter(str(sam))(rgb, 2, None)) == 1


def test_small_holes_and_islands_are_cleaned():
    mask = np.zeros((100, 140), bool)
    mask[20:80, 30:110] = True
    mask[50:53, 60:63] = False
    mask[5:8, 5:8] = True
    mask[30:45, 85:100] = False
    clean = cleaned(mask)
    assert clean[51, 61]
    assert not clean[6, 6]
    assert not clean[37, 92]
    tiny = np.zeros((100, 140), bool)
    tiny[5, 5] = True
    assert (cleaned(tiny) == tiny).all()
