import numpy as np
import pytest

from proxyimg_codec.encoder.settings import Settings
from proxyimg_codec.encoder.shapes.layers import plan_layers
from proxyimg_codec.encoder.shapes.masks import Region
from proxyimg_codec.encoder.shapes.meshes import gradient, refined, with_meshes
from proxyimg_codec.errors import UsageError
from proxyimg_codec.geometry import coverage as cover
from proxyimg_codec.geometry.mesh import Base, Mesh
from proxyimg_codec.geometry.raster import rasterize
from proxyimg_codec.io.samples import to_float
from proxyimg_codec.render.compose import outline
from proxyimg_codec.render.view import make_view
from tests.support.pictures import disc, smooth


def planned(settings, masks=True):
    picture = to_float(smooth(96, 64))[0]
    regions = [Region("disc", disc(96, 64))] if masks else [Region("all", np.ones((64, 96), bool))]
    return with_meshes(picture, plan_layers(picture, settings, regions), settings)


def test_every_layer_has_a_mesh_but_a_lone_back():
    assert all(layer.mesh is not None for layer in planned(Settings(texture="implicit")).layers)
    assert [layer.mesh for layer in planned(Settings(mesh="none")).layers] == [None, None]
    assert [layer.mesh for layer in planned(Settings(texture="implicit"), masks=False).layers] == [
        None
    ]


def test_meshes_are_the_same_every_time():
    one, two = (planned(Settings(texture="implicit")).layers for _ in range(2))
    assert [a.mesh.fields for a in one] == [b.mesh.fields for b in two]


def test_a_mesh_holds_its_layer_with_room_to_spare():
    for layer in planned(Settings(texture="implicit")).layers:
        faces = layer.mesh.refined
        corners = (faces.nodes / 1024)[faces.faces]
        held = rasterize(corners + 8, 0, 0, 112, 80) >= 0
        paths = outline(layer.boundary, make_view((96, 64)))
        seen = np.ones((64, 96)) if paths is None else cover.coverage(paths, 0, 0, 96, 64)
        wanted = np.pad(seen > 0, 8)
        if layer.boundary is not None:  # two pixels all round
            wanted |= np.roll(wanted, 2, 0) | np.roll(wanted, -2, 0)
            wanted |= np.roll(wanted, 2, 1) | np.roll(wanted, -2, 1)
        assert held[wanted].all()


def test_an_unknown_mesher_is_refused():
    with pytest.raises(UsageError, match="'marching' is unknown; there are delaunay"):
        planned(Settings(mesh="marching"))


def square(size=60):
    """Two triangles over 0..size pixels."""
    corners = np.array([(0, 0), (size, 0), (0, size), (size, size)], np.uint8)
    return Mesh.build(
        Base((0, 0), (1024, 1024), corners, np.array([(0, 1, 2), (1, 3, 2)], np.int32))
    )


def test_nodes_gather_where_there_is_detail():
    detail = np.zeros((60, 60), np.float32)
    detail[:20, :20] = 1
    mesh = refined(square(), detail, 4)
    nodes = mesh.refined.nodes / 1024
    assert (nodes <= 21).all(1).sum() >= 8
    assert (nodes >= 40).all(1).sum() == 1  # the corner
    assert len(mesh.splits) == 3


def test_flat_pictures_and_single_pixels_stay_whole():
    assert len(refined(square(), np.ones((60, 60), np.float32), 3).splits) == 0
    tiny = np.zeros((60, 60), np.float32)
    tiny[0, 0] = 1
    nodes = refined(square(1), tiny, 3).refined.nodes
    assert len(nodes) == 4


def test_gradient_is_that_of_a_ramp():
    ramp = np.repeat(np.arange(8, dtype=np.float32)[None, :, None] / 8, 4, 2).repeat(6, 0)
    np.testing.assert_allclose(gradient(ramp)[:, 2:-2], 1, atol=1e-6)  # Sobel weighs 8 pixels
