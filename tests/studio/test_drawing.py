"""Pictures, textures, meshes and poses that the page draws with."""

import io
import json

import numpy as np
import pytest
from PIL import Image

import proxyimg_codec as pxi
from proxyimg_codec.geometry.mesh import FRACTION_BITS
from tests.support.edits import covered, grown

DRAG = {"op": "drag", "layer": "disc", "handles": [[32, 14, 6, -2], [32, 34, 0, 0]]}


@pytest.fixture
def made(studio, small_pxi):
    """A studio with the layers back, bar and disc."""
    studio = studio()
    studio.open(small_pxi)
    return studio


def texture(made, index, query=""):
    """Texture of a layer, uint8 [H, W, 4], and its box."""
    answer = made.get(f"/api/layers/{index}/texture{query}")
    width, height = int(answer.headers["x-width"]), int(answer.headers["x-height"])
    pixels = np.frombuffer(answer.content, np.uint8).reshape(height, width, 4)
    return pixels, [int(v) for v in answer.headers["x-box"].split(",")]


def mesh_points(mesh, nodes):
    """Points of all vertices that the page draws, for positions of the nodes."""
    skirt = [
        sum(w * np.array(nodes[int(n)]) for n, w in zip(v[:3], v[3:], strict=True))
        for v in mesh["skirt"]
    ]
    return np.array([*nodes, *skirt])


def test_the_exact_picture_is_that_of_every_reader(made, small_pxi):
    image = pxi.open(small_pxi)
    shown = np.array(Image.open(io.BytesIO(made.get("/api/render").content)))
    np.testing.assert_array_equal(shown, image.render())
    answer = made.get("/api/render?x=5&y=7&w=20&h=10&width=60&layers=2&format=raw")
    pixels = np.frombuffer(answer.content, np.uint8).reshape(30, 60, 4)
    assert answer.headers["x-height"] == "30"
    wanted = image.render(region=(5, 7, 20, 10), width=60, layers=[2])
    np.testing.assert_array_equal(pixels, wanted)


def test_textures_on_each_other_are_the_picture(made, small_pxi):
    canvas = np.zeros((48, 64, 3))
    for index in range(3):
        pixels, (x, y, width, height) = texture(made, index)
        part = canvas[y : y + height, x : x + width]
        alpha = pixels[..., 3:] / 255
        part[:] = part * (1 - alpha) + pixels[..., :3] * alpha
    assert np.abs(canvas - pxi.open(small_pxi).render().astype(float)).max() <= 2


def test_a_texture_is_at_rest_whatever_the_pose(made):
    first, box = texture(made, 2)
    state = made.get("/api/state").json()
    made.edit(
        {"op": "move", "layer": "disc", "by": [300, 0]}, {"op": "opacity", "layer": "disc",
        "value": 0.3}, {"op": "recolour", "layer": "disc", "hue": 90}, DRAG,
        {"op": "hide", "layer": "disc"},
    )  # fmt: skip
    again, box_again = texture(made, 2)
    np.testing.assert_array_equal(again, first)
    assert box_again == box
    after = made.get("/api/state").json()
    assert [v["texture"] for v in after["layers"]] == [v["texture"] for v in state["layers"]]
    assert after["layers"][2]["mesh"] != state["layers"][2]["mesh"]
    assert after["layers"][1]["mesh"] == state["layers"][1]["mesh"]
    assert after["layers"][2]["opacity"] == pytest.approx(0.3, abs=1e-4)
    changed = made.edit({"op": "point", "layer": "disc", "path": 0, "point": 0, "by": [4, 4]})
    assert changed["layers"][2]["texture"] != state["layers"][2]["texture"]
    double, _ = texture(made, 1, "?scale=2")
    single, _ = texture(made, 1)
    assert double.shape[0] == 2 * single.shape[0]


def test_a_texture_beyond_the_canvas_is_whole(made, small_pxi):
    before, _ = texture(made, 2)
    image = pxi.open(small_pxi)
    boundary = image.layers["disc"].boundary
    far = [{"op": "point", "layer": "disc", "path": 0, "point": k, "by": [40, 0]}
           for k in range(len(boundary.paths[0]))]  # fmt: skip
    made.edit(*far)
    pixels, (x, _, width, _) = texture(made, 2)
    assert x + width > 64
    assert pixels.shape[:2] == before.shape[:2]
    assert (pixels[..., 3] > 0).sum() == pytest.approx((before[..., 3] > 0).sum(), rel=0.02)


def test_a_texture_goes_on_beyond_the_outline_while_that_is_dragged(made):
    plain, (x, y, width, height) = texture(made, 2)
    whole, (left, top, across, down) = texture(made, 2, "?whole=1")
    assert (left < x < x + width < left + across, top < y < y + height < top + down) == (True, True)
    assert (whole[..., 3] == 255).all()
    part = whole[y - top : y - top + height, x - left : x - left + width].astype(int)
    solid = plain[..., 3] == 255
    assert np.abs(part - plain)[solid].max() <= 1
    back, box = texture(made, 0, "?whole=1")
    assert (box, back.shape) == ([0, 0, 64, 48], (48, 64, 4))


def test_what_others_hide_is_filled_in_the_texture(studio, pyramid, tmp_path):
    (tmp_path / "a.pxi").write_bytes(pxi.Image(pyramid.picture).to_bytes())
    made = studio()
    made.open(tmp_path / "a.pxi")
    image = pxi.Image(made.session.content.document.picture)
    away = image.layers["disc"].moved(500, 0).layers["bar"].moved(500, 0)
    shown = away.render(layers=["back"])
    pixels, _ = texture(made, 0)
    np.testing.assert_array_equal(pixels[..., :3], shown[..., :3])


def test_thumbnails_show_the_layer_as_it_is(made, small_pxi):
    answer = made.get("/api/layers/2/thumbnail.png?side=12")
    picture = Image.open(io.BytesIO(answer.content))
    assert max(picture.size) == 12
    made.edit({"op": "move", "layer": "disc", "by": [500, 0]})
    gone = np.array(Image.open(io.BytesIO(made.get("/api/layers/2/thumbnail.png").content)))
    assert not gone[..., 3].any()
    made.refused("missing", "GET", "/api/layers/3/thumbnail.png")


def test_a_mesh_covers_its_layer_and_follows_the_bending(made):
    rest = made.get("/api/layers/2/mesh").json()
    assert rest["bent"] is None
    points = mesh_points(rest, rest["nodes"])
    faces = np.array(rest["triangles"])
    a, b, c = (points[faces[:, k]] for k in range(3))
    outline = np.concatenate(made.get("/api/layers/2/outline").json()["paths"])[::3]

    def side(p, q, r):
        return (q[..., 0] - p[..., 0]) * (r[..., 1] - p[..., 1]) - (q[..., 1] - p[..., 1]) * (
            r[..., 0] - p[..., 0]
        )

    signs = np.stack([side(p, q, outline[:, None]) for p, q in ((a, b), (b, c), (c, a))])
    assert ((signs >= -1e-6).all(0) | (signs <= 1e-6).all(0)).any(1).all()
    for vertex in rest["skirt"]:
        assert sum(vertex[3:]) == pytest.approx(1)
    made.edit(DRAG)
    bent = made.get("/api/layers/2/mesh").json()
    assert bent["nodes"] == rest["nodes"]
    layer = made.session.content.document.picture.layers["disc"]
    wanted = layer.pose.present(layer.mesh.refined) / (1 << FRACTION_BITS)
    np.testing.assert_allclose(bent["bent"], wanted, atol=0.01)


def test_control_points_are_those_that_an_edit_moves(made):
    made.edit({"op": "rotate", "layer": "disc", "degrees": 30}, DRAG)
    before = made.get("/api/layers/2/outline").json()["paths"]
    paths = made.get("/api/state").json()["layers"][2]["paths"]
    assert [len(p) for p in before] == [3 * n for n in paths]
    inside = covered(pxi.Image(made.session.content.document.picture), "disc")
    x, y = np.rint(np.concatenate(before)[::3] - 0.5).astype(int).T
    assert grown(inside, 1)[y, x].all()
    assert grown(~inside, 2)[y, x].all()
    made.post("/api/undo")
    still = made.get("/api/layers/2/outline").json()["paths"]
    made.edit({"op": "point", "layer": "disc", "path": 0, "point": 3, "by": [5, -2]})
    after = made.get("/api/layers/2/outline").json()["paths"]
    moved = np.array(after[0]) - np.array(still[0])
    np.testing.assert_allclose(moved[3], [5, -2], atol=0.3)
    assert not np.delete(moved, 3, 0).any()
    assert made.get("/api/layers/0/outline").json() == {"paths": None}


def unpacked(data):
    """Header of poses, and displacements [F, N, 2] by the name of the layer."""
    length = int.from_bytes(data[:4], "little")
    header = json.loads(data[4 : 4 + length])
    found = {}
    for layer in header["layers"]:
        count = header["frames"] * layer["nodes"] * 2
        start = 4 + length + layer["offset"]
        values = np.frombuffer(data[start : start + 4 * count], "<f4")
        found[layer["name"]] = values.reshape(header["frames"], -1, 2)
    return header, found


def test_poses_are_those_that_readers_draw(made):
    asked = {"motion": {"version": 1, "preset": "sway", "duration": 0.5, "fps": 8}}
    answer = made.client.post("/api/motion", json={**asked, "layers": ["disc"]})
    assert answer.status_code == 200
    header, found = unpacked(answer.content)
    assert (header["frames"], header["seconds"], header["loop"]) == (4, 0.5, True)
    assert found.keys() == {"disc"}
    assert made.get("/api/state").json()["at"] == 0
    made.refused("missing", "GET", "/api/motion")

    state = made.edit({"op": "animate", "motion": json.loads(answer.headers["x-motion"])})
    assert state["timeline"]["seconds"] == 0.5
    assert state["timeline"]["motion"]["layers"].keys() == {"disc"}
    same_header, same = unpacked(made.get("/api/motion").content)
    assert same_header == header
    np.testing.assert_array_equal(same["disc"], found["disc"])
    picture = made.session.content.document.picture
    layer = picture.layers["disc"]
    for frame in range(4):
        wanted = layer.track.at(picture.timeline, frame / 8) / (1 << FRACTION_BITS)
        np.testing.assert_allclose(same["disc"][frame], wanted, atol=1e-3)
    assert header["layers"][0]["mesh"] == made.get("/api/layers/2/mesh").json()
    shown = made.get("/api/render?t=0.25&format=raw").content
    wanted = pxi.Image(picture).render(t=0.25)
    pixels = np.frombuffer(shown, np.uint8).reshape(48, 64, 4)[..., :3]
    np.testing.assert_array_equal(pixels, wanted)


def test_presets_can_be_changed(made):
    known = {v["name"]: v for v in made.get("/api/presets").json()}
    assert known["sway"]["pins"] == ["bottom"]
    motion = {"version": 1, "preset": "sway", "duration": 0.5, "fps": 8, "wind": {"gust": 0.1}}
    pin = {"at": [32, 14], "radius": 4}
    asked = {"motion": motion, "layers": ["disc"], "pins": [pin]}
    made_of_it = json.loads(made.client.post("/api/motion", json=asked).headers["x-motion"])
    assert made_of_it["wind"]["gust"] == 0.1
    assert made_of_it["wind"]["strength"] == 2.1
    assert made_of_it["layers"]["disc"]["pins"] == [pin]


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ({}, "motion"),
        ({"motion": {"version": 1}}, "neither 'layers' nor 'preset'"),
        ({"motion": {"version": 1, "preset": "tremble"}}, "tremble"),
        ({"motion": {"version": 1, "preset": 3}}, "preset"),
        ({"motion": {"version": 1, "preset": "sway"}, "layers": ["cat"]}, "cat"),
        ({"motion": {"version": 1, "preset": "sway"}, "layers": 3}, "layers"),
        ({"motion": {"version": 1, "preset": "sway", "duration": "x"}}, "duration"),
        ({"motion": {"version": 1, "preset": "sway", "fps": 1e9}}, "fps"),
        ({"motion": {"version": 1, "preset": "sway"}, "pins": "x"}, "pins"),
    ],
)
def test_motions_that_make_no_sense_are_refused(made, asked, said):
    assert said in made.refused("usage", "POST", "/api/motion", json=asked)
