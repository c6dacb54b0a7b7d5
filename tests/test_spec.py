import importlib
import re
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from proxyimg_codec.container import chunks
from proxyimg_codec.entropy import arrays, rans
from proxyimg_codec.errors import FormatError
from proxyimg_codec.geometry import boundary, coverage
from proxyimg_codec.image import Image, Layer, Layers, from_bytes
from proxyimg_codec.limits import Limits
from proxyimg_codec.texture import diffusion
from proxyimg_codec.texture.implicit import ImplicitTexture
from proxyimg_codec.texture.network import NetShape, Network

ROOT = Path(__file__).parents[1]
SPEC = ROOT / "spec"
CHAPTERS = {p.name: p.read_text("utf-8") for p in sorted(SPEC.glob("*.md"))}
IDS = {"1": "CON", "2": "CHK", "3": "ENT", "4": "GEO", "5": "TEX", "6": "REN", "7": "MET"}
PARTS = re.findall(r"^<!-- ((?!end )[^\n]+) -->$", "".join(CHAPTERS.values()), re.M)


def tool(name):
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(ROOT))
        return importlib.import_module(f"spec.{name}")


@pytest.fixture(scope="module")
def program():
    """The names of the program that the Python blocks of the chapters make together."""
    blocks = re.findall(r"^```python\n(.*?)^```$", "".join(CHAPTERS.values()), re.M | re.S)
    names: dict = {}
    exec("\n".join(blocks), names)
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


def test_ids_are_unique_and_belong_to_their_chapter():
    ids = []
    for name, text in CHAPTERS.items():
        found = re.findall(r"^\*\*\[([A-Z]{3})-(\d+)\]\*\* ", text, re.M)
        assert {prefix for prefix, _ in found} <= {IDS.get(name[0], "SEC")}
        assert [int(n) for _, n in found] == list(range(1, len(found) + 1))
        ids += [f"{prefix}-{n}" for prefix, n in found]
    assert len(set(ids)) == len(ids) > 80
    named = re.findall(r"\b([A-Z]{3}-\d+)\b", "".join(CHAPTERS.values()))
    named = {n for n in named if n[:3] in {*IDS.values(), "SEC"}}
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
        ("3-entropy.md", (rans, arrays), 7),
        ("4-geometry.md", (boundary, coverage), 5),
        ("5-texture.md", (diffusion,), 2),
    ],
)
def test_constants_are_those_of_the_code(chapter, modules, count):
    shown = table(chapter)
    names = {k: v for m in modules for k, v in vars(m).items()}
    assert shown == {k: names[k] for k in shown}
    assert len(shown) == count


def test_limits_are_those_of_the_code():
    assert table("8-security.md") == {f.name: f.default for f in fields(Limits)}


def test_prefix_is_that_of_the_code():
    text = CHAPTERS["1-container.md"]
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
    text = CHAPTERS["3-entropy.md"]
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


def random_image(seed):
    """16x12 pixels, two layers, one of them cut out; unlike what any encoder makes."""
    rng = np.random.default_rng(seed)
    channels = 3 + seed % 2
    nets, layers = [], []
    for k in range(2):
        bits = int(rng.integers(2, 9))
        shape = NetShape(3, int(rng.integers(4)), 5, int(rng.integers(1, 4)), channels)
        top = 1 << (bits - 1)
        weights = [rng.integers(-top, top, (o, i)).astype(np.int8) for i, o in shape.layers]
        steps = rng.uniform(0.1, 0.4, shape.rows) / top
        biases = rng.uniform(0, 0.5, shape.rows)
        nets.append(Network(shape, bits, tuple(weights), *map(np.float16, (steps, biases))))
        stored = rng.random((5, 4)) < 0.6
        stored[2, 1] = True
        codes = np.where(stored, rng.integers(-top, top, (3, 5, 4)), 0).astype(np.int8)
        texture = ImplicitTexture(k, bits, np.float16([1 / top] * 3), codes, stored)
        shape_of = random_boundary(rng, 128) if k else None
        layers.append(Layer(f"layer {k}", (-2, 1, 15, 9), shape_of, texture))
    return Image(16, 12, channels, channels == 3, 8, Layers(layers), tuple(nets))


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("view", [((0, 0, 16, 12), (16, 12)), ((3, 2, 11, 7), (4, 19))])
def test_program_renders_as_the_package_does(program, seed, view):
    image = random_image(seed)
    got = np.array(program["decode"](image.to_bytes(), *view), int)
    want = image.render(region=view[0], width=view[1][0], height=view[1][1]).astype(int)
    assert got.shape == want.shape
    off = np.abs(got - want)
    if image.channels == 4:
        off[want[..., 3] == 0, :3] = 0
        assert off[want[..., 3] < 16].max(initial=0) <= 2
        off = off[want[..., 3] >= 16]
    assert off.max(initial=0) <= 1


def test_program_decodes_the_example(program, example):
    assert np.abs(np.array(program["decode"](example)) - from_bytes(example).render()).max() <= 1


def test_program_refuses_a_damaged_example(program, example):
    for at in range(len(example)):
        data = bytearray(example)
        data[at] ^= 0x55
        with pytest.raises((program["Invalid"], program["Unsupported"])):
            program["read_chunks"](bytes(data))


def test_dump_covers_every_byte(small_pxi, example, capsys):
    dump = tool("dump")
    for data in (small_pxi.read_bytes(), example):
        assert sum(size for size, _ in dump.pieces(data)) == len(data)
    assert dump.main([str(SPEC / "example.pxi")]) == 0
    assert capsys.readouterr().out == "\n".join(dump.dump(example)) + "\n"
    shown = re.findall(r"^\w{6}  ((?:[\da-f]{2} ?)+)", "\n".join(dump.dump(example)), re.M)
    assert bytes.fromhex("".join(shown)) == example
    assert dump.main([str(SPEC / "README.md")]) == FormatError.exit_code
