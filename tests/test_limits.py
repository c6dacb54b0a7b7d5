"""Limits are one budget for all parts of a file, and for all of a picture that is drawn."""

from dataclasses import replace

import msgpack
import numpy as np
import pytest

from fuzz import bombs
from proxyimg_codec import from_bytes
from proxyimg_codec.container import file, meta, undo
from proxyimg_codec.container.chunks import Chunk, read, write
from proxyimg_codec.container.fields import unpack
from proxyimg_codec.container.undo import Step
from proxyimg_codec.errors import FormatError, LimitError
from proxyimg_codec.geometry.coverage import coverage
from proxyimg_codec.geometry.warp import barycentric
from proxyimg_codec.limits import DEFAULT_LIMITS, SMALL_FILE, Budget, Limits
from proxyimg_codec.model import Layers
from proxyimg_codec.validation.validate import validate
from tests.support import moving
from tests.support.images import changed
from tests.support.paths import ROOT


@pytest.fixture(scope="module")
def picture():
    return moving.picture()


def first_that_works(name, work):
    """The smallest value of a limit with which `work` does not refuse."""
    low, high = 0, getattr(DEFAULT_LIMITS, name)
    while low < high:
        middle = (low + high) // 2
        try:
            work(changed(DEFAULT_LIMITS, **{name: middle}))
        except LimitError:
            low = middle + 1
        else:
            high = middle
    if low:
        with pytest.raises(LimitError, match=f"--limit {name}="):
            work(changed(DEFAULT_LIMITS, **{name: low - 1}))
    return low


def test_a_budget_adds_up_and_limits_do_not():
    limits = Limits(faces=10)
    limits.check("faces", 6)
    limits.check("faces", 6)
    other, budget = Budget(limits), Budget(limits)
    assert other.limits is budget.limits is limits
    other.spend("faces", 6)
    budget.spend("faces", 6)
    budget.spend("gates", 6)
    budget.spend("faces", 4)
    with pytest.raises(LimitError, match="faces: 11 exceeds the limit of 10"):
        budget.spend("faces", 1)


def lengthened(data, size):
    """A file of `size` bytes, by a chunk that no reader knows."""
    *chunks, tail = read(data)
    return write([*chunks, Chunk("teST", bytes(size - len(data) - 12)), tail])


@pytest.mark.parametrize(
    ("textures", "more", "name"),
    [
        ([bombs.view(8192, 4096)], {"planes": (bombs.plan(8192, 4096),)}, "small_samples"),
        ([bombs.codes(4096, 4096, b"a")], {"networks": (bombs.network(),)}, "small_codes"),
    ],
)
def test_small_files_may_hold_less(textures, more, name):
    data = bombs.made([bombs.layer()], textures, **more)
    count = 2 * getattr(DEFAULT_LIMITS, name)
    small = lengthened(data, SMALL_FILE)
    with pytest.raises(LimitError, match=f"--limit {name}="):
        file.parse(small)
    with pytest.raises(LimitError, match=f"--limit {name}="):
        file.parse(small, Limits(**{name: count - 1}))
    file.parse(small, Limits(**{name: count}))
    file.parse(lengthened(data, SMALL_FILE + 1))


def test_what_small_files_may_not_hold_makes_longer_ones():
    planes = (bombs.plan(8192, 4096),)
    large = bombs.made([bombs.layer()], [bombs.view(8192, 4096)], planes=planes)
    image = from_bytes(large, Limits(small_samples=1 << 25))
    data = image.to_bytes()
    assert len(data) == SMALL_FILE + 12
    again = from_bytes(data)
    assert not again.extra
    assert again.to_bytes() == data
    assert not validate(data)


def test_metadata_history_and_script_count_together(picture):
    content = file.parse(picture.to_bytes())
    steps = (Step("{}", (Chunk("TEXR", bytes(5000)),)),)
    full = replace(content, blocks={"icc": bytes(700), "xmp": bytes(300)}, history=steps)
    data = file.serialize(full)
    assert content.motion["size"]
    own = next(c for c in read(data) if c.type == "uNDO")
    history = unpack(undo.FIELDS, own.payload, "")["size"]
    assert history > 5000
    found = first_that_works("metadata_bytes", lambda limits: from_bytes(data, limits))
    assert found == 1000 + content.motion["size"] + history
    assert first_that_works("metadata_bytes", lambda limits: file.parse(data, limits)) < found
    for limit, too_much in ((found, False), (found - 1, True)):
        said = {v.exit_code for v in validate(data, Limits(metadata_bytes=limit))}
        assert (LimitError.exit_code in said) == too_much


def test_a_history_makes_room_for_metadata(picture, monkeypatch):
    steps = tuple(Step(str(k), (Chunk("TEXR", bytes([k]) * 100),)) for k in range(9))
    content = replace(file.parse(picture.to_bytes()), history=steps, motion=None)
    monkeypatch.setattr(undo, "SIZE_MAX", 700)
    assert file.parse(file.serialize(content)).history == steps[-4:]
    wide = replace(content, blocks={"icc": bytes(300)})
    assert file.parse(file.serialize(wide)).history == steps[-2:]


def test_what_is_written_has_no_more_metadata_than_readers_accept(picture):
    block = bytes((1 << 25) + 1)
    with pytest.raises(LimitError, match="metadata"):
        changed(picture, blocks={"icc": block, "xmp": block}).to_bytes()


def test_faces_of_all_meshes_count_together(picture):
    def split(layer):
        if layer.mesh is None:
            return layer
        flags = [np.ones(len(layer.mesh.base.triangles), bool)]
        return changed(layer, mesh=layer.mesh.split(flags), track=None)

    layers = Layers(map(split, picture.layers))
    data = changed(picture, layers=layers, timeline=None).to_bytes()

    def opened(limits):
        for layer in from_bytes(data, limits).layers:
            _ = layer.mesh and layer.mesh.refined

    counts = [4 * len(v.mesh.base.triangles) for v in layers if v.mesh is not None]
    assert len(counts) > 1
    assert first_that_works("faces", opened) == sum(counts)


def test_multiplications_of_all_layers_count_together(picture):
    """Each sample of each layer, and the networks where they show."""
    data = picture.to_bytes()

    def drawn(names):
        return first_that_works(
            "multiply_adds",
            lambda limits: from_bytes(data).render(width=16, layers=names, limits=limits),
        )

    both, back = drawn(["back", "disc"]), drawn(["back"])
    samples = 64 * 48
    network = picture.networks[0].shape.parameters
    assert back == samples * (1024 + network)
    # The disc hides nothing of the back where it is seen in part only.
    assert 1024 * samples < both - back
    assert both < 2 * samples * 1024 + 2 * samples * network


def test_work_counts_edges_and_their_pieces():
    square = np.array([[0, 0], [0, 0], [9, 0], [9, 0], [9, 0], [9, 9], [9, 9], [9, 9], [0, 9],
                       [0, 9], [0, 9], [0, 0]], np.int64) * 256  # fmt: skip

    def covered(limits):
        coverage([square], 0, 0, 10, 10, Budget(limits))

    # The chords; and their pieces, for those that go down or up are cut by rows.
    least, chords = first_that_works("work", covered), 48
    assert 4 + 2 * 9 < least - chords < 200
    far = first_that_works("work", lambda limits: coverage([square], 0, 20, 10, 10, Budget(limits)))
    assert far == 0


def test_parts_of_a_boundary_are_drawn_as_the_whole():
    rng = np.random.default_rng(3)
    path = rng.integers(-2000, 12000, (60, 2))
    whole = coverage([path], 0, 0, 40, 40)
    for y in range(0, 40, 7):
        for x in range(0, 40, 9):
            part = coverage([path], x, y, 5, 6)
            assert np.array_equal(part[: 40 - y, : 40 - x], whole[y : y + 6, x : x + 5])


def test_points_on_a_mesh_are_bounded_even_if_its_faces_hold_them():
    nodes = np.array([[0, 0], [1000, 0], [0, 1000]])
    points = np.full((480, 2), 100)
    faces = np.array([[0, 1, 2]] * 50, np.int32)
    found, _ = barycentric(points, nodes, faces, Budget(Limits(beyond=500)))
    assert (found == 0).all()
    with pytest.raises(LimitError, match="beyond"):
        barycentric(points, nodes, faces, Budget(Limits(beyond=499)))


def history(content):
    """A file with such a history."""
    chunks = read((ROOT / "spec" / "example.pxi").read_bytes())[:-1]
    packed = msgpack.packb(content)
    own = [undo.digest(chunks), len(packed), meta.compressed(packed)]
    return write([*chunks, Chunk("uNDO", msgpack.packb(own)), Chunk("TAIL", b"")])


@pytest.mark.parametrize(
    "content",
    [
        [[], [["", [0] * 1000] for _ in range(4000)]],
        [[[]] * 1_000_000, []],
        [[[[]] * 1000 for _ in range(200)], []],
        [[], {}, {}],
    ],
)
def test_many_items_in_a_history_are_refused_before_they_fill_memory(content):
    with pytest.raises((LimitError, FormatError)):
        from_bytes(history(content), Limits(references=1 << 12))


def test_many_arrays_in_a_payload_are_refused():
    chunks = read((ROOT / "spec" / "example.pxi").read_bytes())
    for content in ([[[]] * 1000], [{}] * 1000, [[1] * ((1 << 20) - 1)] * 2):
        more = Chunk("tREE", msgpack.packb(content))
        with pytest.raises(FormatError, match="msgpack"):
            from_bytes(write([*chunks[:-1], more, chunks[-1]]))


def test_too_little_memory_is_a_limit(monkeypatch):
    def fails(*_):
        raise MemoryError

    data = (ROOT / "spec" / "example.pxi").read_bytes()
    monkeypatch.setattr("proxyimg_codec.texture.network.unpack", fails)
    with pytest.raises(LimitError, match="memory"):
        from_bytes(data)
    assert {v.exit_code for v in validate(data)} == {6}
