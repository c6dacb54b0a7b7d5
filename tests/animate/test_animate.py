"""A picture gets a motion."""

from dataclasses import replace

import numpy as np
import pytest

from proxyimg_codec import from_bytes
from proxyimg_codec.animate.animate import amplitude, boxes, preset
from proxyimg_codec.animate.motion import PRESETS, Handle, Key, LayerMotion, Motion
from proxyimg_codec.errors import LimitError, UsageError
from proxyimg_codec.model import Layers
from tests.support import pyramids
from tests.support.images import changed

SHORT = {"duration": 0.5, "fps": 12}


@pytest.fixture(scope="module")
def still():
    """64x48 pixels, the layers back, bar and disc, without meshes."""
    return pyramids.implicit()


@pytest.fixture(scope="module")
def image(still):
    """The same, swaying."""
    return still.animated(preset(still, "sway", together=False, **SHORT))


def test_all_but_the_back_move(still, image):
    assert [v.track is not None for v in image.layers] == [False, True, True]
    assert image.layers["back"].mesh is None
    line = image.timeline
    assert (line.seconds, line.fps, line.loop, line.frames) == (0.5, 12, True, 6)
    assert amplitude(image) > 0.2
    assert amplitude(still) == 0
    np.testing.assert_array_equal(image.render(), still.render())
    assert (image.render(t=0.2) != still.render()).any()


@pytest.mark.parametrize("name", PRESETS)
def test_presets_move_and_close(still, name):
    image = still.animated(preset(still, name, **SHORT))
    assert amplitude(image) > 0.05
    disc = image.layers["disc"].track
    jumps = [
        np.abs(disc.at(image.timeline, (k + 1) / 12) - disc.at(image.timeline, k / 12)).max()
        for k in range(6)
    ]
    # The last frame leads to the first like any other to the next.
    assert jumps[-1] <= 1.5 * max(jumps[:-1]) + 100


def test_it_is_the_same_every_time_and_survives_saving(still, image):
    again = still.animated(preset(still, "sway", together=False, **SHORT))
    data = image.to_bytes()
    assert again.to_bytes() == data
    read = from_bytes(data)
    assert read.to_bytes() == data
    for t in (0, 0.15, 0.4, 7.1):
        np.testing.assert_array_equal(read.render(t=t), image.render(t=t))
    other = still.animated(replace(preset(still, "sway", together=False, **SHORT), seed=7))
    assert other.to_bytes() != data


def test_the_file_tells_what_it_was_made_from(still, image):
    motion = Motion.from_json(image.timeline.script)
    assert motion == preset(still, "sway", together=False, **SHORT)
    assert still.animated(motion).to_bytes() == image.to_bytes()


def test_only_what_is_named_moves(still):
    image = still.animated(preset(still, "jelly", ["disc"], **SHORT))
    assert [v.name for v in image.layers if v.track is not None] == ["disc"]
    assert image.layers["bar"].mesh is None
    np.testing.assert_array_equal(image.render(t=0.2, layers=["bar"]), still.render(layers=["bar"]))


def test_a_new_motion_replaces_the_old(still, image):
    other = image.animated(preset(image, "jelly", ["bar"], **SHORT))
    assert [v.name for v in other.layers if v.track is not None] == ["bar"]
    fresh = still.animated(preset(still, "jelly", ["bar"], **SHORT))
    np.testing.assert_array_equal(other.render(t=0.3), fresh.render(t=0.3))


def test_handles_lead_where_they_say(still):
    keys = Key(0.0), Key(0.25, (5.0, 0.0))
    handle = Handle((32, 24), 6, keys, "linear")
    layer = LayerMotion(pins=(), handles=(handle,))
    image = still.animated(Motion({"disc": layer}, loop=False, **SHORT))
    track = image.layers["disc"].track
    nodes = image.layers["disc"].mesh.refined.nodes / 1024
    near = np.hypot(*(nodes - (32, 24)).T) < 5
    assert near.any()
    at = track.at(image.timeline, 0.25) / 1024
    assert np.abs(at[near] - (5, 0)).max() < 0.6


def test_edited_pictures_move(still):
    edited = (
        still.layers["disc"]
        .moved(6, 2)
        .layers["disc"]
        .dragged({(38, 16): (3, 0), (38, 36): (0, 0)})
    )
    image = edited.animated(preset(edited, "sway", together=False, **SHORT))
    np.testing.assert_array_equal(image.render(), edited.render())
    disc = image.at(0.2).layers["disc"].pose
    assert disc.shift == (6 << 10, 2 << 10)
    assert disc.nodes is not None
    assert disc.sway.any()


def test_progress_is_told(still):
    seen = []
    motion = replace(preset(still, "sway", **SHORT), loop=False)
    still.animated(motion, progress=lambda done, total: seen.append((done, total)))
    assert [done for done, _ in seen] == list(range(1, len(seen) + 1))
    assert {total for _, total in seen} == {len(seen)}
    assert len(seen) >= 5


def test_layers_that_touch_move_as_one(still):
    # The disc reaches to y = 38, where the bar begins.
    image = still.animated(preset(still, "sway", together=True, **SHORT))
    bar, disc = (image.layers[k] for k in ("bar", "disc"))
    assert bar.track.body == disc.track.body
    apart = still.animated(preset(still, "sway", together=False, **SHORT))
    assert apart.layers["bar"].track.body != apart.layers["disc"].track.body


def test_what_cannot_move_is_told(still):
    hidden = still.layers["bar"].hidden()
    assert list(boxes(hidden)) == ["disc"]
    for picture, names, said in (
        (still, ["back"], "back of an opaque picture"),
        (still, [0], "back of an opaque picture"),
        (hidden, ["bar"], "hidden"),
        (still, ["cat"], "no layer 'cat'"),
    ):
        with pytest.raises(UsageError, match=said):
            boxes(picture, names)
    alone = changed(still, layers=Layers([still.layers["back"]]))
    with pytest.raises(UsageError, match="no layer that can move"):
        boxes(alone)
    with pytest.raises(UsageError, match="no layer that can move"):
        alone.animated(Motion({"*": LayerMotion()}, **SHORT))
    for name, said in (("back", "back of an opaque"), ("cat", "no layer 'cat'")):
        with pytest.raises(UsageError, match=said):
            still.animated(Motion({name: LayerMotion()}, **SHORT))


def test_what_flies_away_is_refused(still):
    motion = Motion({"disc": LayerMotion()}, loop=False, gravity=(1e6, 0), drag=0, **SHORT)
    with pytest.raises(LimitError, match="flung"):
        still.animated(motion)
