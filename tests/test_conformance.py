import contextlib
import functools
import io
import json
import shlex
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1]))

from conformance import invalid_posed, judge, make_cases, pixels, runner, symbols, wrong_decoders
from conformance.cases import FOLDER, Case, Render, flags, load
from conformance.judge import Ended
from conformance.processes import command_decoder, expand
from proxyimg_codec import from_bytes, kernel, pictures
from proxyimg_codec.cli import decode

CASES = load()
BY_NAME = {case.name: case for case in CASES}


def in_process(source, target, flags, fault=None):
    """The package's decoder, or a wrong one, without a process of its own."""
    with contextlib.ExitStack() as stack:
        said = stack.enter_context(contextlib.redirect_stderr(io.StringIO()))
        if fault:
            stack.enter_context(wrong_decoders.fault(fault))
            flags = [*flags, "--engine", "numpy"]
        code = decode.main([str(source), str(target), "--quiet", *flags])
    return Ended(code, said.getvalue())


@pytest.fixture
def no_kernel(monkeypatch):
    monkeypatch.setenv("PROXYIMG_NO_KERNEL", "1")
    kernel.library.cache_clear()
    yield
    monkeypatch.undo()
    kernel.library.cache_clear()


@pytest.fixture
def at_root(monkeypatch):
    monkeypatch.chdir(FOLDER.parents[1])


def problems(results):
    return [f"{r.case} {r.render}: {r.problem}" for r in results if not r.passed]


# The suite itself.


def test_the_generator_reproduces_the_cases():
    assert make_cases.differences() == []


def test_differences_are_noticed(tmp_path, capsys, monkeypatch):
    made = {n: make_cases.build()[n] for n in ("pixel", "invalid-empty", "limit-grid")}
    monkeypatch.setattr(make_cases, "build", lambda: made)
    make_cases.write(tmp_path)
    assert make_cases.differences(tmp_path) == []
    (tmp_path / "pixel" / "input.pxi").write_bytes(b"other")
    (tmp_path / "limit-grid" / "case.json").write_text("{}")
    (tmp_path / "invalid-empty").rename(tmp_path / "more")
    assert make_cases.differences(tmp_path) == ["invalid-empty", "more", "limit-grid", "pixel"]


def test_the_suite_is_sound():
    assert sum(not c.error for c in CASES) >= 30
    assert sum(bool(c.error) for c in CASES) >= 60
    for case in CASES:
        assert case.title
        assert case.tests
        assert (case.name.split("-")[0] if case.error else None) == case.error
        expected = {r.expected.name for r in case.renders}
        assert {f.name for f in case.input.parent.iterdir()} == {
            "input.pxi",
            "case.json",
            *expected,
        }
        # RMS can never exceed peak: a larger limit would test nothing.
        assert all(0 < r.rms < r.peak < 0.5 for r in case.renders)
    assert sum(f.stat().st_size for f in FOLDER.rglob("*.*")) < 1_300_000


def test_bases_of_refused_files_are_good():
    for base in {case.base for case in make_cases.INVALID.values()}:
        assert from_bytes(base().data).render().any()
    base = invalid_posed.Posed()
    alone = base.tiny(invalid_posed.ALONE, invalid_posed.TRIANGLE)
    assert len(from_bytes(alone).layers["disc"].mesh.refined.faces) == 1


def test_cases_differ_from_a_flat_picture():
    for case in CASES:
        for render in case.renders:
            if render.expected.stat().st_size > 200:
                assert np.ptp(pixels.read(render.expected.read_bytes())) > 10_000, case.name


# Decoders.


def own_latents(source):
    """The hash of the package's latents."""
    return Ended(0, symbols.digest(source.read_bytes()))


def test_the_package_passes():
    assert problems(runner.run(CASES, in_process, digester=own_latents)) == []


def test_the_package_passes_without_its_kernel(no_kernel):
    assert not kernel.available()
    assert problems(runner.run(CASES, in_process, digester=own_latents)) == []


def test_the_package_passes_as_a_command(tmp_path, capsys, at_root):
    report = tmp_path / "report.json"
    runs = (("alpha", "png"), ("invalid-crc-t*", "npy"), ("pixel", "npy"), ("pyramid-r*", "npy"))
    for pattern, kind in runs:
        options = ["--only", pattern, "--format", kind, "-j", "2", "--json", str(report)]
        assert runner.main(options) == 0
        assert "cases passed" in capsys.readouterr().out
    report = json.loads(report.read_text())
    assert (report["cases"], report["failed"], len(report["results"])) == (2, [], 3)
    assert report["results"][0]["passed"]
    assert report["results"][0]["peak"] < 0.05


CAUGHT = {
    # fault: (case that catches it, kind of problem, case that it passes or "")
    "half-pixel": ("one-layer", "pixels", "invalid-crc-head"),
    "layer-order": ("layers", "pixels", "one-layer"),
    "ignores-holes": ("hole", "pixels", "layers"),
    "even-odd": ("winding", "pixels", "hole"),
    "hard-edges": ("layers", "pixels", "one-layer"),
    "coarse-coverage": ("layers", "pixels", "one-layer"),
    "points-floored": ("enlarged", "pixels", "layers"),
    "coarse-curves": ("layers", "pixels", "one-layer"),
    "escape-narrow": ("escape", "exit", "layers"),
    "swaps-channels": ("one-layer", "pixels", "invalid-names"),
    "not-premultiplied": ("alpha", "pixels", "layers"),
    "drops-alpha": ("no-back", "pixels", "one-layer"),
    "zeros-for-diffusion": ("diffusion", "pixels", "layers"),
    "no-smoothing": ("diffusion", "pixels", "layers"),
    "nearest": ("one-layer", "pixels", "invalid-order"),
    "no-octaves": ("octaves-7", "pixels", "octaves-0"),
    "no-averaging": ("reduced", "pixels", "layers"),
    "keeps-background": ("layer-subset", "pixels", "layers"),
    "ignores-layers": ("layer-subset", "pixels", "layers"),
    "ignores-region": ("region", "size", "layers"),
    "no-halving": ("adaptation", "exit", "one-layer"),
    "nan": ("pixel", "pixels", "invalid-empty"),
    "one-row-short": ("layers", "size", "invalid-empty"),
    "eight-bit": ("one-layer", "output", "invalid-empty"),
    "writes-nothing": ("one-layer", "output", "invalid-empty"),
    "writes-rubbish": ("one-layer", "output", "invalid-empty"),
    "accepts-bad-crc": ("invalid-crc-texture", "exit", "layers"),
    "accepts-trailing-bytes": ("invalid-trailing-byte", "exit", "layers"),
    "ignores-critical-chunks": ("unsupported-chunk", "exit", "ancillary"),
    "accepts-left-over-words": ("invalid-codes-long", "exit", "layers"),
    "accepts-any-step": ("invalid-step-nan", "exit", "layers"),
    "accepts-any-encoding": ("invalid-long-integer", "exit", "invalid-key-missing"),
    "accepts-more-values": ("invalid-value-more", "exit", "invalid-value-missing"),
    "accepts-any-order-of-keys": ("invalid-key-order", "exit", "version-0-3"),
    "refuses-maps": ("version-0-2", "exit", "arrays-0-2"),
    "ignores-poses": ("moved", "pixels", "layers"),
    "ignores-displacements": ("bent", "pixels", "moved"),
    "ignores-texture-displacements": ("texture-displaced", "pixels", "bent"),
    "ignores-opacity": ("opacity", "pixels", "moved"),
    "ignores-colour": ("colours-alpha", "pixels", "opacity"),
    "bends-after-mapping": ("bent-turned", "pixels", "bent"),
    "boundary-stays": ("bent", "pixels", "moved"),
    "rides-floored": ("bent", "pixels", "moved"),
    "boundary-undivided": ("pieces", "pixels", "moved"),
    "back-always-covers": ("turned-back", "pixels", "turned"),
    "maps-floored": ("turned", "pixels", "bent"),
    "maps-unclamped": ("clamped", "pixels", "turned"),
    "no-closing": ("closing-1", "pixels", "bent"),
    "children-turned": ("closing-deep", "pixels", "closing-1"),
    "ranks-by-number": ("bent", "exit", "moved"),
    "midpoints-not-predicted": ("closing-1", "pixels", "bent"),
    "last-face-wins": ("overlap", "pixels", "bent"),
    "turned-faces-win": ("folded", "pixels", "overlap"),
    "mirrored-faces-swap": ("folded-flipped", "pixels", "folded"),
    "first-face-beyond": ("beyond", "pixels", "bent"),
    "rest-beyond": ("beyond", "pixels", "bent"),
    "stops-beyond": ("beyond", "pixels", "bent"),
    "fine-weights": ("wide", "pixels", "bent"),
    "matrix-before-clamping": ("colours", "pixels", "invalid-names"),
    "matrix-not-clamped": ("colours", "pixels", "opacity"),
    "draws-hidden": ("hidden", "pixels", "moved"),
    "never-draws-hidden": ("hidden", "pixels", "layers"),
    "shared-texture-of-the-back": ("shared", "pixels", "moved"),
    "shared-box": ("shared", "pixels", "moved"),
    "local-is-direct": ("node-local", "pixels", "node"),
    "follows-parents": ("tree", "pixels", "moved"),
    "believes-histories": ("undo-stale", "exit", "undo"),
    "accepts-contradictions": ("invalid-opaque-moved", "exit", "opaque-posed"),
    "reads-maps-in-all-versions": ("invalid-map", "exit", "version-0-3"),
    "reads-only-0.9": ("version-0-2", "exit", "layers"),
    "reads-the-future": ("unsupported-version-0-4", "exit", "layers"),
    "accepts-idle-poses": ("invalid-pose-rest", "exit", "moved"),
    "causal-off-by-one": ("pyramid", "exit", "pyramid-sample"),
    "causal-reversed": ("pyramid", "exit", "pyramid-sample"),
    "context-floored": ("pyramid", "exit", "layers"),
    "features-truncated": ("pyramid", "exit", "layers"),
    "chroma-first": ("pyramid", "exit", "pyramid-grey"),
    "waves-too-steep": ("pyramid", "exit", "pyramid-row"),
    "ignores-support": ("pyramid-one-cell", "exit", "pyramid-sample"),
    "context-not-mirrored": ("pyramid", "exit", "pyramid-one-level"),
    "context-high-mirrored-as-low": ("pyramid", "exit", "pyramid-one-level"),
    "synthesis-not-mirrored": ("pyramid-one-level", "pixels", "pyramid-sample"),
    "ignores-shifts": ("pyramid-shifts", "exit", "pyramid"),
    "ignores-grey-levels": ("pyramid-grey-levels", "exit", "pyramid"),
    "one-level-set": ("pyramid", "exit", "pyramid-one-level"),
    "ignores-step": ("pyramid", "pixels", "layers"),
    "codes-certain-latents": ("pyramid-one-cell", "exit", "layers"),
    "escapes-unsigned": ("pyramid-escapes", "exit", "pyramid-sample"),
    "accepts-left-over-escapes": ("invalid-escapes-long", "exit", "pyramid"),
    "accepts-large-latents": ("invalid-latent-high", "exit", "pyramid"),
    "nearest-sample": ("pyramid-enlarged", "pixels", "pyramid-odd"),
    "linear": ("pyramid-enlarged", "pixels", "pyramid-odd"),
    "cubic-sharp": ("pyramid-enlarged", "pixels", "pyramid-odd"),
    "samples-on-corners": ("pyramid-odd", "pixels", "pyramid-sample"),
    "interpolates-straight": ("pyramid-alpha", "pixels", "pyramid-enlarged"),
    "ignores-part": ("pyramid-part", "pixels", "pyramid"),
    "ignores-alpha-planes": ("pyramid-alpha", "pixels", "pyramid"),
    "ignores-mask": ("pyramid-moved", "pixels", "pyramid"),
    "fills-black": ("pyramid-moved", "pixels", "pyramid"),
    "ignores-cuts": ("pyramid-cuts", "pixels", "pyramid-moved"),
    "cuts-mixed-samples": ("pyramid-cuts-several", "pixels", "pyramid-moved"),
    "keeps-rims": ("pyramid-cuts-moved", "pixels", "pyramid-cuts-several"),
    "keeps-rims-of-its-own": ("pyramid-cuts-moved", "pixels", "pyramid-cuts-several"),
    "keeps-rims-of-what-is-not-drawn": ("pyramid-cuts-opacity", "pixels", "pyramid-cuts-moved"),
    "loses-rims-everywhere": ("pyramid-cuts-moved", "pixels", "pyramid-cuts-several"),
    "loses-rims-of-what-moves-together": ("pyramid-cuts-together", "pixels", "pyramid-cuts-moved"),
    "trusts-mixed-samples": ("pyramid-cuts", "pixels", "pyramid-moved"),
    "trusts-samples-near": ("pyramid-cuts", "pixels", "pyramid-moved"),
    "ignores-motion": ("moves-loop", "pixels", "moved"),
    "moves-without-a-time": ("moves-loop", "pixels", "moved"),
    "linear-curves": ("moves-loop", "pixels", "moves-loop-1"),
    "curves-through-coefficients": ("moves-loop", "pixels", "moves-loop-1"),
    "stops-at-the-end": ("moves-loop", "pixels", "moves-once"),
    "always-loops": ("moves-once", "pixels", "moves-loop"),
    "end-is-the-beginning": ("moves-once", "pixels", "moves-loop"),
    "mirrors-negative-times": ("moves-loop", "pixels", "moves-unit-0"),
    "whole-frames": ("moves-loop", "pixels", "moves-loop-1"),
    "loops-do-not-wrap": ("moves-loop", "pixels", "moves-once"),
    "interval-late": ("moves-loop", "pixels", "moves-loop-1"),
    "interval-early": ("moves-loop", "pixels", "moves-loop-1"),
    "curves-not-summed": ("moves-loop", "pixels", "moves-loop-1"),
    "curves-summed-over-layers": ("moves-layers", "pixels", "moves-loop"),
    "one-curve-for-all": ("moves-loop", "pixels", "moves-unit-0"),
    "first-shape-only": ("moves-loop", "pixels", "moves-unit-0"),
    "shapes-in-one-row": ("moves-loop", "exit", "moves-unit-0"),
    "shapes-without-midpoints": ("moves-layers", "pixels", "moves-loop"),
    "moves-the-first-meshes": ("moves-layers", "exit", "moves-loop"),
    "ignores-unit": ("moves-unit-6", "pixels", "moves-loop"),
    "x-for-y": ("moves-loop", "pixels", "moves-nowhere"),
    "motion-floored": ("moves-loop", "pixels", "moves-nowhere"),
    "motion-unclamped": ("moves-far", "pixels", "moves-loop"),
    "forgets-bends": ("moves-posed", "pixels", "moves-loop"),
    "moves-after-mapping": ("moves-posed", "pixels", "moves-loop"),
    "still-where-nothing-moves": ("moves-nowhere", "pixels", "moves-loop"),
    "bodies-apart": ("moves-together", "pixels", "moves-apart"),
    "one-body": ("moves-apart", "pixels", "moves-together"),
    "bodies-rest-on-all": ("moves-nowhere", "pixels", "moves-loop"),
    "accepts-large-curves": ("invalid-motion-curve-high", "exit", "invalid-motion-shape-high"),
    "accepts-large-shapes": ("invalid-motion-shape-low", "exit", "invalid-motion-curve-low"),
    "accepts-any-motion": ("invalid-motion-back", "exit", "moves-loop"),
    "exit-code-1": ("invalid-empty", "exit", "layers"),
    "exit-code-0": ("invalid-empty", "exit", "layers"),
}


def test_every_fault_has_its_catcher():
    assert CAUGHT.keys() | {"hangs"} == wrong_decoders.FAULTS.keys()


@pytest.mark.parametrize("fault", CAUGHT)
@pytest.mark.filterwarnings("ignore:(invalid value|overflow|divide)")
def test_wrong_decoders_are_caught(fault):
    catcher, kind, spared = CAUGHT[fault]
    decoder = functools.partial(in_process, fault=fault)
    caught = problems(runner.run([BY_NAME[catcher]], decoder))
    assert caught
    assert f": {kind}: " in caught[0]
    assert problems(runner.run([BY_NAME[spared]], decoder)) == []


@pytest.mark.parametrize("case", ["closing-1", "closing-2", "closing-3", "closing-deep"])
@pytest.mark.parametrize("fault", ["no-closing", "boundary-stays", "ignores-displacements"])
def test_every_kind_of_closing_counts(case, fault):
    decoder = functools.partial(in_process, fault=fault)
    assert ": pixels: " in problems(runner.run([BY_NAME[case]], decoder))[0]


def command(*words):
    python = shlex.quote(sys.executable)
    return f"{python} {' '.join(words)} {{in}} {{out}} {{args}}"


def test_a_wrong_decoder_is_caught_as_a_command(capsys, at_root):
    wrong = command("-m", "conformance.wrong_decoders", "--fault", "ignores-holes")
    assert runner.main(["--decoder", wrong, "--only", "hole"]) == 1
    assert "pixels: peak" in capsys.readouterr().out


def test_wrong_latents_are_caught_as_a_command(capsys, at_root):
    good = command("-m", "proxyimg_codec.cli.decode")
    digest = f"{shlex.quote(sys.executable)} -c"
    for code, problem in (
        ("print('0' * 64)", f"latents: the hash is {'0' * 64} instead of"),
        ("pass", "latents: the hash is missing instead of"),
        ("import sys; sys.exit(3)", "exit: code 3 instead of 0"),
    ):
        wrong = f"{digest} {shlex.quote(code)} {{in}}"
        options = ["--decoder", good, "--latents", wrong, "--only", "pyramid-sample"]
        assert runner.main(options) == 1
        assert problem in capsys.readouterr().out


def test_only_cases_with_planes_have_latents():
    for case in CASES:
        planes = not case.error and b"PLAN" in case.input.read_bytes()
        assert planes == bool(case.latents), case.name


def test_digests_of_refused_files(capsys, monkeypatch):
    for name, code in (("invalid-escapes-none", 4), ("unsupported-model", 5), ("pyramid", 0)):
        monkeypatch.setattr(sys, "argv", ["symbols", str(BY_NAME[name].input)])
        assert symbols.main() == code
    assert capsys.readouterr().out == f"{BY_NAME['pyramid'].latents}\n"


def test_a_hanging_decoder_is_stopped(capsys, at_root):
    wrong = command("-m", "conformance.wrong_decoders", "--fault", "hangs")
    options = ["--decoder", wrong, "--only", "p*l", "--timeout", "0.3", "-j", "2"]
    assert runner.main(options) == 1
    assert "timeout: killed after 0.3 s" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("program", "problem"),
    [
        ("x = b'1' * (300 << 20)", "exit: code 1 instead of 0 (MemoryError)"),
        ("import os; os.kill(os.getpid(), 11)", "exit: killed by signal 11 instead of code 0"),
        ("pass", "output: no picture was written"),
        ("import sys; open(sys.argv[2], 'wb')", "output: neither a PNG nor an NPY file"),
        ("import sys; sys.exit('no\\ngood')", "exit: code 1 instead of 0 (good)"),
    ],
)
def test_bad_endings_are_named(program, problem):
    template = command("-c", shlex.quote(program))
    decoder = command_decoder(template, 20, 200 << 20)
    assert judge.judge(BY_NAME["pixel"], 0, decoder).problem.startswith(problem)


def test_a_refused_file_must_not_leave_a_picture():
    def decoder(source, target, flags):
        target.write_bytes(b"something")
        return Ended(4)

    assert judge.judge(BY_NAME["invalid-empty"], 0, decoder).problem.startswith("output: ")


# The runner's parts.


def test_commands_are_expanded():
    words = expand("a 'b c' --in={in} {out} {args}", Path("x y"), Path("o"), ["--width", "3"])
    assert words == ["a", "b c", "--in=x y", "o", "--width", "3"]


@pytest.mark.parametrize(
    "options",
    [
        ["--decoder", "a {in} {out}"],
        ["--decoder", "a '{in} {out} {args}"],
        ["--decoder", "no-such-program {in} {out} {args}"],
        ["--only", "nothing"],
        ["-j", "0"],
        ["--timeout", "0"],
    ],
)
def test_the_runner_refuses_senseless_options(options, capsys):
    with pytest.raises(SystemExit, match="2"):
        runner.main(options)


def test_flags_follow_from_arguments():
    args = {"region": [1, 2, 3, 4], "height": 9, "layers": ["a b", "c"], "background": False}
    assert " ".join(flags({**args, "time": -0.25})) == (
        "--bit-depth 16 --region 1,2,3,4 --height 9 --time -0.25 --layer a b --layer c "
        "--no-background"
    )


def test_cases_cite_what_chapter_12_demands():
    cited = {word for case in CASES for test in case.tests for word in test.split()}
    text = (FOLDER.parents[1] / "spec" / "10-motion.md").read_text("utf-8")
    assert {f"MOT-{n}" for n in range(1, text.count("**[MOT-") + 1)} <= cited


def test_what_moves_shows_its_still_first():
    moving = [case for case in CASES if case.name.startswith("moves-")]
    assert len(moving) > 10
    for case in moving:
        assert "time" not in case.renders[0].args
        assert all("time" in render.args for render in case.renders[1:])


def picture(*pixel, dtype=np.uint16, shape=(3, 5)):
    return np.broadcast_to(np.array(pixel, dtype), (*shape, len(pixel))).copy()


@pytest.mark.parametrize("channels", [3, 4])
def test_png_with_every_filter_is_read(channels):
    rng = np.random.default_rng(0)
    wanted = rng.integers(0, 65536, (7, 6, channels), np.uint16)
    assert (pixels.read(pictures.encode_png(wanted)) == wanted).all()
    raw = wanted.astype(">u2").view(np.uint8).reshape(7, -1)
    step, above = 2 * channels, np.zeros(raw.shape[1], int)
    for kind in range(5):
        for row in raw.astype(int):
            a = np.concatenate([np.zeros(step, int), row[:-step]])
            c = np.concatenate([np.zeros(step, int), above[:-step]])
            paeth = [pixels._paeth(*v) for v in zip(a, above, c, strict=True)]
            guess = np.array([0 * a, a, above, (a + above) // 2, paeth][kind])
            line = ((row - guess) & 255).astype(np.uint8)
            out = pixels._unfilter(kind, line, above.astype(np.uint8), step)
            assert (out == row).all()
            above = row


@pytest.mark.parametrize("order", ["C", "F"])
@pytest.mark.parametrize("dtype", ["<u2", ">u2", "<f4"])
def test_npy_is_read(order, dtype):
    wanted = np.arange(60).reshape(3, 5, 4).astype(dtype, order=order)
    file = io.BytesIO()
    np.save(file, wanted)
    assert (pixels.read(file.getvalue()) == wanted).all()
    for cut in (0, 3, 9, 50, 127, -1):
        with pytest.raises(ValueError, match=r"NPY|PNG"):
            pixels.read(file.getvalue()[:cut])


@pytest.mark.parametrize("shape", [(2, 2), (2, 2, 2), (0, 2, 3)])
def test_npy_of_other_shapes_is_refused(shape):
    file = io.BytesIO()
    np.save(file, np.zeros(shape, np.uint16))
    with pytest.raises(ValueError, match="shape"):
        pixels.read(file.getvalue())


def test_damaged_png_is_refused():
    data = pictures.encode_png(picture(1, 2, 3))
    for i in range(len(data)):
        with pytest.raises(ValueError, match="PNG"):
            pixels.read(data[:i])
        with pytest.raises(ValueError, match=r"PNG|shape"):
            pixels.read(data[:i] + bytes([data[i] ^ 1]) + data[i + 1 :])
    with pytest.raises(ValueError, match="16-bit"):
        pixels.read(pictures.encode_png(picture(1, 2, 3, dtype=np.uint8)))


def test_differences_are_premultiplied_8_bit_levels():
    grey = picture(32896, 32896, 32896)
    assert judge.difference(grey, grey) == (0, 0)
    peak, rms = judge.difference(grey, picture(0, 32896, 32896))
    assert peak == pytest.approx(128)
    assert rms == pytest.approx(64)
    clear = picture(9, 9, 9, 0), picture(65535, 0, 7, 0)
    assert judge.difference(*clear) == (0, 0)
    opaque = picture(0.5, 0.5, 0.5, 1, dtype=np.float32)
    assert judge.difference(opaque, picture(0.5, 0.5, 0.5, dtype=np.float32)) == (0, 0)
    assert judge.difference(opaque, picture(0.5, 0.5, 0.5, 0, dtype=np.float32))[0] == 255


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_one_bad_number_is_enough(bad, tmp_path):
    def decoder(source, target, flags):
        almost = picture(0, 0, 0, dtype=np.float32)
        almost[1, 2, 0] = bad
        np.save(target, almost)
        return Ended(0)

    (tmp_path / "black.png").write_bytes(pictures.encode_png(picture(0, 0, 0)))
    case = Case("c", "", (), Path(), (Render({}, (), tmp_path / "black.png", 1e9, 1e9),), None)
    result = judge.judge(case, 0, decoder, ".npy")
    assert result.problem == "pixels: not all are finite numbers"
    assert result.peak is None
