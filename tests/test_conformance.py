import contextlib
import functools
import io
import json
import re
import shlex
import shutil
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis.extra.numpy import arrays

sys.path.insert(0, str(Path(__file__).parents[1]))

from conformance import (
    invalid_posed,
    judge,
    make_cases,
    pixels,
    runner,
    symbols,
    topics,
    wrong_decoders,
)
from conformance.cases import FOLDER, LEVELS, PROFILES, Case, Render, flags, load
from conformance.judge import Ended
from conformance.processes import command_decoder, expand
from conformance.untested import UNTESTED
from proxyimg_codec import from_bytes
from proxyimg_codec.cli import decode
from proxyimg_codec.container.chunks import read
from proxyimg_codec.io import raster
from proxyimg_codec.native import kernel

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
    assert sum(f.stat().st_size for f in FOLDER.rglob("*.*")) < 2_500_000


def test_no_case_replaces_another():
    modules = {case.build.__module__ for case in make_cases.VALID.values()}
    modules |= {case.build.__module__ for case in make_cases.INVALID.values()}
    found = [name for m in modules for name in sys.modules[m].CASES]
    assert sorted(found) == sorted(make_cases.VALID | make_cases.INVALID) == [*BY_NAME]


REGISTRY = json.loads((FOLDER.parents[1] / "spec" / "registry.json").read_text("utf-8"))


def test_every_statement_is_tested_or_says_why_not():
    cited = {id_ for case in CASES for id_ in case.tests}
    assert cited & UNTESTED.keys() == set()
    assert cited | UNTESTED.keys() == {*REGISTRY["statements"]}
    for reason in UNTESTED.values():
        for path in re.findall(r"tests/[\w/.]*\w", reason):
            assert (FOLDER.parents[1] / path).exists(), path


def test_cases_cite_ids_in_order():
    order = {id_: k for k, id_ in enumerate(sorted(REGISTRY["statements"], key=topics.order))}
    for case in CASES:
        places = [order[id_] for id_ in case.tests]
        assert places == sorted(set(places)), case.name
    assert topics.statements(["MOT-10", "REN-1", "MOT-2", "alpha"]) == [
        "MOT-2", "MOT-10", "REN-1", "REN-7", "REN-12", "TEX-18",
    ]  # fmt: skip
    with pytest.raises(ValueError, match="'beta' is neither a topic"):
        topics.statements(["beta"])


def test_every_profile_and_level_has_a_case():
    assert tuple(REGISTRY["profiles"]) == PROFILES
    valid = [case for case in CASES if not case.error]
    found = {(case.profile, case.level) for case in valid}
    assert found == {(profile, level) for profile in PROFILES for level in LEVELS}
    for case in valid:
        assert case.kind == "valid"
        chunks = {chunk.type for chunk in read(case.input.read_bytes())}
        assert ("mOTN" in chunks) == (case.profile == "moving"), case.name
        assert "POSE" not in chunks or case.profile != "still", case.name


@pytest.mark.parametrize(
    ("name", "profile"),
    [
        ("invalid-crc-head", "still"), ("invalid-empty", "still"), ("invalid-pose-rest", "posed"),
        ("unsupported-sampling", "still"), ("invalid-sampling-odd", "posed"),
        ("invalid-view-sampling", "posed"), ("unsupported-coder-values", "still"),
        ("invalid-motion-none", "moving"), ("limit-motion", "moving"), ("limit-gates", "posed"),
    ],
)  # fmt: skip
def test_refused_files_are_for_the_profiles_that_find_the_error(name, profile):
    case = BY_NAME[name]
    assert (case.profile, case.level) == (profile, None)
    assert [case.concerns(p, 1) for p in PROFILES].count(True) == 3 - PROFILES.index(profile)


def test_an_archive_is_in_a_picture():
    with zipfile.ZipFile(BY_NAME["polyglot-zip"].input) as archive:
        assert archive.testzip() is None
        assert archive.read("a.txt") == b"not a picture"


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


def ending(code, picture=None):
    """A decoder that always ends so, and may write a picture."""

    def decoder(source, target, flags):
        assert flags == ("--bit-depth", "16")
        if picture is not None:
            target.write_bytes(picture)
        return Ended(code)

    return decoder


def test_what_is_optional_may_be_refused_or_shown():
    optional = [case for case in CASES if case.optional]
    assert len(optional) >= 40
    assert {case.error for case in optional} == {"invalid", "limit"}
    case = BY_NAME["invalid-tree-circle"]
    right = case.renders[0].expected.read_bytes()
    wrong = raster.encode_png(pixels.read(right) ^ 0x4000)
    ends = [
        (ending(4), ""),
        (ending(0, right), ""),
        (ending(0, wrong), "pixels: "),
        (ending(0), "output: no picture"),
        (ending(4, right), "output: a picture was written"),
        (ending(5), "exit: code 5 instead of 4"),
        (ending(1), "exit: code 1 instead of 4"),
    ]
    for decoder, problem in ends:
        found = judge.judge(case, 0, decoder).problem
        assert found.startswith(problem)
        assert bool(found) == bool(problem)


# The runner's parts.


def listed(capsys, *options):
    """Names of the cases that the runner lists."""
    assert runner.main(["--list", *options]) == 0
    first, *lines = capsys.readouterr().out.splitlines()
    assert first.split() == ["case", "profile", "level", "title"]
    return [line.split()[0] for line in lines]


def test_cases_are_listed_by_profile_and_level(capsys):
    assert listed(capsys) == [case.name for case in CASES]
    for profile in PROFILES:
        for level in LEVELS:
            names = listed(capsys, "--profile", profile, "--level", str(level))
            for name in ("moved", "invalid-pose-rest"):
                assert (name in names) == (profile != "still")
            for name in ("moves-loop", "invalid-motion-none"):
                assert (name in names) == (profile == "moving")
            assert ("level-2-still" in names) == (level >= 2)
            assert ("level-3-posed" in names) == (level == 3 and profile != "still")
            assert "invalid-empty" in names
    assert listed(capsys, "--only", "level-*", "--level", "2", "--profile", "posed") == [
        "level-2-posed", "level-2-still",
    ]  # fmt: skip
    runner.main(["--list", "--only", "undo-0-2"])
    assert capsys.readouterr().out.splitlines()[1] == (
        "undo-0-2 still       1  A history of version 0.2: a map, and bound to the prefix too "
        "(valid; CON-4, MET-18)"
    )


def test_only_cases_of_a_profile_and_level_are_run(capsys, tmp_path, at_root):
    report = tmp_path / "report.json"
    with pytest.raises(SystemExit, match="2"):
        runner.main(["--only", "moves-*", "--profile", "posed"])
    assert runner.main(["--only", "level-*-still", "--level", "2", "--json", str(report)]) == 0
    assert [r["case"] for r in json.loads(report.read_text())["results"]] == ["level-2-still"] * 2


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"renders": [{"rms": 0.06}]}, "tolerance of the mean error"),
        ({"renders": [{"rms": float("nan")}]}, "tolerance of the mean error"),
        ({"renders": [{"peak": float("nan")}]}, "tolerance of the mean error"),
        ({"renders": [{"rms": 0}]}, "tolerance of the mean error"),
        ({"renders": []}, "needs either renders or a class"),
        ({"error": "invalid", "level": None}, "needs either renders or a class"),
        ({"error": "broken"}, "broken is not a class of error"),
        ({"optional": True}, "None is not a class of error"),
        ({"profile": "full"}, "profile full and level 1 do not fit"),
        ({"level": 4}, "profile still and level 4 do not fit"),
        ({"error": "invalid", "optional": True}, "profile still and level 1 do not fit"),
    ],
)
def test_cases_that_make_no_sense_are_not_loaded(change, message, tmp_path):
    folder = shutil.copytree(FOLDER / "pixel", tmp_path / "pixel")
    values = json.loads((folder / "case.json").read_text())
    whole = values["renders"][0]
    values |= change
    values["renders"] = [whole | r for r in values["renders"]]
    (folder / "case.json").write_text(json.dumps(values))
    with pytest.raises(ValueError, match=message):
        load(tmp_path)


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
        ["--profile", "all"],
        ["--level", "4"],
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
    assert (pixels.read(raster.encode_png(wanted)) == wanted).all()
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
    data = raster.encode_png(picture(1, 2, 3))
    for i in range(len(data)):
        with pytest.raises(ValueError, match="PNG"):
            pixels.read(data[:i])
        with pytest.raises(ValueError, match=r"PNG|shape"):
            pixels.read(data[:i] + bytes([data[i] ^ 1]) + data[i + 1 :])
    with pytest.raises(ValueError, match="16-bit"):
        pixels.read(raster.encode_png(picture(1, 2, 3, dtype=np.uint8)))


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


@given(arrays(np.uint16, (3, 4, 4)), arrays(np.uint16, (3, 4, 3)))
def test_the_mean_error_never_exceeds_the_largest(a, b):
    peak, rms = judge.difference(a, b)
    assert 0 <= rms <= peak <= 255


@pytest.mark.parametrize("off", [1, 3, 7, 257, 65535])
def test_the_mean_of_errors_that_are_alike_is_their_size(off):
    a = np.zeros((37, 29, 3), np.uint16)
    peak, rms = judge.difference(a, a + np.uint16(off))
    assert rms <= peak
    # Alpha is alike: three samples of four are off.
    assert rms == pytest.approx(peak * 0.75**0.5)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_one_bad_number_is_enough(bad, tmp_path):
    def decoder(source, target, flags):
        almost = picture(0, 0, 0, dtype=np.float32)
        almost[1, 2, 0] = bad
        np.save(target, almost)
        return Ended(0)

    (tmp_path / "black.png").write_bytes(raster.encode_png(picture(0, 0, 0)))
    case = Case("c", "", (), Path(), (Render({}, (), tmp_path / "black.png", 1e9, 1e9),), None)
    result = judge.judge(case, 0, decoder, ".npy")
    assert result.problem == "pixels: not all are finite numbers"
    assert result.peak is None
