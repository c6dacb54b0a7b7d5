import hashlib
import importlib
import re
from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from conformance import pixels
from conformance.cases import load
from proxyimg_codec.api import from_bytes
from proxyimg_codec.container import chunks, file
from proxyimg_codec.entropy import arrays, laplace, rans
from proxyimg_codec.errors import FormatError
from proxyimg_codec.geometry import boundary, connectivity, coverage, deltas, mesh, pose, warp
from proxyimg_codec.geometry.mesh import Base, Mesh
from proxyimg_codec.geometry.pose import REST, Pose
from proxyimg_codec.limits import Limits
from proxyimg_codec.model import Layer, Layers
from proxyimg_codec.texture import (
    completion,
    context,
    diffusion,
    lifts,
    planes,
    pyramid,
    registered_model,
)
from proxyimg_codec.texture.grid import Grid
from proxyimg_codec.texture.implicit import ImplicitTexture
from proxyimg_codec.texture.latents import Latents
from proxyimg_codec.texture.network import NetShape, Network
from tests.support.images import image as image_of
from tests.support.meshes import lattice
from tests.support.paths import ROOT

SPEC = ROOT / "spec"
NUMBERED = sorted(SPEC.glob("[0-9]*.md"), key=lambda p: int(p.name.partition("-")[0]))
CHAPTERS = {p.name: p.read_text("utf-8") for p in (SPEC / "README.md", *NUMBERED)}
PREFIXES = (
    "SCO", "CON", "CHK", "ENT", "GEO", "MSH", "TEX", "PYR", "REN", "MOT", "MET", "LEV", "SEC",
    "REG", "NUM", "VER", "",
)  # fmt: skip
IDS = dict(enumerate(PREFIXES, 1))
PARTS = re.findall(r"^<!-- ((?!end )[^\n]+) -->$", "".join(CHAPTERS.values()), re.M)


def tool(name):
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(ROOT))
        return importlib.import_module(f"spec.{name}")


def remembered(decode):
    """A function that decodes equal maps once: several tests look at the same planes."""
    known: dict = {}

    def decode_planes(plan):
        key = repr(plan)
        if key not in known:
            known[key] = decode(plan)
        return known[key]

    return decode_planes


@pytest.fixture(scope="module")
def program():
    """The names of the program that the Python blocks of the chapters make together."""
    blocks = re.findall(r"^```python\n(.*?)^```$", "".join(CHAPTERS.values()), re.M | re.S)
    names: dict = {}
    exec("\n".join(blocks), names)
    names["MODELS"] = ROOT / names["MODELS"]
    names["decode_planes"] = remembered(names["decode_planes"])
    return names


@pytest.fixture(scope="module")
def example():
    return (SPEC / "example.pxi").read_bytes()


@pytest.mark.parametrize("name", PARTS)
def test_generated_parts_are_what_the_code_says(name):
    tables = tool("tables")
    if name != "pixels":
        assert tables.shown()[name] == tables.wanted(name), "run python -m spec.tables --write"


def test_no_part_is_forgotten():
    assert sorted(PARTS) == sorted(tool("tables").PARTS)


def test_pixels_of_the_example_are_within_the_tolerance(example):
    rows = tool("tables").shown()["pixels"].splitlines()[1:-1]
    shown = [list(bytes.fromhex(row)) for row in rows]
    rendered = from_bytes(example).render().reshape(len(rows), -1)
    np.testing.assert_allclose(shown, rendered, atol=1, rtol=0)


def test_registry_is_what_the_code_says():
    tables = tool("tables")
    assert tables.REGISTRY.read_text("utf-8") == tables.registry_text(), "see above"


def test_ids_are_unique_and_belong_to_their_chapter():
    ids = []
    for number, text in enumerate(CHAPTERS.values()):
        found = re.findall(r"^\*\*\[([A-Z]{3})-(\d+)\]\*\* ", text, re.M)
        assert {prefix for prefix, _ in found} <= {IDS.get(number)}
        assert [int(n) for _, n in found] == list(range(1, len(found) + 1))
        ids += [f"{prefix}-{n}" for prefix, n in found]
    assert len(set(ids)) == len(ids) > 80
    named = re.findall(r"\b([A-Z]{3}-\d+)\b", "".join(CHAPTERS.values()))
    named = {n for n in named if n[:3] in IDS.values()}
    assert named <= set(ids)


def test_links_lead_somewhere():
    for text in CHAPTERS.values():
        for target in re.findall(r"\]\(([^)]+)\)", text):
            assert (SPEC / target).exists(), target


def table(chapter):
    """Names and values of a table of constants."""
    rows = re.findall(r"^\| `(\w+)` \| ([\d^]+) \|", CHAPTERS[chapter], re.M)
    return {name: eval(value.replace("^", "**")) for name, value in rows}


@pytest.mark.parametrize(
    ("chapter", "modules", "count"),
    [
        ("4-entropy.md", (rans, arrays), 7),
        ("5-geometry.md", (boundary, coverage), 5),
        ("7-implicit.md", (diffusion,), 2),
        ("6-mesh-and-pose.md", (connectivity, mesh, pose, warp), 17),
        (
            "8-pyramid.md",
            (registered_model, context, laplace, planes, pyramid, completion, lifts),
            16,
        ),
    ],
)
def test_constants_are_those_of_the_code(chapter, modules, count):
    shown = table(chapter)
    names = {k: v for m in modules for k, v in vars(m).items()}
    assert shown == {k: names[k] for k in shown}
    assert len(shown) == count


def test_limits_are_those_of_the_code():
    assert table("13-security.md") == {f.name: f.default for f in fields(Limits)}


def test_prefix_is_that_of_the_code():
    text = CHAPTERS["2-container.md"]
    assert f"`{chunks.SIGNATURE.hex(' ').upper()}` (signature)" in text
    assert "major version: {} |\n| 9 | u8 | minor version: {} |".format(*chunks.VERSION) in text


@pytest.mark.parametrize("bits", range(1, 9))
def test_program_decodes_arrays(program, bits):
    rng = np.random.default_rng(bits)
    for shape in ((1, 1, 1), (2, 9, 4), (3, 5, 11), (1, 40, 40)):
        stored = rng.random(shape[1:]) < rng.choice([0.3, 0.9, 1.1])
        smooth = np.cumsum(rng.integers(-1, 2, shape), 2) + (1 << bits >> 1)
        values = np.where(stored, np.clip(smooth, 0, (1 << bits) - 1), 0)
        data = arrays.encode(values, bits, stored)
        positions = {(int(y), int(x)) for y, x in np.argwhere(stored)}
        got = program["decode_array"](data, *shape, bits, positions)
        assert got == {(c, y, x): values[c, y, x] for c in range(shape[0]) for y, x in positions}


def test_steps_of_the_worked_example(program, monkeypatch):
    steps, known = [], program["Rans"].symbol

    def recorded(self, lane, frequencies):
        slot, at = self.states[lane] % (1 << 14), self.at
        s = known(self, lane, frequencies)
        used = "yes" if self.at > at else "no"
        state = f"`0x{self.states[lane]:08x}`"
        steps.append([*map(str, (slot, s, sum(frequencies[:s]), frequencies[s])), used, state])
        return s

    monkeypatch.setattr(program["Rans"], "symbol", recorded)
    text = CHAPTERS["4-entropy.md"]
    data = bytes.fromhex(re.search(r"^bytes (.*)$", text, re.M)[1])
    program["decode_array"](data, 1, 2, 4, 5, program["everywhere"](2, 4) - {(0, 3)})
    rows = re.findall(r"^\| \d+ \| \d, \d \| \d+ \| (.*) \|$", text, re.M)
    assert [row.split(" | ") for row in rows] == steps


def random_boundary(rng, size=3000, unit=3):
    sizes = rng.integers(1, 6, 3)
    return boundary.Boundary(unit, tuple(rng.integers(-size, size, (3 * m, 2)) for m in sizes))


@pytest.mark.parametrize("size", [2, 40, 3000, 1 << 25])
def test_program_decodes_boundaries(program, size):
    b = random_boundary(np.random.default_rng(size), size)
    paths = program["decode_boundary"](boundary.encode(b))
    assert [np.array(p).tolist() for p in paths] == [p.tolist() for p in b.paths]


@pytest.mark.parametrize("seed", range(8))
def test_program_computes_coverage(program, seed):
    rng = np.random.default_rng(seed)
    b = random_boundary(rng, int(rng.choice([30, 300, 3000])), int(rng.integers(7)))
    view = (b.unit, int(rng.integers(5)), int(rng.integers(1, 40)), int(rng.integers(1, 40)))
    scaled = [np.stack([coverage.to_output(p[:, i], *view) for i in (0, 1)], 1) for p in b.paths]
    paths = [[tuple(program["scale"](v, *view) for v in xy) for xy in p.tolist()] for p in b.paths]
    assert paths == [[tuple(xy) for xy in p.tolist()] for p in scaled]
    want = coverage.coverage(scaled, 0, 0, 24, 18)
    assert program["coverage"](paths, 24, 18) == want.tolist()


@pytest.mark.parametrize("shape", [(2, 2), (5, 3), (9, 16), (13, 13)])
def test_program_fills_codes(program, shape):
    rng = np.random.default_rng(shape)
    for share in (0.05, 0.5, 1.0):
        stored = rng.random(shape) < share
        stored[tuple(rng.integers(shape))] = True
        codes = rng.integers(-128, 128, (1, *shape))
        got = program["fill"]((codes[0] * 256).tolist(), stored.tolist())
        assert got == diffusion.fill(codes, stored)[0].tolist()


@given(st.lists(st.integers(1 - (1 << 31), (1 << 31) - 1) | st.integers(-9, 9), min_size=1))
@settings(max_examples=30, deadline=None)
def test_program_decodes_signed_integers(program, values):
    rows = np.array([values, values[::-1]], np.int64)
    got = program["decode_signed"](*deltas.encode(rows), 2, len(values))
    assert got == rows.tolist()


def random_mesh(rng, columns=4, rows=4, levels=2, origin=(-4, -3), step=(560, 600), share=0.8):
    """A mesh with holes, parts that touch in a point, and uneven refinement."""
    count = 2 * (columns - 1) * (rows - 1)
    keep = np.unique(np.append(np.flatnonzero(rng.random(count) < share), 0))
    base = lattice(columns, rows, keep)
    triangles = rng.permutation(base.triangles)
    plain = Mesh.build(Base(origin, step, base.vertices, triangles))
    flags, count = [], len(triangles)
    for _ in range(levels):
        flags.append(rng.random(count) < 0.4)
        flags[-1][rng.integers(count)] = True
        count = 4 * int(flags[-1].sum())
    return plain.split(flags)


def decoded(program, made):
    """A mesh as the program sees it."""
    return program["decode_mesh"](made.fields)


@pytest.mark.parametrize("seed", range(12))
def test_program_decodes_meshes(program, seed):
    rng = np.random.default_rng(seed)
    step = (1, 3) if seed % 3 == 0 else (560, 1 << 24)
    made = random_mesh(rng, *rng.integers(2, 8, 2), seed % 5, step=step)
    nodes, ends, faces = decoded(program, made)
    want = made.refined
    assert nodes == [tuple(v) for v in want.nodes.tolist()]
    assert ends == [tuple(v) for v in want.parents.tolist()]
    assert faces == [tuple(v) for v in want.faces.tolist()]


def test_program_decodes_meshes_with_far_symbols(program):
    # Two parts that touch in a point: at the start of the second no gate is open.
    made = Mesh.build(lattice(4, 4, [0, 1, 8, 9, 17]))
    assert len(made.fields["far"]) >= 1
    assert decoded(program, made)[2] == [tuple(v) for v in made.refined.faces.tolist()]


def random_pose(rng, made, reach=40, affine=True):
    count = len(made.refined.nodes)
    nodes, places = rng.integers(-reach, reach + 1, (2, count, 2))
    matrix, shift = REST.matrix, REST.shift
    if affine:
        matrix = tuple(rng.integers(-1 << 25, 1 << 25, 4).tolist())
        shift = tuple(rng.integers(-9000, 9000, 2).tolist())
    kind = rng.integers(4)
    return Pose(
        matrix, shift, nodes if kind != 1 else None, places if kind != 2 else None,
        int(rng.integers(65536)), False,
        tuple(rng.integers(-4096, 4097, 12).tolist()) if kind % 2 else (),
    )  # fmt: skip


def fields_of(posed, made):
    """The map of a POSE."""
    return pose.encode(posed, made)


def as_lists(values):
    return None if values is None else [tuple(v) for v in values.tolist()]


def test_program_decodes_the_mesh_of_the_worked_example(program):
    made = tool("tables").MESH
    assert decoded(program, made)[2] == [tuple(v) for v in made.refined.faces.tolist()]


@pytest.mark.parametrize("seed", range(8))
def test_program_decodes_poses(program, seed):
    rng = np.random.default_rng(seed)
    made = random_mesh(rng, levels=seed % 4)
    posed = random_pose(rng, made, int(rng.choice([3, 900, (1 << 24) - 1])))
    fields, there = fields_of(posed, made), decoded(program, made)
    for kind, values in (("node", posed.nodes), ("place", posed.places)):
        assert program["displacements"](fields, kind, there) == as_lists(values)


@pytest.mark.parametrize("seed", range(12))
def test_program_finds_outlines(program, seed):
    rng = np.random.default_rng(seed)
    wide = seed % 4 == 3  # positions beyond what weights are computed from
    step = (90000, 120000) if wide else (560, 600)
    origin = (-(1 << 21), 5) if wide else (-4, -3)
    made = random_mesh(rng, 3, 4, origin=origin, step=step, levels=1)
    reach = int(rng.choice([30, (1 << 24) - 1]))
    posed = random_pose(rng, made, reach, affine=seed % 3 > 0)
    size = (160, 1 << 21)
    shape = None
    if seed % 6:
        shape = random_boundary(rng, int(rng.choice([100, 1 << 25])), int(rng.integers(7)))
    paths = None if shape is None else [[tuple(p) for p in path.tolist()] for path in shape.paths]
    unit = 0 if shape is None else shape.unit
    moves = as_lists(None if posed.nodes is None else 64 * posed.nodes)
    got = program["outline"](
        paths, unit, size, fields_of(posed, made), moves, decoded(program, made)
    )
    want = warp.outline(shape, posed, made, size)
    if want is None:
        assert got == (None, 0)
        return
    assert got[1] == want.unit
    assert [[list(p) for p in path] for path in got[0]] == [p.tolist() for p in want.paths]


@pytest.mark.parametrize("seed", range(8))
def test_program_finds_texture_points(program, seed):
    rng = np.random.default_rng(seed)
    made = random_mesh(rng)
    posed = random_pose(rng, made, affine=seed % 3 > 0)
    fields, there = fields_of(posed, made), decoded(program, made)
    moves = as_lists(None if posed.nodes is None else 64 * posed.nodes)
    places = as_lists(posed.places)
    locate = program["chart"](fields, moves, places, there, posed.bent)
    chart = warp.Warp(posed, made, posed.bent)
    y, x = (v.ravel() for v in np.mgrid[0:12, 0:16] + 0.5)
    grid = np.zeros(2), np.ones(2), (0, 0, 16, 12)
    shown = chart.locate(x, y, chart.faces(*grid).ravel() if posed.bent else None)
    got = [locate(*p) for p in zip(x.tolist(), y.tolist(), strict=True)]
    points = np.array([u for u, _, _ in got])
    np.testing.assert_allclose(points, np.stack([shown.x, shown.y], 1), atol=1e-6)
    if posed.bent:
        faces = made.refined.faces[shown.face].tolist()
        assert [list(face) for _, face, _ in got] == faces
        np.testing.assert_allclose([w for _, _, w in got], shown.weights, atol=1e-6)


def random_layer(rng, k, channels, dim, sampling):
    """A network and the parts of a layer: texture, mesh and pose."""
    bits = int(rng.integers(2, 9))
    shape = NetShape(dim, int(rng.integers(4)), 5, int(rng.integers(1, 4)), channels)
    top = 1 << (bits - 1)
    weights = [rng.integers(-top, top, (o, i)).astype(np.int8) for i, o in shape.layers]
    steps = rng.uniform(0.1, 0.4, shape.rows) / top
    biases = rng.uniform(0, 0.5, shape.rows)
    net = Network(shape, bits, tuple(weights), *map(np.float16, (steps, biases)))
    stored = rng.random((5, 4)) < 0.6
    stored[2, 1] = True
    features = dim // 2 if sampling == 1 else dim
    codes = np.where(stored, rng.integers(-top, top, (features, 5, 4)), 0).astype(np.int8)
    made = random_mesh(rng, levels=int(rng.integers(3)), share=0.9)
    texture = ImplicitTexture(k, bits, np.float16([1 / top] * features), codes, stored)
    return net, texture, made, random_pose(rng, made, affine=k != 1)


def random_image(seed):
    """16x12 pixels: two layers with networks, a third that shows a texture of theirs, a hidden one.

    Three are posed; of an opaque picture's back layer only the texture is displaced. Unlike what
    any encoder makes.
    """
    rng = np.random.default_rng(seed)
    channels, sampling = 3 + seed % 2, seed // 2 % 4
    nets, layers = [], []
    for k in range(2):
        kind = sampling if k else 0
        net, texture, made, posed = random_layer(rng, k, channels if k else 3, 4, kind)
        if k == 0 and channels == 3:
            posed = replace(REST, places=posed.places)
        nets.append(net)
        shape_of = random_boundary(rng, 128) if k else None
        layers.append(Layer(f"layer {k}", (-2, 1, 15, 9), shape_of, texture, made, kind, posed))
    made = random_mesh(rng)
    posed, shape_of = random_pose(rng, made), random_boundary(rng, 128)
    texture = layers[1].texture
    layers.append(Layer("copy", (3, 2, 9, 8), shape_of, texture, made, sampling, posed))
    hidden = Pose(hidden=True)
    layers.append(Layer("hidden", (0, 0, 16, 12), None, layers[0].texture, None, 0, hidden))
    return image_of(16, 12, channels, channels == 3, 8, Layers(layers), tuple(nets))


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("view", [((0, 0, 16, 12), (16, 12)), ((3, 2, 11, 7), (4, 19))])
def test_program_renders_as_the_package_does(program, seed, view):
    image = random_image(seed)
    got = np.array(program["decode"](image.to_bytes(), *view))
    want = image.render(region=view[0], width=view[1][0], height=view[1][1])
    assert got.shape == want.shape
    assert close(got, want)


def test_program_decodes_the_example(program, example):
    assert np.abs(np.array(program["decode"](example)) - from_bytes(example).render()).max() <= 1


def test_program_refuses_a_damaged_example(program, example):
    for at in range(len(example)):
        data = bytearray(example)
        data[at] ^= 0x55
        with pytest.raises((program["Invalid"], program["Unsupported"])):
            program["read_chunks"](bytes(data))


def close(got, want):
    """Whether 8-bit pixels agree with others within the tolerance."""
    off = np.abs(got.astype(float) - want)
    if want.shape[2] == 4:
        off[want[..., 3] == 0, :3] = 0
        assert off[want[..., 3] < 16].max(initial=0) <= 2
        off = off[want[..., 3] >= 16]
    return off.max(initial=0) <= 1


def test_program_has_the_distributions_of_the_package(program):
    tables = laplace.tables()
    for row, ends in enumerate(tables.ends):
        found = np.cumsum([0, *program["distribution"](row // 16, row % 16)])
        assert ends[: len(found)].tolist() == found.tolist()
        assert (ends[len(found) :] == 1 << 14).all()


def random_planes(rng, size, levels, components, spread, model):
    """Planes of random latents, with holes, shifts and escapes."""
    grid = Grid(size, levels, registered_model.registration(model).padded)
    found = []
    for level in range(levels):
        shape = 9, *grid.at(level + 1)
        values = np.rint(rng.laplace(0, spread, shape)) * (rng.random(shape) < 0.5)
        values[3:] *= components == 3 and (level > 0 or spread < 100)
        found.append(np.clip(values, -65535, 65535).astype(np.int32))
    lowest = np.rint(rng.normal(0, 40, (3, *grid.at(levels)))).astype(np.int32)
    lowest[1:] *= components == 3
    cell = int(rng.integers(1, 4))
    cells = rng.random(planes.cells_of(size, cell)) < 0.7
    cells.flat[0] = True
    shifts = tuple(rng.integers(-8, 8, 2 * levels).tolist())
    step = int(rng.integers(0, 641))
    latents = Latents(tuple(found), lowest)
    return planes.encoded(latents, size, step, cells, cell, components, model, shifts)


@pytest.mark.parametrize("seed", range(9))
def test_program_decodes_planes(program, seed):
    rng = np.random.default_rng(seed)
    size = tuple(rng.integers(1, 14, 2).tolist())
    spread = (0.5, 8, 9000)[seed % 3]
    components, model = 1 if seed == 4 else 3, 1 if seed > 5 else 2
    made = random_planes(rng, size, 1 + seed % 4, components, spread, model)
    fields = dict(made.packed)
    lowest, levels = program["decode_planes"](fields)
    want = planes.unpack(fields)
    np.testing.assert_array_equal(lowest, want.latents.lowest)
    for got, level in zip(levels, want.latents.levels, strict=True):
        np.testing.assert_array_equal(got, level)
    if spread < 100:
        np.testing.assert_allclose(program["raster_of"](fields), want.raster, atol=1e-4)


def test_sums_of_the_context_are_exact_in_single_precision():
    """As chapter 8 says of all registered models: whatever the inputs, below 2**24."""
    inputs = {"first": 127, "second": 255, "causal": 127, "mix": 255, "luma": 255,
              "from_luma": 127, "chroma": 255}  # fmt: skip
    for number in registered_model.REGISTERED:
        for level in registered_model.registered(number).context:
            step = np.abs(level.first_by_step.values) * 347 >> 8
            for name, most in inputs.items():
                weights = np.abs(getattr(level, name).values)
                total = most * weights.reshape(len(weights), -1).sum(1)
                if name != "causal":
                    total = total + np.abs(getattr(level, f"{name}_bias").values)
                total = total + (step + 1 if name == "first" else 0)
                assert total.max() < 1 << 24, name


CASES = [c for c in load() if not c.error]


@pytest.mark.parametrize("case", [c for c in CASES if c.name.startswith("moves-")],
                         ids=lambda c: c.name)  # fmt: skip
def test_program_moves_nodes(program, case):
    data = case.input.read_bytes()
    fields = file.parse(data).motion
    image = from_bytes(data)
    meshes = {k: decoded(program, image.layers[k].mesh) for k in fields["layers"]}
    for number, (curves, shapes) in program["decode_motion"](fields, meshes).items():
        track = image.layers[number].track
        assert np.array(shapes).tolist() == track.shapes.tolist()
        assert curves == track.curves.tolist()
        for t in (0, 1, 123456, 7_000_003, 10**9 + 1, -1, -777_777, 1000 * fields["duration"]):
            found = program["displaced"](fields, curves, shapes, t)
            assert track.at(image.timeline, t / 1e6).tolist() == [list(p) for p in found]


@pytest.mark.parametrize("case", CASES, ids=lambda c: c.name)
def test_program_passes_the_conformance_suite(program, case):
    render = next((r for r in case.renders if "time" in r.args), case.renders[0])
    want = pixels.read(render.expected.read_bytes()) / 257
    args = render.args
    size = (want.shape[1], want.shape[0])
    data = case.input.read_bytes()
    time = round(args["time"] * 1e6) if "time" in args else None
    got = program["decode"](data, args.get("region"), size, args.get("layers"), time)
    assert close(np.array(got), want)


@pytest.mark.parametrize("case", [c for c in CASES if c.latents], ids=lambda c: c.name)
def test_program_decodes_the_latents_of_the_conformance_suite(program, case):
    found = hashlib.sha256()
    chunks = program["read_chunks"](case.input.read_bytes())
    for plan in program["maps"](chunks, "PLAN"):
        lowest, levels = program["decode_planes"](plan)
        for values in (lowest, *levels[::-1]):
            found.update(np.array(values, "<i4").tobytes())
    assert found.hexdigest() == case.latents


def test_dump_covers_every_byte(small_pxi, example, capsys):
    dump = tool("dump")
    posed = [
        c.input.read_bytes()
        for c in CASES
        if c.name in ("closing-deep", "shared", "undo", "pyramid-cells", "pyramid-escapes", "maps")
        or c.name in ("moves-layers", "moves-once")
    ]
    for data in (small_pxi.read_bytes(), example, *posed):
        assert sum(size for size, _ in dump.pieces(data)) == len(data)
    assert dump.main([str(SPEC / "example.pxi")]) == 0
    assert capsys.readouterr().out == "\n".join(dump.dump(example)) + "\n"
    shown = re.findall(r"^\w{6}  ((?:[\da-f]{2} ?)+)", "\n".join(dump.dump(example)), re.M)
    assert bytes.fromhex("".join(shown)) == example
    assert dump.main([str(SPEC / "README.md")]) == FormatError.exit_code


@pytest.mark.parametrize("name", ["invalid-value-more", "invalid-key-order", "unsupported-coder"])
def test_dump_passes_over_payloads_that_are_not_right(name):
    dump = tool("dump")
    data = {c.name: c for c in load()}[name].input.read_bytes()
    found = list(dump.pieces(data))
    assert sum(size for size, _ in found) == len(data)
    assert [meaning for _, meaning in found].count("payload") == 1


def test_dump_names_values_in_arrays_and_keys_in_maps():
    dump = tool("dump")
    data = {c.name: c.input.read_bytes() for c in CASES}["version-0-3"]
    lines = [meaning for _, meaning in dump.pieces(data)]
    at = lines.index("chunk HEAD")
    assert lines[at + 2 : at + 5] == ["map of 6 entries", "key 'size'", "  [32, 24]"]
    at = lines.index("chunk LAYR")
    assert lines[at + 2 : at + 5] == ["array of 7 values", "name: 'back'", "box: [0, 0, 32, 24]"]


def test_dump_prints_meshes_and_poses():
    dump = tool("dump")
    data = {c.name: c.input.read_bytes() for c in CASES}
    lines = list(dump.values(from_bytes(data["all-displaced"])))
    image = from_bytes(data["all-displaced"]).layers[1]
    nodes = [tuple(v) for v in image.mesh.refined.nodes.tolist()]
    at = lines.index(f"layer 'disc', {len(nodes)} nodes in 1/1024 pixel")
    assert lines[at + 1] == "  " + " ".join(map(str, nodes[:8]))
    for name in ("nodes", "texture"):
        assert f"layer 'disc', displacements of the {name} in 1/16 pixel" in lines
    assert "  matrix [10066329, 13421772, -13421773, 10066329] shift [12001, -6003]" in lines
    lines = list(dump.values(from_bytes(data["pyramid-moved"])))
    image = from_bytes(data["pyramid-moved"])
    at = lines.index("planes 0, level 3, latents of channel 8")
    (shown,) = {source for v in image.layers for source in v.texture.sources}
    numbers = [[int(v) for v in line.split()] for line in lines[at + 1 : at + 4]]
    assert numbers == shown.latents.levels[2][8].tolist()
    at = lines.index("layer 'disc', samples that show")
    assert (
        lines[at + 6].split() == image.layers[1].texture.shown[5].astype(int).astype(str).tolist()
    )
    lines = list(dump.values(from_bytes(data["moves-loop"])))
    track = from_bytes(data["moves-loop"]).layers["disc"].track
    at = lines.index("layer 'disc', body 0, coefficients of curves in 1/256")
    assert [int(v) for v in lines[at + 2].split()] == track.curves[1].tolist()
    at = lines.index("layer 'disc', shape 1")
    assert lines[at + 1] == "  " + " ".join(str(tuple(v)) for v in track.shapes[1, :8].tolist())
    lines = list(dump.values(from_bytes(data["shared"])))
    assert "layer 'copy' shows the texture of 'disc'" in lines
