"""The files for desktops in share/: media type, magic of file(1), thumbnailer, installation."""

import configparser
import os
import re
import shlex
import shutil
import struct
import subprocess
import sys
import tomllib
import xml.etree.ElementTree as ET
from pathlib import Path

import msgpack
import pytest

from proxyimg_codec.container import chunks
from tests.support.paths import ROOT

SHARE = ROOT / "share"
MAGIC = SHARE / "misc/pxi.magic"
MIME = SHARE / "mime/packages/proxyimg.xml"
THUMBNAILER = SHARE / "thumbnailers/proxyimg.thumbnailer"
TYPE = "image/vnd.pxi"
CASES = ROOT / "conformance/cases"

CYTHON = '# Shared declarations.\ncdef extern from "x.h":\n    int f(int)\n'
"""Text that may stand in a file with the suffix .pxi, too."""


def needs(*programs):
    missing = [p for p in programs if shutil.which(p) is None]
    return pytest.mark.skipif(bool(missing), reason=f"{', '.join(missing)} is not installed")


def output(*words, **options):
    done = subprocess.run(
        words, capture_output=True, text=True, timeout=30,
        env={**os.environ, **options.pop("env", {}), "LC_ALL": "C.UTF-8"}, **options,
    )  # fmt: skip
    assert done.returncode == 0, (words, done.stderr)
    return done.stdout + done.stderr


def described(*paths):
    """What file(1) says about each of several files."""
    return output("file", "--brief", "-m", MAGIC, *paths).splitlines()


def description(data):
    """What file(1) should say about a valid file."""
    text = f"ProxyImg image, version {data[8]}.{data[9]}"
    head = msgpack.unpackb(data[20 : 20 + int.from_bytes(data[16:20], "little")])
    if isinstance(head, list):
        (width, height), channels, _, _, layers = head[:5]
        plural = "s" if layers > 1 else ""
        text += f", {width} x {height}, {channels} channels, {layers} layer{plural}"
    return text


@needs("file")
def test_file_describes_valid_files():
    paths = sorted(ROOT.glob("tests/golden/*/*.pxi"))
    paths += [p.parent / "input.pxi" for p in sorted(CASES.glob("*/*/expected-1.png"))]
    expected = [description(p.read_bytes()) for p in paths]
    assert sum(" layer" in text for text in expected) > 50
    assert not all(" layer" in text for text in expected)  # some versions have a map
    assert described(*paths) == expected
    kinds = output("file", "--brief", "--mime-type", "-m", MAGIC, *paths).split()
    assert set(kinds) == {TYPE}
    suffixes = output("file", "--brief", "--extension", "-m", MAGIC, *paths).split()
    assert set(suffixes) == {"pxi"}


@needs("file")
def test_file_reads_integers_of_all_lengths(tmp_path):
    numbers = [1, 0x7F, 0x80, 0xFF, 0x100, 0xFFFF, 0x10000, 1 << 24]
    heads = [((a, b), 3, min(c, 1 << 16)) for a in numbers for b in numbers for c in numbers]
    paths, expected = [], []
    for i, ((width, height), channels, layers) in enumerate(heads):
        payload = msgpack.packb([[width, height], channels, 1, 16, layers, 0])
        data = chunks.write([chunks.Chunk("HEAD", payload), chunks.Chunk("TAIL", b"")])
        paths.append(tmp_path / f"{i}.pxi")
        paths[-1].write_bytes(data)
        expected.append(description(data))
    assert ".".join(map(str, chunks.VERSION)) in expected[0]
    assert described(*paths) == expected


@needs("file")
def test_file_says_no_more_than_it_knows(tmp_path):
    data = (CASES / "poses/flipped/input.pxi").read_bytes()
    version = re.escape(f"ProxyImg image, version {data[8]}.{data[9]}")
    for length in range(len(chunks.SIGNATURE), 40):
        (tmp_path / str(length)).write_bytes(data[:length])
    texts = described(*(tmp_path / str(length) for length in range(10, 40)))
    assert all(re.match(version, text) for text in texts)
    assert texts[0] == f"ProxyImg image, version {data[8]}.{data[9]}"
    others = [tmp_path / "short", tmp_path / "text", tmp_path / "png"]
    for path, content in zip(
        others, (chunks.SIGNATURE[:7], b"PXI\r\n", b"\x89PNG\r\n\x1a\n" + data[8:]), strict=True
    ):
        path.write_bytes(content)
    assert not any("ProxyImg" in text for text in described(*others))


@needs("file")
def test_magic_compiles_without_a_warning(tmp_path):
    assert output("file", "-C", "-m", MAGIC, cwd=tmp_path) == ""
    (tmp_path / "wrong").write_text(MAGIC.read_text().replace("ubelong", "ubelung"))
    done = subprocess.run(["file", "-C", "-m", "wrong"], cwd=tmp_path, capture_output=True)
    assert b"ubelung" in done.stderr + done.stdout


def test_mime_type_is_that_of_the_code():
    space = {"": "http://www.freedesktop.org/standards/shared-mime-info"}
    root = ET.parse(MIME).getroot()
    assert root.tag == f"{{{space['']}}}mime-info"
    types = {t.get("type"): t for t in root.findall("mime-type", space)}
    kind = types[TYPE]
    assert kind.findtext("comment", None, space) == "ProxyImg image"
    assert kind.find("generic-icon", space).get("name") == "image-x-generic"
    (match,) = kind.findall("magic/match", space)
    assert (match.get("type"), match.get("offset")) == ("string", "0")
    # The escapes are those of C, which these of Python contain.
    value = match.get("value").encode("ascii").decode("unicode_escape").encode("latin-1")
    assert value == chunks.SIGNATURE
    assert f"string\t{match.get('value')}\t" in MAGIC.read_text()
    # Both types must claim the suffix with the same weight, or nobody looks at the content.
    globs = [[dict(g.attrib) for g in t.findall("glob", space)] for t in types.values()]
    assert globs == [[{"pattern": "*.pxi"}]] * 2
    assert set(types) == {TYPE, "text/x-python"}


def entry():
    parser = configparser.RawConfigParser()
    parser.optionxform = str
    parser.read_string(THUMBNAILER.read_text())
    assert parser.sections() == ["Thumbnailer Entry"]
    return dict(parser["Thumbnailer Entry"])


@pytest.mark.skipif(os.name == "nt", reason="file managers of Windows have no such thumbnailers")
@pytest.mark.parametrize(
    ("case", "size", "expected"),
    [
        ("poses/flipped", 128, (24, 18)),  # nothing is enlarged
        ("poses/flipped", 16, (16, 12)),
        ("poses/flipped", 1, (1, 1)),
        ("canvases/column", 16, (1, 16)),
    ],
)
def test_thumbnailer_writes_a_small_png(tmp_path, case, size, expected):
    source, target = tmp_path / 'it\'s "a" $picture.pxi', tmp_path / ".thumbnail.X1Y2Z3"
    shutil.copy(CASES / f"{case}/input.pxi", source)
    tools = tmp_path / "bin"
    tools.mkdir()
    program = entry()["TryExec"]
    (tools / program).write_text(f'#!/bin/sh\nexec "{sys.executable}" "{ROOT}/bin/{program}" "$@"')
    (tools / program).chmod(0o755)
    filled = {"%s": str(size), "%i": str(source), "%o": str(target), "%u": source.as_uri()}
    words = [filled.get(word, word) for word in shlex.split(entry()["Exec"])]
    # Thumbnailers of Xfce go on with the file that they opened before: renaming would lose it.
    with open(target, "w+b") as opened:
        said = output(*words, env={"PATH": f"{tools}:{os.environ['PATH']}"}, cwd=tmp_path)
        picture = opened.read()
    assert said == ""
    assert picture[:8] == b"\x89PNG\r\n\x1a\n"
    assert struct.unpack(">II", picture[16:24]) == expected


def test_thumbnailer_is_for_the_type():
    assert entry()["MimeType"] == f"{TYPE};"


def test_pip_installs_all_files():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    listed = project["tool"]["setuptools"]["data-files"]
    files = {p.relative_to(ROOT).as_posix() for p in SHARE.rglob("*") if p.is_file()}
    assert {f for names in listed.values() for f in names} == files
    assert all(Path(f).parent.as_posix() == folder for folder in listed for f in listed[folder])
    assert len(files) == 3


@needs("file", "update-mime-database", "gio")
def test_recipe_of_the_guide(tmp_path):
    (recipe,) = re.findall(r"```bash\n(.*?)```", (ROOT / "docs/guide/desktop.md").read_text(), re.S)
    home = tmp_path / "home"
    home.mkdir()
    env = {"HOME": str(home), "XDG_DATA_HOME": str(home / ".local/share")}
    output("sh", "-eu", "-c", recipe, cwd=ROOT, env=env)
    installed = home / ".local/share"
    assert (installed / "thumbnailers" / THUMBNAILER.name).read_bytes() == THUMBNAILER.read_bytes()
    assert f":{TYPE}]\n>0=\0\x08".encode() + chunks.SIGNATURE in (
        (installed / "mime/magic").read_bytes()
    )
    data = (CASES / "poses/flipped/input.pxi").read_bytes()
    names = ["a.pxi", "B.PXI", "without", "cython.pxi"]
    for name in names:
        (tmp_path / name).write_bytes(CYTHON.encode() if name == "cython.pxi" else data)
    told = output(
        "gio", "info", "-a", "standard::content-type", *(tmp_path / n for n in names), env=env
    )
    kinds = re.findall(r"standard::content-type: (\S+)", told)
    assert kinds == [TYPE, TYPE, TYPE, "text/x-python"]
    told = output("file", "--brief", *(tmp_path / n for n in names), env=env)
    assert told.splitlines()[:3] == [description(data)] * 3
    assert "ProxyImg" not in told.splitlines()[3]
