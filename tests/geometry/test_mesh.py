import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from proxyimg_codec.errors import FormatError, LimitError
from proxyimg_codec.geometry import connectivity
from proxyimg_codec.geometry.mesh import Base, Mesh
from proxyimg_codec.limits import Budget, Limits
from tests.support.meshes import lattice


def shape(base):
    """What a base is, whatever its order."""
    return sorted(
        tuple(sorted(map(tuple, base.vertices[t].tolist()))) for t in base.triangles.tolist()
    )


def areas(nodes, faces):
    a, b, c = (nodes[faces[:, k]] for k in range(3))
    ab, ac = b - a, c - a
    return ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0]


def edges_of(faces):
    return [tuple(e) for t in faces.tolist() for e in zip(t, t[1:] + t[:1], strict=True)]


@given(st.integers(0, 10**6), st.integers(2, 9), st.integers(2, 9), st.floats(0.3, 1))
@settings(max_examples=60, deadline=None)
def test_coding_keeps_the_mesh(seed, columns, rows, share):
    # Holes, several components and vertices where two parts touch come from the random choice.
    rng = np.random.default_rng(seed)
    count = 2 * (columns - 1) * (rows - 1)
    keep = np.unique(np.append(np.flatnonzero(rng.random(count) < share), 0))
    base = lattice(columns, rows, keep)
    base = Base(base.origin, base.step, base.vertices, rng.permutation(base.triangles))
    decoded = Mesh(Mesh.build(base).fields).base
    assert shape(decoded) == shape(base)
    assert (decoded.origin, decoded.step) == (base.origin, base.step)
    assert (areas(decoded.vertices.astype(int), decoded.triangles) > 0).all()


def test_what_comes_out_goes_in_unchanged():
    once = Mesh.build(lattice(7, 6))
    assert Mesh.build(once.base).fields == once.fields


def test_regular_meshes_cost_little():
    fields = Mesh.build(lattice(18, 20)).fields
    size = sum(len(fields[k]) for k in ("symbols", "classes", "deltas"))
    assert size < 646 * 3 / 8  # fewer than three bits a triangle, vertices included


@given(st.integers(0, 10**6), st.floats(0, 1), st.floats(0, 1))
@settings(max_examples=40, deadline=None)
def test_refined_faces_conform_and_cover_the_same(seed, first, second):
    rng = np.random.default_rng(seed)
    plain = Mesh.build(lattice(5, 5, step=(1024, 1024)))
    one = rng.random(len(plain.base.triangles)) < first
    two = rng.random(4 * one.sum()) < second
    three = rng.random(4 * two.sum()) < 0.3
    mesh_ = Mesh(plain.split([one, two, three]).fields)
    refined = mesh_.refined
    area = areas(refined.nodes, refined.faces)
    assert (area > 0).all()
    assert area.sum() == areas(refined.nodes, mesh_.base.triangles).sum()
    # No node lies inside an edge of a face: each inner edge belongs to two faces, and each outer
    # one is a part of the outline of the base.
    directed = edges_of(refined.faces)
    known = set(directed)
    assert len(known) == len(directed)
    border = {e for e in directed if (e[1], e[0]) not in known}
    length = sum(np.hypot(*(refined.nodes[a] - refined.nodes[b])) for a, b in border)
    base_edges = set(edges_of(mesh_.base.triangles))
    outer = [e for e in base_edges if (e[1], e[0]) not in base_edges]
    want = sum(np.hypot(*(refined.nodes[a] - refined.nodes[b])) for a, b in outer)
    assert length == pytest.approx(want)
    inner = refined.parents[len(mesh_.base.vertices) :]
    ends = refined.nodes[inner]
    np.testing.assert_array_equal(refined.nodes[len(mesh_.base.vertices) :], ends.sum(1) >> 1)


def test_split_flags_come_back():
    plain = Mesh.build(lattice(4, 4))
    rng = np.random.default_rng(1)
    flags = [rng.random(18) < 0.5]
    flags.append(rng.random(4 * flags[0].sum()) < 0.5)
    back = Mesh(plain.split(flags).fields).splits
    assert [f.tolist() for f in back] == [f.tolist() for f in flags]


@pytest.mark.parametrize(
    ("triangles", "said"),
    [
        ([(0, 1, 2), (0, 1, 3)], "twice"),
        ([(0, 2, 1)], "positive"),
        ([(0, 1, 2)], "no triangle"),
    ],
)
def test_what_is_no_mesh_is_not_built(triangles, said):
    vertices = np.array([(0, 0), (9, 0), (0, 9), (9, 9)], np.uint8)
    if said == "positive":
        vertices = vertices[:3]
    with pytest.raises(ValueError, match=said):
        Mesh.build(Base((0, 0), (4, 4), vertices, np.array(triangles, np.int32)))


def test_damage_is_found():
    fields = Mesh.build(lattice(5, 5, [0, 1, 2, 5, 8, 9, 20, 21])).fields
    rng = np.random.default_rng(0)
    found = 0
    for key in ("symbols", "classes", "deltas"):
        for at in range(len(fields[key])):
            data = bytearray(fields[key])
            data[at] ^= 1 << rng.integers(8)
            damaged = Mesh({**fields, key: bytes(data)})
            try:
                base = damaged.base
            except FormatError:
                found += 1
            else:
                assert (areas(base.vertices.astype(int), base.triangles) > 0).all()
    assert found > 30


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"vertices": 4}, "stream|length|connectivity"),
        ({"gates": 4}, "stream|connectivity"),
        ({"far": [0]}, "connectivity"),
        ({"levels": 1}, "truncated"),
        ({"splits": b"\0"}, "end where"),
    ],
)
def test_wrong_counts_are_refused(change, said):
    fields = Mesh.build(lattice(4, 4)).fields
    with pytest.raises(FormatError, match=said):
        _ = Mesh({**fields, **change}).refined


def test_refinement_is_bounded():
    plain = Mesh.build(lattice(4, 4))
    fine = plain.split([np.ones(18, bool), np.ones(72, bool)])
    with pytest.raises(LimitError, match="faces"):
        _ = Mesh(fine.fields, budget=Budget(Limits(faces=100))).refined


def test_numbers_of_symbols_do_not_meet():
    assert connectivity.BORDER < connectivity.NEW < connectivity.RANKED < connectivity.FAR < 16
