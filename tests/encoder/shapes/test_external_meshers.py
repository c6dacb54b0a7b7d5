import sys

import numpy as np
import pytest

from proxyimg_codec import plugins
from proxyimg_codec.encoder.shapes import external_meshers
from proxyimg_codec.errors import InputError, UnsupportedError, UsageError
from proxyimg_codec.geometry.boundary import Boundary
from proxyimg_codec.geometry.mesher import delaunay, fill, rim, sound
from proxyimg_codec.geometry.outline import outline
from tests.support.meshes import SHAPES, check, lengths, spare

RING = Boundary(2, tuple(SHAPES["ring"]))
SIZE = (400, 400)
MESHERS = {"triwild": "wildmeshing", "ftetwild": "pytetwild"}


@pytest.fixture(params=MESHERS)
def name(request):
    return request.param


@pytest.fixture
def real(name):
    """The mesher of that name, if its package is here."""
    pytest.importorskip(MESHERS[name])
    return plugins.find("meshers", name)


@pytest.fixture
def pretend(monkeypatch):
    """pretend(code) is the mesh of a mesher with a worker that runs other code."""

    def call(code, name="triwild", boundary=RING, edge=0.1):
        monkeypatch.setattr(external_meshers, "worker", lambda: [sys.executable, "-c", code])
        return plugins.find("meshers", name)(boundary, SIZE, edge)

    return call


def saved(points, parts):
    """Code of a worker that returns what two expressions give."""
    return f"""
import numpy as np
given = np.load("in.npz")
columns = given["points"].shape[1]
np.savez("out.npz", points={points}, parts={parts})
"""


def test_they_are_found_by_name():
    assert plugins.names("meshers")[:3] == ["delaunay", "triwild", "ftetwild"]
    assert plugins.find("meshers", "delaunay") is delaunay


def test_real_meshers_fill_rings(real, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    mesh = real(RING, SIZE, 0.1)
    assert not list(tmp_path.iterdir())
    check(mesh)
    assert len(rim(mesh.triangles)) == 2
    assert spare(mesh, RING.paths) >= 1
    assert sound(mesh, outline(RING, SIZE, 0.1).covered)


def test_the_edge_length_acts_on_a_bare_rectangle(real):
    """TriWild for one ignores it if it gets nothing but the rectangle."""
    diagonal = np.hypot(*SIZE)
    counts = []
    for edge in (0.08, 0.2):
        mesh = real(None, SIZE, edge)
        check(mesh)
        assert 0.7 < np.median(lengths(mesh)) / (edge * diagonal) < 1.6
        counts.append(len(mesh.triangles))
    assert counts[0] > 4 * counts[1]


@pytest.mark.parametrize("shape", ["pixel", "horizontal line", "hourglass"])
def test_triwild_fills_odd_shapes(shape):
    pytest.importorskip("wildmeshing")
    boundary = Boundary(2, tuple(SHAPES[shape]))
    mesh = external_meshers.triwild(boundary, (2000, 1300), 0.05)
    check(mesh)
    assert spare(mesh, boundary.paths) >= 1


@pytest.mark.parametrize(
    "code",
    [
        "import os; os.abort()",
        "raise MemoryError('too much')",
        "import sys; sys.exit(1)",
        "pass",
        "open('out.npz', 'w').write('x' * 1000)",
        "open('out.npz', 'w')",
        "import numpy as np; np.savez('out.npz', other=np.zeros(3))",
        "import numpy as np; a = np.array([{}]); np.savez('out.npz', points=a, parts=a)",
        saved("np.zeros((0, columns))", "np.zeros((0, columns + 1), int)"),
        saved("given['points'] * np.nan", "np.arange(columns + 1)[None]"),
        saved("given['points']", "np.arange(columns + 1)[None] + 10**6"),
        saved("given['points']", "np.arange(columns + 1)[None] - 1"),
        saved("given['points'][:, :1]", "np.arange(columns + 1)[None]"),
        saved("given['points'][0]", "np.arange(columns + 1)"),
        saved("given['points']", "np.arange(columns + 1)[None] / 2"),
        saved("given['points'].astype(complex)", "np.arange(columns + 1)[None]"),
    ],
)
def test_failures_of_the_process_are_one_error(pretend, code):
    with pytest.raises(InputError, match=r"mesher triwild .*use --mesh delaunay"):
        pretend(code)


def test_reasons_are_passed_on(pretend, name):
    with pytest.raises(InputError, match=rf"mesher {name} .*status 1 \(MemoryError: too much\)"):
        pretend("raise MemoryError('too much')", name)


def test_endless_processes_are_stopped(pretend, monkeypatch):
    monkeypatch.setattr(external_meshers, "SECONDS", 0.3)
    with pytest.raises(InputError, match=r"longer than 0.3 seconds"):
        pretend("import time; time.sleep(60)")


def test_missing_packages_are_named(pretend, name):
    # The real worker, in a process that cannot import the mesher.
    code = f"""
import sys
sys.modules["{MESHERS[name]}"] = None
from proxyimg_codec.encoder.shapes.external_meshers import main
sys.exit(main("{name}"))
"""
    with pytest.raises(UnsupportedError, match=r"pip install 'proxyimg-codec\[meshers\]'"):
        pretend(code, name)


def test_impossible_edge_lengths_are_refused(name):
    with pytest.raises(UsageError, match="edge length"):
        plugins.find("meshers", name)(None, SIZE, 2.0)


def test_meshes_that_do_not_cover_the_shape_are_made_anew(pretend):
    """A worker that returns a single triangle: its corners are used, the rest is ours."""
    code = saved("[[150.0, 150], [250, 150], [150, 250]]", "[[0, 1, 2]]")
    mesh = pretend(code, boundary=None, edge=0.5)
    check(mesh)
    shape = outline(None, SIZE, 0.5)
    assert sound(mesh, shape.covered)
    corners = (
        np.rint(np.array([[150, 150], [250, 150], [150, 250]]) / shape.scale).astype(int).tolist()
    )
    assert all(c in mesh.vertices.tolist() for c in corners)


def test_good_meshes_are_kept_whatever_their_orientation(pretend):
    shape = outline(None, SIZE, 0.1)
    # A mesh made anew would have no vertex so close to the rim.
    given = fill(shape, np.append(shape.points[::2], [(3, 100)], axis=0))
    code = saved(
        f"np.array({(given.vertices * shape.scale + 0.01).tolist()})",
        f"np.array({given.triangles[:, ::-1].tolist()})",
    )
    mesh = pretend(code, boundary=None)
    assert len(mesh.triangles) == len(given.triangles)
    assert (mesh.vertices == given.vertices).all()
