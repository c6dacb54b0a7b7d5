"""pxi-validate: exit codes, JSON, and what it prints."""

import json
import os
from dataclasses import replace

import pytest

from conformance.cases import FOLDER
from proxyimg_codec.cli.validate import RESULTS
from proxyimg_codec.container.chunks import Chunk, read, write
from proxyimg_codec.validation.warnings import CODES
from tests.support import pyramids
from tests.support.images import changed
from tests.support.paths import ROOT


def case(name):
    """The input of a case, or a path of nothing."""
    return next(FOLDER.glob(f"*/{name}/input.pxi"), FOLDER / name)


@pytest.fixture
def plain(tmp_path):
    path = tmp_path / "plain.pxi"
    pyramids.implicit().save(path)
    return path


@pytest.fixture
def doubtful(tmp_path, plain):
    path = tmp_path / "doubtful.pxi"
    chunks = read(plain.read_bytes())
    path.write_bytes(write([*chunks[:-1], Chunk("teSt", b""), chunks[-1]]))
    return path


def test_valid(tool, plain):
    assert tool("validate", plain).out.decode() == f"{plain}: valid, still, level 1\n"
    assert tool("validate", "-", stdin=plain.read_bytes()).out == b"-: valid, still, level 1\n"


@pytest.mark.parametrize(
    ("name", "code", "result"),
    [
        ("invalid-crc-texture", 4, "invalid"),
        ("unsupported-coder", 5, "unsupported"),
        ("limit-segments", 6, "limit"),
        ("no-such-case", 3, "unreadable"),
    ],
)
def test_exit_codes(tool, name, code, result):
    out = tool("validate", case(name), code=code).out.decode()
    assert out.startswith(f"{case(name)}: {result} (1 error)\n  error")
    facts = json.loads(tool("validate", case(name), "--json", code=code).out)
    assert facts["files"][0]["result"] == result


def test_the_worst_of_several_files_counts(tool, plain):
    limit, unsupported, invalid = map(
        case, ("limit-segments", "unsupported-coder", "invalid-crc-texture")
    )
    ran = tool("validate", plain, limit, "/no/file", code=6)
    assert "not valid: 2 of 3" in ran.err
    tool("validate", limit, unsupported, plain, code=5)
    tool("validate", limit, invalid, unsupported, code=4)
    assert [v.exit_code if v else 0 for v in RESULTS.values()] == [4, 5, 6, 3, 0]


def test_strict(tool, plain, doubtful):
    out = tool("validate", doubtful).out.decode()
    assert out.startswith(
        f"{doubtful}: valid, still, level 1 (1 warning)\n  warning VAL-1: chunk teSt at byte "
    )
    assert "with warnings: 1 of 2" in tool("validate", doubtful, plain, "--strict", code=4).err
    tool("validate", plain, "--strict")
    old = ROOT / "tests/golden/0.2/tree.pxi"
    assert b"note VAL-12" in tool("validate", old, "--strict").out  # notes do not count


def test_json_is_stable(tool, doubtful):
    broken = case("invalid-crc-texture")
    facts = json.loads(tool("validate", doubtful, broken, "--json", code=4).out)
    assert list(facts) == ["files"]
    warned, wrong = facts["files"]
    at = read(doubtful.read_bytes())[-2].offset
    assert warned == {
        "file": str(doubtful),
        "result": "valid",
        "profile": "still",
        "level": 1,
        "issues": [
            {
                "code": "VAL-1",
                "severity": "warning",
                "message": f"{CODES['VAL-1']}: it has 12 bytes",
                "chunk": "teSt",
                "offset": at,
            }
        ],
    }
    (issue,) = wrong["issues"]
    assert issue == {
        "code": "CON-6",
        "severity": "error",
        "message": "CRC mismatch: the file is damaged",
        "chunk": "TEXR 0",
        "offset": 284,
    }


def test_names_cannot_write_to_the_terminal(tool, launch, tmp_path):
    image = pyramids.implicit()
    layers = [
        changed(v, name=f"{v.name}\x1b[2J\n\u732b", pose=replace(v.pose, hidden=v.name == "bar"))
        for v in image.layers
    ]
    path = tmp_path / "a\x1b[2J.pxi"
    changed(image, layers=type(image.layers)(layers)).save(path)
    out = tool("validate", path).out
    assert b"\x1b" not in out
    assert len(out.splitlines()) == 2
    assert b"VAL-8" in out
    ascii_only = {**os.environ, "PYTHONIOENCODING": "ascii"}
    assert b"\\u732b" in launch("validate", path, env=ascii_only).out


def test_codes_are_documented(tool):
    guide = (ROOT / "docs/guide/checking.md").read_text("utf-8")
    said = tool("validate", "--help").out.decode()
    for code, meaning in CODES.items():
        assert f"{code} " in said
        assert meaning in said
        assert f"| {code} | {meaning[0].upper()}{meaning[1:]}" in guide


def test_usage(tool, plain):
    tool("validate", code=2)
    tool("validate", plain, "--fix", code=2)
    assert tool("validate", "--version").out.startswith(b"pxi-validate ")
