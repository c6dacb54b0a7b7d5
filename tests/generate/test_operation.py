"""The edit as a whole: what stays to the byte, undo, records, and what is refused."""

import json
from dataclasses import replace

import numpy as np
import pytest

import proxyimg_codec as pxi
from proxyimg_codec.edit import script
from proxyimg_codec.errors import InputError, UnsupportedError, UsageError
from proxyimg_codec.generate.run import Run
from proxyimg_codec.generate.settings import Settings
from proxyimg_codec.io import raster
from tests.support.edits import covered, grown
from tests.support.pictures import disc, smooth

CODERS = ["pyramid", "implicit"]


def chunks(image, type_):
    return [c.payload for c in image.chunks if c.type == type_]


def short(image, prompt="1", **settings):
    return image.layers["disc"].generated(prompt, guide="mixture", **{"steps": 3, **settings})


@pytest.mark.parametrize("coder", CODERS)
def test_all_else_stays_to_the_byte(pictures, mixture, coder):
    """Also numbers: what is new comes after all that there was."""
    before = pictures[coder].layers["disc"].moved(3, 2)
    after = pxi.from_bytes(short(before).to_bytes())
    for type_ in ("LAYR", "MESH", "POSE"):
        assert chunks(after, type_) == chunks(before, type_)
    back, new = chunks(after, "TEXR")
    assert back == chunks(before, "TEXR")[0]
    assert new != chunks(before, "TEXR")[1]
    type_ = "PLAN" if coder == "pyramid" else "NETW"
    assert chunks(after, type_)[:-1] == chunks(before, type_)
    assert len(chunks(after, type_)) == 2
    np.testing.assert_array_equal(covered(after, "disc"), covered(before, "disc"))
    beyond = ~grown(covered(before, "disc"), 2)
    np.testing.assert_array_equal(after.render()[beyond], before.render()[beyond])


@pytest.mark.parametrize("coder", CODERS)
def test_it_is_one_edit_that_keeps_prompt_and_settings(pictures, mixture, coder):
    image = pictures[coder]
    made = pxi.from_bytes(short(image, times=(0.1, 0.7), seed=5, clip=2).to_bytes())
    (step,) = made.history
    assert json.loads(step.operation) == {
        "op": "generate", "layer": "disc", "prompt": "1", "guide": "mixture", "steps": 3,
        "times": [0.1, 0.7], "seed": 5, "clip": 2,
    }  # fmt: skip
    assert made.undone().to_bytes() == image.to_bytes()
    again = image.edited(json.loads(step.operation))
    assert again.to_bytes() == made.to_bytes()
    assert short(image, seed=6).to_bytes() != short(image, seed=5).to_bytes()


def test_the_schema_knows_it():
    jsonschema = pytest.importorskip("jsonschema")
    edit = {"op": "generate", "layer": 1, "prompt": "fur", "guide": "a", "times": [0, 1]}
    check = jsonschema.Draft202012Validator(script.schema())
    check.validate({"version": 1, "edits": [edit]})
    assert not check.is_valid({"version": 1, "edits": [{**edit, "weighting": "heavy"}]})


def test_alpha_stays(mixture):
    """Of a picture with translucent parts, in both coders."""
    alpha = np.clip(np.linspace(80, 300, 101), 0, 255).astype(np.uint8) * disc(101, 75)
    drawing = np.dstack([smooth(101, 75), alpha])
    for coder in CODERS:
        image = pxi.encode(drawing, effort=1, texture=coder, max_layers=1)
        made = image.layers[0].generated("1", guide="mixture", steps=120)
        old, new = (v.render(dtype=np.float32)[..., 3] for v in (image, made))
        assert np.abs(old - new).max() <= (0 if coder == "pyramid" else 0.1), coder
        pixels, near = made.render(dtype=np.float32), old > 0.8
        # The guide sees it before grey.
        mixed = pixels[..., :3] * pixels[..., 3:] + 0.5 * (1 - pixels[..., 3:])
        assert np.abs(mixed[near].mean(0) - [0.1, 0.3, 0.8]).max() < 0.1, coder


def test_the_old_structure_can_stay(mixture):
    """Stripes stay stripes, of another mean colour."""
    pixels = smooth(101, 75)
    mask = disc(101, 75)
    stripes = np.where(np.arange(101) // 6 % 2 == 0, 60, 190).astype(np.uint8)
    pixels[mask] = np.tile(stripes[None, :, None], (75, 1, 3))[mask]
    image = pxi.encode(pixels, masks={"disc": mask}, effort=1)
    inside = ~grown(~mask, 4)

    def contrast(keep):
        made = short(image, steps=200, keep_structure=keep)
        light = made.render(dtype=np.float32).mean(2)
        return np.abs(np.diff(light, axis=1))[inside[:, 1:]].mean()

    old = np.abs(np.diff(image.render(dtype=np.float32).mean(2), axis=1))[inside[:, 1:]].mean()
    assert contrast(3) > 0.6 * old
    assert contrast(0) < 0.5 * old


def test_a_picture_as_guide_needs_no_words(pictures, tmp_path):
    """The layer gets its two colours, in about their shares, wherever they lie."""
    goal = np.full((40, 64, 3), (200, 30, 40), np.uint8)
    goal[:, 48:] = (20, 200, 60)
    raster.write(tmp_path / "goal.png", goal)
    image = pictures["pyramid"]
    made = image.layers["disc"].generated("", guide=str(tmp_path / "goal.png"), steps=100)
    inside = ~grown(~covered(image, "disc"), 3)
    found = made.render()[inside].astype(int)
    red = (np.abs(found - (200, 30, 40)).max(1) < 50).mean()
    green = (np.abs(found - (20, 200, 60)).max(1) < 50).mean()
    assert red > 0.5
    assert 0.08 < green < 0.45


def test_interrupted_it_keeps_what_was_made(pictures, mixture, caplog):
    def stop(stage, done, total):
        if stage == "generate" and done == 2:
            raise KeyboardInterrupt

    image = pictures["pyramid"]
    made = short(image, steps=50, run=Run(progress=stop))
    assert "after 2 of 50 steps" in caplog.text
    assert made.to_bytes() != image.to_bytes()


@pytest.mark.parametrize("coder", CODERS)
def test_going_on_gives_the_same_as_not_stopping(pictures, mixture, coder, tmp_path, caplog):
    image, state = pictures[coder], tmp_path / "state.pt"
    whole = short(image, steps=8)
    for end in (3, 6):

        def stop(stage, done, total, end=end):
            if stage == "generate" and done == end:
                raise KeyboardInterrupt

        short(image, steps=8, run=Run(progress=stop, resume=state))
    assert short(image, steps=8, run=Run(resume=state)).to_bytes() == whole.to_bytes()
    for other in ({"steps": 9}, {"seed": 1}):
        with pytest.raises(InputError, match="belongs to another picture"):
            short(image, **{"steps": 8, **other}, run=Run(resume=state))
    with pytest.raises(InputError, match="belongs to another picture"):
        short(image.layers["disc"].moved(1, 0), steps=8, run=Run(resume=state))
    state.write_bytes(b"PK\x03\x04 nothing")
    with pytest.raises(InputError, match="no file to go on from"):
        short(image, steps=8, run=Run(resume=state))


def test_previews_are_pictures(pictures, mixture, tmp_path):
    short(pictures["implicit"], steps=5, run=Run(previews=tmp_path / "seen", every=2))
    names = sorted(p.name for p in (tmp_path / "seen").iterdir())
    assert names == ["step-00002.png", "step-00004.png"]
    assert raster.read(tmp_path / "seen" / names[0]).pixels.shape[2] == 3


def test_layers_that_cannot_be_used(pictures, mixture):
    image = pictures["pyramid"]
    with pytest.raises(UsageError, match="is hidden; show it first"):
        short(image.layers["disc"].hidden())
    with pytest.raises(UsageError, match=r"shows in .* pixels only"):
        short(image.layers["disc"].scaled(0.03))
    with pytest.raises(UsageError, match="outside of the canvas"):
        short(image.layers["disc"].moved(5000, 0))
    covering = image.layers["back"].reordered("front")
    with pytest.raises(UsageError, match="shows in 0 pixels"):
        short(covering)


def test_a_layer_of_three_pixels(mixture):
    mask = np.zeros((48, 64), bool)
    mask[20, 30:33] = True
    image = pxi.encode(smooth(64, 48), masks={"disc": mask}, effort=1)
    with pytest.raises(UsageError, match="pixels only"):
        short(image)


def test_node_sampling_is_refused(mixture):
    image = pxi.encode(
        smooth(64, 48), masks={"disc": disc(64, 48)}, effort=1, texture="implicit", sampling="node"
    )
    with pytest.raises(UsageError, match="features at its nodes"):
        short(image)


BAD_SETTINGS = [
    ({"steps": 0}, "steps"), ({"guidance": -1}, "guidance"), ({"times": (0.9, 0.1)}, "times"),
    ({"resolution": 4}, "resolution"), ({"clip": 0}, "clip"), ({"effort": 10}, "effort"),
    ({"keep_structure": -1}, "keep_structure"), ({"weighting": "x"}, "weighting"),
    ({"precision": "double"}, "precision"), ({"seed": -1}, "seed"), ({"steps": 1.5}, "numbers"),
]  # fmt: skip


@pytest.mark.parametrize(("values", "said"), BAD_SETTINGS)
def test_settings_out_of_range(values, said):
    with pytest.raises(UsageError, match=said):
        replace(Settings("fur", "guide"), **values)


def test_devices_that_are_not_there(pictures, mixture):
    import torch

    with pytest.raises(UsageError, match="not cpu or cuda"):
        short(pictures["pyramid"], run=Run(device="tpu"))
    if not torch.cuda.is_available():
        with pytest.raises(UnsupportedError, match="no CUDA device"):
            short(pictures["pyramid"], run=Run(device="cuda"))
