"""Pictures and layers as values: they copy, pickle, compare, and go when nobody needs them."""

import copy
import gc
import pickle
import tracemalloc
import weakref
from dataclasses import replace

import numpy as np
import pytest

import proxyimg_codec as pxi
from conformance.make.builders import Numbers, disc, on_back
from proxyimg_codec import model
from proxyimg_codec.container.chunks import Chunk, read
from proxyimg_codec.model import Layers
from tests.support import moving, pyramids
from tests.support.files import MOVING, SMALL
from tests.support.images import changed
from tests.support.paths import ROOT


def edited_image():
    """A picture that moves, with a history, a group and metadata."""
    plain = changed(
        moving.picture(), blocks={"icc": b"profile", "xmp": b"<x/>"}, extra=(Chunk("teSt", b"1"),)
    )
    return plain.edited(
        {"op": "group", "layers": ["bar", "disc"], "name": "both"},
        {"op": "move", "layer": "disc", "by": [3, -2]},
    )


def damaged_image():
    """What is left of a file that was cut off."""
    data = (ROOT / "spec" / "example.pxi").read_bytes()
    chunks = read(data)
    end = len(data) - 12 - len(chunks[-1].payload)
    found = pxi.from_bytes(data[:end], tolerant=True)
    assert found.damage
    return found


IMAGES = {
    "edited": edited_image,
    "cut": pyramids.cut_picture,
    "damaged": damaged_image,
}
COPIES = {
    "pickle": lambda v: pickle.loads(pickle.dumps(v)),
    "oldest pickle": lambda v: pickle.loads(pickle.dumps(v, protocol=0)),
    "deep copy": copy.deepcopy,
    "copy": copy.copy,
}


@pytest.fixture(params=IMAGES)
def image(request, made_up_planes):
    return IMAGES[request.param]()


@pytest.fixture(params=COPIES)
def copied(request):
    return COPIES[request.param]


def fields_of(image):
    """What a picture holds beside its layers."""
    names = ("size", "channels", "opaque", "depth", "blocks", "info", "groups", "history", "damage",
             "timeline")  # fmt: skip
    held = {name: getattr(image.picture, name) for name in names}
    return {**held, "extra": [(v.type, v.payload) for v in image.extra]}


# Copies


def test_copies_of_an_image(image, copied):
    again = copied(image)
    assert type(again) is pxi.Image
    assert again == image
    assert hash(again) == hash(image)
    assert fields_of(again) == fields_of(image)
    assert [v.name for v in again.layers] == [v.name for v in image.layers]
    np.testing.assert_array_equal(again.render(), image.render())
    assert again.to_bytes() == image.to_bytes()
    if image.timeline:
        np.testing.assert_array_equal(again.render(t=0.3), image.render(t=0.3))
    if image.history:
        assert again.undone().to_bytes() == image.undone().to_bytes()


def test_copies_of_a_picture(image, copied):
    again = copied(image.picture)
    assert type(again) is model.Picture
    assert fields_of(again) == fields_of(image)
    assert pxi.Image(again) == image
    np.testing.assert_array_equal(pxi.Image(again).render(), image.render())
    with pytest.raises(TypeError):
        again.groups["new"] = None


def test_copies_of_a_layer(image, copied):
    """Also once what it knows of its picture was asked for."""
    layer = image.layers[-1]
    before = layer.data
    again = copied(layer)
    assert type(again) is pxi.Layer
    assert again == layer
    assert again.data is again.image.picture.layers[again.position]
    assert again.moved_neighbours == layer.moved_neighbours
    assert again.moved(1, 0) == layer.moved(1, 0)
    assert layer.data is before


def test_an_image_too_large_for_a_reader_pickles():
    """Limits are for files of others."""
    large = changed(moving.picture(), blocks={"icc": bytes(1 << 25), "xmp": bytes((1 << 25) + 1)})
    with pytest.raises(pxi.LimitError):
        large.to_bytes()
    assert pickle.loads(pickle.dumps(large)).blocks == large.blocks


@pytest.mark.encoder
def test_copies_of_settings_limits_and_regions(copied):
    settings = pxi.Settings(effort=7, texture="implicit", quality=31.5)
    assert copied(settings) == settings
    assert copied(pxi.Limits(layers=7)) == pxi.Limits(layers=7)
    region = copied(pxi.Region("é", np.eye(7, 5, dtype=bool)))
    assert region.name == "é"
    np.testing.assert_array_equal(region.mask, np.eye(7, 5, dtype=bool))


@pytest.mark.parametrize(
    "error",
    [
        pxi.UsageError("no such layer"),
        pxi.LimitError("too many", rule="SEC-1"),
        pxi.FormatError("it is odd", "chunk TEXR", 12, rule="CON-7"),
        pxi.FormatError("it is odd", offset=7),
    ],
    ids=str,
)
def test_copies_of_errors(error, copied):
    """As processes of a pool hand them over."""
    again = copied(error)
    assert type(again) is type(error)
    assert (str(again), vars(again)) == (str(error), vars(error))


# Equality


def test_equal_is_what_has_equal_files(image):
    loaded = pxi.from_bytes(image.to_bytes())
    assert loaded == image
    assert hash(loaded) == hash(image)
    assert {image: 1}[loaded] == 1
    moved = image.edited({"op": "move", "layer": image.layers[-1].name, "by": [1, 0]})
    assert moved != image
    assert moved.undone() == image
    assert hash(moved.undone()) == hash(image)
    assert moved.baked() != moved
    assert image != "an image"
    assert image != image.picture


def test_there_and_back_differs_by_its_history():
    image = moving.picture()
    there = image.layers["disc"].moved(4, 0)
    back = there.layers["disc"].moved(-4, 0)
    assert back.chunks == image.chunks
    assert back != image
    assert back.baked() == image


def test_layers_are_equal_by_picture_and_place(image):
    loaded = pxi.from_bytes(image.to_bytes())
    for k, layer in enumerate(image.layers):
        assert layer == loaded.layers[k]
        assert hash(layer) == hash(loaded.layers[layer.name])
        assert layer.position == k
    assert len({*image.layers, *loaded.layers}) == len(image.layers)
    assert image.layers[0] != image.layers[-1]
    assert image.layers[0] != image.layers[0].data
    other = changed(image, blocks={"xmp": b"other"})
    assert other.layers[0] != image.layers[0]


# Layers


def test_layers_by_name_and_position():
    layers = moving.picture().layers
    assert isinstance(layers, model.Layers)
    assert [v.name for v in layers] == ["back", "bar", "disc"]
    assert len(layers) == 3
    assert all(type(v) is pxi.Layer for v in layers)
    assert layers["bar"] == layers[1] == layers[-2]
    assert layers[-3] == layers[0]
    assert layers[1:] == (layers[1], layers[2])
    assert layers[::-1] == tuple(reversed(layers))
    assert layers[5:] == ()
    assert layers.index(layers["disc"]) == 2
    assert layers["disc"] in layers


@pytest.mark.parametrize("key", ["Bar", "", 3, -4])
def test_layers_that_are_not_there(key):
    with pytest.raises(pxi.UsageError, match=r"there is no layer .*; the picture has 'back'"):
        moving.picture().layers[key]


def test_a_handle_shows_the_data_of_its_layer():
    image = moving.picture()
    for k, layer in enumerate(image.layers):
        data = image.picture.layers[k]
        assert layer.data is data
        for name in ("name", "box", "boundary", "texture", "mesh", "sampling", "pose", "parent",
                     "track"):  # fmt: skip
            assert getattr(layer, name) is getattr(data, name)
        assert layer.network is image.networks[0]
        assert repr(layer) == f"<Layer {data.name!r} of {image!r}>"
    assert repr(image) == "<Image 64x48, layers 'back', 'bar', 'disc'>"


def test_handles_are_light_and_share_the_picture():
    image = moving.picture()
    again = pxi.Image(image)
    assert again.picture is image.picture
    assert pxi.Image(image.picture) == image
    assert image.picture.picture is image.picture


# Memory


@pytest.fixture
def uncollected():
    """Without the garbage collector: only what is in no cycle goes."""
    gc.collect()
    gc.disable()
    yield
    gc.enable()


USES = {
    "nothing": lambda v: None,
    "rendered": lambda v: v.render(),
    "layers": lambda v: [(u.data, u.outline, u.moved_neighbours, u.network) for u in v.layers],
    "saved": lambda v: v.to_bytes(),
    "compared": lambda v: v == pxi.from_bytes(v.to_bytes()),
    "edited": lambda v: v.layers[-1].moved(1, 0).render(),
    "undone": lambda v: v.layers[-1].moved(1, 0).undone().render(),
    "baked": lambda v: v.layers[-1].rotated(5).baked(),
    "copied": copy.deepcopy,
}


@pytest.mark.parametrize("use", USES)
def test_an_image_goes_with_its_last_name(image, use, uncollected):
    own = pxi.Image(replace(image.picture))  # pytest holds what the fixture gave
    gone = [weakref.ref(own), weakref.ref(own.picture)]
    USES[use](own)
    del own
    assert [ref() for ref in gone] == [None, None]


@pytest.mark.parametrize("use", [lambda v: v.at(0.4), lambda v: v.at(0.4).render(),
                                 lambda v: v.render(t=0.4)])  # fmt: skip
def test_a_picture_that_moves_goes_too(use, uncollected):
    image = moving.picture()
    gone = [weakref.ref(image), weakref.ref(image.picture)]
    made = use(image)
    gone += [weakref.ref(made)]
    del image, made
    assert [ref() for ref in gone] == [None, None, None]


def test_an_edit_does_not_hold_what_it_was_made_from(uncollected):
    image = moving.picture()
    gone = [weakref.ref(image), weakref.ref(image.picture)]
    edited = image.layers["disc"].moved(1, 0)
    del image
    assert [ref() for ref in gone] == [None, None]
    assert edited.undone().layers["disc"].pose == moving.picture().layers["disc"].pose


def test_memory_does_not_grow(uncollected):
    """Opening and drawing again and again, beyond what is kept for reuse."""
    n = Numbers("memory")
    data = pxi.Image(on_back(n, disc(n))).to_bytes()

    def work(times):
        for _ in range(times):
            pxi.from_bytes(data).layers["disc"].moved(1, 0).undone().render(width=12)

    tracemalloc.start()
    try:
        work(70)  # `lru_cache`s hold 64
        before = tracemalloc.get_traced_memory()[0]
        work(20)
        grown = tracemalloc.get_traced_memory()[0] - before
    finally:
        tracemalloc.stop()
    assert grown < 20 * 1500


@pytest.mark.parametrize("how", [copy.copy, copy.deepcopy, lambda v: pickle.loads(pickle.dumps(v))])
def test_a_moment_of_a_motion_survives_copies(how):
    """It is displaced by less than a file can say."""
    moment = pxi.open(MOVING).at(0.13)
    again = how(moment)
    assert again == moment
    np.testing.assert_array_equal(again.render(scale=2), moment.render(scale=2))
    assert moment != pxi.open(MOVING).at(0.31)


def test_the_layers_of_an_image_survive_copies(copied):
    image = pxi.open(SMALL)
    for layers in (image.layers, image.layers["disc"].moved(2, 1).layers):
        again = copied(layers)
        assert again == layers
        assert [layer.name for layer in again] == [layer.name for layer in layers]


def test_nothing_of_a_handle_can_be_set():
    image = pxi.open(SMALL)
    for handle in (image, image.layers["disc"]):
        for name in ("picture", "name", "anything"):
            with pytest.raises(AttributeError):
                setattr(handle, name, 1)


def test_layers_are_equal_as_their_images_are():
    image, moved = pxi.open(SMALL), pxi.open(SMALL).layers["disc"].moved(1, 0)
    assert image.layers == image.layers == pxi.open(SMALL).layers
    assert hash(image.layers) == hash(pxi.open(SMALL).layers)
    assert image.layers != moved.layers
    assert pxi.Layer(image, -1) == image.layers[-1]
    with pytest.raises(pxi.UsageError):
        pxi.Layer(image, 3)


def test_no_operation_is_no_other_image():
    image = pxi.open(SMALL)
    assert image.edited() is image


def test_pictures_whose_layers_were_replaced_by_hand_are_saved(made_up_planes):
    picture = pyramids.cut_picture().picture
    fewer = pxi.Image(replace(picture, layers=Layers(picture.layers[:-1]), info=None))
    assert [v.name for v in pxi.from_bytes(fewer.to_bytes()).layers] == [
        v.name for v in picture.layers[:-1]
    ]
