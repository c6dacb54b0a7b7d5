"""`--limit` of all tools that read `.pxi` files."""

from dataclasses import fields

import pytest

from proxyimg_codec.limits import Limits
from tests.support.paths import ROOT

EXAMPLE = ROOT / "spec" / "example.pxi"

TOOLS = {
    "animate": ("--preset", "breathe"),
    "decode": (),
    "edit": ("--bake",),
    "info": None,
    "validate": None,
}
"""What each is called with; those without an output have None."""


@pytest.mark.parametrize("name", TOOLS)
def test_what_exceeds_a_limit_of_the_user_is_refused(tool, tmp_path, name):
    more = TOOLS[name]
    target = [] if more is None else [tmp_path / "out.pxi", *more]
    if name == "decode":
        target = [tmp_path / "out.png"]
    ran = tool(name, EXAMPLE, *target, "--limit", "layers=1", "--limit", "chunks=100", code=6)
    said = ran.err if name != "validate" else ran.out.decode()
    assert "layers: 2 exceeds the limit of 1" in said
    assert "--limit layers=" in said
    tool(name, EXAMPLE, *target, "--limit", "layers=2")


@pytest.mark.parametrize("name", TOOLS)
@pytest.mark.parametrize("text", ["layer=1", "layers", "layers=", "=1", "layers=-1", "layers=1e3",
                                  "layers=" + "9" * 5000, "layers=²"])  # fmt: skip
def test_limits_that_make_no_sense_are_refused(tool, tmp_path, name, text):
    more = TOOLS[name]
    target = [] if more is None else [tmp_path / "out.pxi", *more]
    if name == "decode":
        target = [tmp_path / "out.png"]
    ran = tool(name, EXAMPLE, *target, "--limit", text, code=2)
    if not text.startswith("layers"):
        assert all(f.name in ran.err for f in fields(Limits))


def test_a_limit_can_be_raised(tool):
    tool("info", EXAMPLE, "--limit", "chunks=3", "--limit", f"layers={1 << 40}", code=6)
    tool("info", EXAMPLE, "--limit", "chunks=3", "--limit", "chunks=30")


def test_limits_hold_for_what_is_drawn(tool, tmp_path):
    for name in ("output_pixels=100", "multiply_adds=1000", "work=3"):
        ran = tool("decode", EXAMPLE, tmp_path / "out.png", "--limit", name, code=6)
        assert f"--limit {name.split('=')[0]}=" in ran.err
