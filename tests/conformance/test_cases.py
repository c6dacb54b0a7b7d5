"""The cases are sound, test all statements, and are loaded as they should be."""

import json
import re
import shutil
import zipfile

import numpy as np
import pytest

from conformance import pixels
from conformance.cases import FOLDER, LEVELS, PROFILES, find, flags, load
from conformance.make import topics
from conformance.make.untested import UNTESTED
from proxyimg_codec.container.chunks import read
from tests.conformance.decoders import BY_NAME, CASES

REGISTRY = json.loads((FOLDER.parents[1] / "spec" / "registry.json").read_text("utf-8"))


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
        # RMS can never exceed peak: a larger limit tests nothing. That of small views is 45 dB.
        limits = {(r.rms, r.peak) for r in case.renders}
        assert all(0 < rms < peak < 0.5 or (rms, peak) == (1.43, 255) for rms, peak in limits)
    assert sum(f.stat().st_size for f in FOLDER.rglob("*.*")) < 3_200_000


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
        assert case.outcome == "valid"
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


def test_cases_differ_from_a_flat_picture():
    for case in CASES:
        for render in case.renders:
            if render.expected.stat().st_size > 200:
                assert np.ptp(pixels.read(render.expected.read_bytes())) > 8_000, case.name


def test_only_cases_with_planes_have_latents():
    for case in CASES:
        planes = not case.error and b"PLAN" in case.input.read_bytes()
        assert planes == bool(case.latents), case.name


def test_what_moves_shows_its_still_first():
    moving = [case for case in CASES if case.name.startswith("moves-")]
    assert len(moving) > 10
    for case in moving:
        assert "time" not in case.renders[0].args
        assert all("time" in render.args for render in case.renders[1:])


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
    folder = shutil.copytree(BY_NAME["pixel"].input.parent, tmp_path / "pixel")
    values = json.loads((folder / "case.json").read_text())
    whole = values["renders"][0]
    values |= change
    values["renders"] = [whole | r for r in values["renders"]]
    (folder / "case.json").write_text(json.dumps(values))
    with pytest.raises(ValueError, match=message):
        load(tmp_path)


def test_flags_follow_from_arguments():
    args = {"region": [1, 2, 3, 4], "height": 9, "layers": ["a b", "c"], "background": False}
    assert " ".join(flags({**args, "time": -0.25})) == (
        "--bit-depth 16 --region 1,2,3,4 --height 9 --time -0.25 --layer a b --layer c "
        "--no-background"
    )


def test_cases_are_found_with_and_without_folders_of_kinds(tmp_path):
    shutil.copytree(BY_NAME["pixel"].input.parent, tmp_path / "pixel")
    shutil.copytree(BY_NAME["column"].input.parent, tmp_path / "narrow" / "column")
    found = load(tmp_path)
    assert [(case.name, case.kind) for case in found] == [("column", "narrow"), ("pixel", "")]
    assert load(tmp_path, "pix*") == [found[1]]
    assert found[0].input == tmp_path / "narrow" / "column" / "input.pxi"
    assert find("column") == BY_NAME["column"]
    shutil.copytree(tmp_path / "pixel", tmp_path / "narrow" / "pixel")
    with pytest.raises(ValueError, match="have the same name"):
        load(tmp_path)
