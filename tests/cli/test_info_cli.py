"""pxi-info: what it says, and how little it needs; and what other light paths import."""

import json
import os
import subprocess
import sys

import pytest

import proxyimg_codec as pxi
from tests.support.images import changed
from tests.support.paths import ROOT

HEAVY = {"torch", "cv2", "onnx", "onnxruntime", "OpenImageIO", "tqdm"}


def test_json(tool, small_pxi, small_masks):
    facts = json.loads(tool("info", small_pxi, "--json").out)
    assert (facts["width"], facts["height"], facts["alpha"], facts["depth"]) == (64, 48, False, 8)
    assert facts["bytes"] == small_pxi.stat().st_size
    assert facts["bpp"] == pytest.approx(8 * facts["bytes"] / (64 * 48), abs=1e-4)
    back, bar, disc = facts["layers"]
    assert [v["name"] for v in (back, bar, disc)] == ["back", "bar", "disc"]
    assert (back["box"], back["segments"]) == ([0, 0, 64, 48], 0)
    for layer in (bar, disc):
        assert layer["area"] == pytest.approx(small_masks[layer["name"]].sum(), rel=0.05)
        assert layer["segments"] >= 2
    hidden = sum(mask.sum() for mask in small_masks.values())
    assert 0.95 * (64 * 48 - hidden) < back["area"] < 64 * 48
    assert facts["settings"]["effort"] == 1
    assert facts["encoder"].startswith("proxyimg-codec ")
    signature_and_version = 12
    assert sum(facts["chunk_bytes"].values()) + signature_and_version == facts["bytes"]
    parts = [v["boundary_bytes"] + v["texture_bytes"] for v in facts["layers"]]
    parts += [n["bytes"] for n in facts["networks"]]
    assert 0 < sum(parts) < facts["bytes"]


def test_text(tool, small_pxi):
    out = tool("info", small_pxi).out.decode()
    for part in ("64x48", "opaque", "layer 0 'back'", "layer 2 'disc'", "network 0", "effort"):
        assert part in out
    assert tool("info", "-", stdin=small_pxi.read_bytes()).out.decode() == out


def test_hostile_texts_cannot_write_to_the_terminal(tool, small_pxi, tmp_path):
    image = pxi.open(small_pxi)
    path = tmp_path / "a.pxi"
    info = {**image.info, "encoder": "\x1b[2Jme", "settings": "[" * 60000}
    layers = [changed(v, name=f"{v.name}\x1b[2J\n") for v in image.layers]
    changed(image, info=info, layers=type(image.layers)(layers)).save(path)
    out = tool("info", path).out
    assert b"\x1b" not in out
    assert b"me" in out
    facts = json.loads(tool("info", path, "--json").out)
    assert facts["settings"] is None
    assert facts["encoder"] == "\x1b[2Jme"


@pytest.mark.parametrize("flags", [(), ("--json",)])
def test_names_that_the_terminal_cannot_show(launch, small_pxi, tmp_path, flags):
    image = pxi.open(small_pxi)
    layers = [changed(v, name=f"{v.name} \u732b") for v in image.layers]
    changed(image, layers=type(image.layers)(layers)).save(tmp_path / "a.pxi")
    environment = {**os.environ, "PYTHONIOENCODING": "ascii"}
    out = launch("info", tmp_path / "a.pxi", *flags, env=environment).out
    assert b"\\u732b" in out


def test_usage(tool, small_pxi):
    tool("info", code=2)
    tool("info", small_pxi, "--scale", "2", code=2)
    assert tool("info", "--version").out.startswith(b"pxi-info ")


def imported(script: str, *args) -> set[str]:
    """Top-level modules that a script imports."""
    around = f"import sys; old = set(sys.modules); {script}; new = set(sys.modules) - old; "
    around += "print('|'.join({m.partition('.')[0] for m in new}), file=sys.stderr)"
    ran = subprocess.run(
        [sys.executable, "-c", around, *map(str, args)], capture_output=True, timeout=60, cwd=ROOT
    )
    assert ran.returncode == 0, ran.stderr.decode()
    return set(ran.stderr.decode().splitlines()[-1].split("|"))


def test_imports_of_the_package():
    modules = imported("import proxyimg_codec")
    assert "proxyimg_codec" in modules
    assert not modules & (HEAVY | {"numpy"})


def test_imports_of_info(small_pxi):
    script = "from proxyimg_codec.cli.info import main; main([sys.argv[1]])"
    modules = imported(script, small_pxi) - set(sys.stdlib_module_names)
    modules = {m for m in modules if "cython" not in m}
    assert modules <= {"proxyimg_codec", "msgpack", "zstandard", "_cffi_backend", "cffi"}


@pytest.mark.parametrize("suffix", [".png", ".ppm", ".npy"])
def test_imports_of_decoding(small_pxi, tmp_path, suffix):
    script = "from proxyimg_codec.cli.decode import main; "
    script += "main([sys.argv[1], sys.argv[2], '--engine', 'numpy', '--quiet'])"
    modules = imported(script, small_pxi, tmp_path / f"a{suffix}")
    assert "numpy" in modules
    assert not modules & HEAVY
    assert (tmp_path / f"a{suffix}").exists()


def test_info_starts_fast(small_pxi):
    """Less than 0.15 s above the bare interpreter, comparing the best of several runs.

    What counts is the time of the processor: other programs do not.
    """

    def seconds(*args) -> float:
        before = os.times()
        subprocess.run([sys.executable, *args], check=True, capture_output=True, cwd=ROOT)
        after = os.times()
        return after.children_user + after.children_system - sum(before[2:4])

    bare, info = [], []
    for i in range(20):
        bare.append(seconds("-c", "pass"))
        info.append(seconds("-m", "proxyimg_codec.cli.info", str(small_pxi)))
        if i >= 4 and min(info) - min(bare) < 0.15:
            break
    assert min(info) - min(bare) < 0.15


def test_edits_meshes_and_shared_textures_are_told(tool, small_pxi, tmp_path):
    path = tmp_path / "edited.pxi"
    tool("edit", small_pxi, path, "--duplicate", "disc=twin", "--move", "twin", "5,5",
         "--opacity", "twin", ".5", "--group", "pair=disc,twin")  # fmt: skip
    facts = json.loads(tool("info", path, "--json").out)
    twin = facts["layers"][3]
    assert (twin["name"], twin["shares"], twin["texture_bytes"]) == ("twin", 2, 0)
    assert twin["pose"] == ["moved", "translucent"]
    assert twin["grid"] == facts["layers"][2]["grid"]
    assert facts["layers"][0]["vertices"] > 3
    assert facts["layers"][2]["mesh_bytes"] > 20
    assert facts["groups"] == ["pair"]
    assert len(facts["edits"]) == 4
    text = tool("info", path).out.decode()
    assert "moved and translucent" in text
    assert "shared with layer 2" in text
    assert "edit 4: " in text


def test_motion_is_told(tool, moving_pxi, small_pxi):
    facts = json.loads(tool("info", moving_pxi, "--json").out)
    motion = facts["motion"]
    size = motion.pop("bytes")
    assert motion == {
        "seconds": 1.5, "loop": True, "fps": 8, "layers": ["bar", "disc"],
        "bodies": [1, 2], "intervals": 5, "modes": 2, "script_bytes": 33,
    }  # fmt: skip
    assert 0 < facts["chunk_bytes"]["mOTN"] - size < 60
    assert [v["moves"] for v in facts["layers"]] == [False, True, True]
    text = tool("info", moving_pxi).out.decode()
    assert "motion: 'bar', 'disc' for 1.5 s, in a loop, made for 8 frames a second" in text
    assert json.loads(tool("info", small_pxi, "--json").out)["motion"] is None
    assert "motion" not in tool("info", small_pxi).out.decode()


@pytest.mark.parametrize("content", [b"", b"hello world", "cut", "limited"])
@pytest.mark.parametrize("name", ["a b.pxi", "-"])
def test_errors_name_the_file(content, name, tool, small_pxi, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    whole = small_pxi.read_bytes()
    data = {"cut": whole[:-30], "limited": whole}.get(content, content)
    (tmp_path / "a b.pxi").write_bytes(data)
    flags = ["--limit", "layers=2"] if content == "limited" else []
    code = 6 if flags else 4
    err = tool("info", name, *flags, code=code, stdin=data).err
    place = "standard input" if name == "-" else name
    assert err.startswith(f"pxi-info: {place}: ")
    assert err.count(place) == 1


def test_what_lies_behind(tool):
    """Planes of a view's own, and references."""
    file = ROOT / "conformance/cases/behind/copies-behind/input.pxi"
    back, disc = json.loads(tool("info", file, "--json").out)["layers"]
    assert (back["behind"], back["behind_alpha"], back["offsets"], back["grain"]) == (2, 3, 5, 1)
    assert (disc["behind"], disc["offsets"]) == (None, 0)
    assert back["texture_bytes"] > 0
    out = tool("info", file).out.decode()
    assert ", planes 2 behind with alpha of planes 3, 5 offsets for cells of 2 samples" in out


def test_what_is_soft(tool):
    file = ROOT / "conformance/cases/mattes/matte/input.pxi"
    facts = json.loads(tool("info", file, "--json").out)
    assert [v["matte"] for v in facts["layers"]] == [None, 2, None]
    assert not facts["alpha"]
    assert ", planes 1 behind, soft by planes 2" in tool("info", file).out.decode()
