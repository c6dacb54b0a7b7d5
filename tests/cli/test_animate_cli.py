"""pxi-animate: every target from a small picture, and every way to fail."""

import json
import os
from pathlib import Path

import numpy as np
import pytest

import proxyimg_codec as pxi
from proxyimg_codec.animate.sequence import frames, times
from proxyimg_codec.io.raster import read

pytest.importorskip("OpenImageIO")

SHORT = ("--preset", "sway", "--duration", "0.5", "--fps", "12", "--quiet")
SMALL = ("--size", "48x32")


@pytest.fixture(scope="session")
def still_pxi(tmp_path_factory) -> Path:
    """A file of 64x48 pixels with the layers back, bar and disc, which does not move."""
    from tests.support import pyramids

    path = tmp_path_factory.mktemp("still") / "still.pxi"
    pyramids.implicit().save(path)
    return path


@pytest.fixture(scope="session")
def swaying(still_pxi):
    """What `SHORT` makes of it."""
    from proxyimg_codec.animate.animate import preset

    image = pxi.open(still_pxi)
    return image.animated(preset(image, "sway", duration=0.5, fps=12))


def listed(folder):
    """Files of a folder and below."""
    return sorted(str(p.relative_to(folder)) for p in Path(folder).rglob("*") if p.is_file())


def test_a_picture_that_carries_the_motion(tool, still_pxi, swaying, tmp_path):
    ran = tool("animate", still_pxi, tmp_path / "a.pxi", *SHORT)
    assert (ran.out, ran.err) == (b"", "")
    assert (tmp_path / "a.pxi").read_bytes() == swaying.to_bytes()
    ran = tool("animate", still_pxi, tmp_path / "a.pxi", "-f", *SHORT[:-1])
    size = len(swaying.to_bytes())
    assert f"{size} bytes" in ran.err
    motion = size - len(still_pxi.read_bytes())
    told = int(ran.err.split(" bytes, ")[1].split()[0])
    assert 0 < told <= motion
    assert "motion of 0.5 s" in ran.err
    assert os.listdir(tmp_path) == ["a.pxi"]


def test_frames_are_those_of_the_picture(tool, still_pxi, swaying, tmp_path):
    tool("animate", still_pxi, f"{tmp_path}/all/", *SHORT, *SMALL)
    names = [f"all/frame-{k:04d}.png" for k in range(6)]
    assert listed(tmp_path) == names
    want = frames(swaying, times(swaying), width=48, height=32)
    for name, frame in zip(names, want, strict=True):
        np.testing.assert_array_equal(read(tmp_path / name).pixels, frame)
    tool("animate", still_pxi, tmp_path / "f-%02d.png", *SHORT, *SMALL)
    assert (tmp_path / "f-05.png").read_bytes() == (tmp_path / names[5]).read_bytes()


@pytest.mark.parametrize("name", ["a.mp4", "a.webm", "a.webp", "a.gif", "a.apng"])
def test_clips(tool, still_pxi, tmp_path, name):
    av = pytest.importorskip("av")
    tool("animate", still_pxi, tmp_path / name, *SHORT, *SMALL)
    assert os.listdir(tmp_path) == [name]
    if name == "a.webp":  # FFmpeg does not read animated ones
        with pytest.importorskip("PIL.Image").open(tmp_path / name) as clip:
            assert (clip.n_frames, clip.size) == (6, (48, 32))
        return
    with av.open(str(tmp_path / name)) as clip:
        shown = list(clip.decode(video=0))
    assert len(shown) == 6
    assert {(v.width, v.height) for v in shown} == {(48, 32)}


def test_a_sprite_sheet(tool, still_pxi, swaying, tmp_path):
    tool("animate", still_pxi, tmp_path / "a.png", "--sheet", *SHORT, *SMALL)
    assert listed(tmp_path) == ["a.json", "a.png"]
    sheet, facts = read(tmp_path / "a.png").pixels, json.loads((tmp_path / "a.json").read_text())
    assert len(facts["frames"]) == 6
    for box, t in zip(facts["frames"].values(), times(swaying), strict=True):
        x, y, w, h = (box["frame"][k] for k in "xywh")
        want = swaying.render(t=t, width=48, height=32)
        np.testing.assert_array_equal(sheet[y : y + h, x : x + w, :3], want)


def test_a_picture_that_moves_by_itself(tool, moving_pxi, tmp_path):
    tool("animate", moving_pxi, f"{tmp_path}/a/", "--quiet")
    assert len(listed(tmp_path)) == 12  # 1.5 s at 8 a second, as the file says
    tool("animate", moving_pxi, f"{tmp_path}/b/", "--fps", "4", "--duration", "1", "--quiet")
    assert listed(tmp_path / "b") == [f"frame-{k:04d}.png" for k in range(4)]
    shown = read(tmp_path / "b" / "frame-0003.png").pixels
    np.testing.assert_array_equal(shown, pxi.open(moving_pxi).render(t=0.75))
    code = tool("animate", moving_pxi, tmp_path / "c.pxi", code=2)
    assert "moves already" in code.err
    tool("animate", moving_pxi, tmp_path / "c.pxi", *SHORT)
    assert pxi.open(tmp_path / "c.pxi").timeline.seconds == 0.5


def test_a_motion_file(tool, still_pxi, tmp_path):
    motion = {
        "version": 1, "duration": 0.5, "fps": 12, "drag": 0, "loop": False,
        "layers": {"disc": {"material": "jelly", "pins": ["bottom"],
                            "impulses": [{"time": 0, "velocity": [60, 0]}]}},
    }  # fmt: skip
    (tmp_path / "m.json").write_text(json.dumps(motion))
    tool("animate", still_pxi, tmp_path / "a.pxi", "--motion", tmp_path / "m.json", "--quiet")
    image = pxi.open(tmp_path / "a.pxi")
    assert [v.track is not None for v in image.layers] == [False, False, True]
    assert not image.timeline.loop
    tool("animate", still_pxi, tmp_path / "b.pxi", "--motion", tmp_path / "m.json", "--loop",
         "--fps", "6", "--seed", "3", "--quiet")  # fmt: skip
    line = pxi.open(tmp_path / "b.pxi").timeline
    assert (line.loop, line.fps, json.loads(line.script)["seed"]) == (True, 6, 3)


def test_layers_pins_and_seeds(tool, still_pxi, tmp_path):
    def made(*flags):
        tool("animate", still_pxi, tmp_path / "a.pxi", "-f", *SHORT, *flags)
        return pxi.open(tmp_path / "a.pxi")

    one = made("--layer", "disc")
    assert [v.name for v in one.layers if v.track is not None] == ["disc"]
    assert made("--layer", "-1").to_bytes() == one.to_bytes()
    assert made("--layer", "disc", "--seed", "5").to_bytes() != one.to_bytes()
    pinned = made("--layer", "disc", "--pin", "32,12,6", "--pin", "20,20,8,8")
    pins = json.loads(pinned.timeline.script)["layers"]["disc"]["pins"]
    assert pins == [{"at": [32, 12], "radius": 6}, {"box": [20, 20, 8, 8]}]
    nodes = pinned.layers["disc"].mesh.refined.nodes / 1024
    held = np.hypot(*(nodes - (32, 12)).T) < 6
    moved = np.abs(pinned.layers["disc"].track.at(pinned.timeline, 0.2)) / 1024
    assert held.any()
    assert moved[held].max() < 0.3
    together, separate = made(), made("--separate")
    assert together.layers["bar"].track.body == together.layers["disc"].track.body
    assert separate.layers["bar"].track.body != separate.layers["disc"].track.body


def test_a_pipe(tool, still_pxi, swaying, tmp_path):
    tool("animate", "-", tmp_path / "a.pxi", *SHORT, stdin=still_pxi.read_bytes())
    assert (tmp_path / "a.pxi").read_bytes() == swaying.to_bytes()


# Refusals


@pytest.mark.parametrize(
    ("flags", "said"),
    [
        ((), "does not move by itself"),
        (("--preset", "sway", "--motion", "m.json"), "not both"),
        (("--layer", "disc"), "--layer needs --preset"),
        (("--pin", "top"), "--pin needs --preset"),
        (("--separate",), "--separate needs --preset"),
        (("--seed", "1"), "--seed needs"),
        (("--preset", "storm"), "storm"),
        (("--preset", "sway", "--layer", "cat"), "no layer 'cat'"),
        (("--preset", "sway", "--layer", "7"), "no layer 7"),
        (("--preset", "sway", "--layer", "back"), "back of an opaque picture"),
        (("--preset", "sway", "--pin", "900,900,3"), "no node of layer"),
        (("--preset", "sway", "--pin", "900,900,3,3"), "no node of layer"),
        (("--preset", "sway", "--pin", "middle"), "--pin middle"),
        (("--preset", "sway", "--pin", "1,2"), "--pin 1,2"),
        (("--preset", "sway", "--pin", "nan,2,3"), "pins"),
        (("--preset", "sway", "--fps", "0"), "fps"),
        (("--preset", "sway", "--fps", "-3"), "fps"),
        (("--preset", "sway", "--fps", "2.5"), "--fps"),
        (("--preset", "sway", "--duration", "0"), "duration"),
        (("--preset", "sway", "--duration", "-1"), "duration"),
        (("--preset", "sway", "--duration", "nan"), "duration"),
        (("--preset", "sway", "--duration", "inf"), "duration"),
        (("--preset", "sway", "--duration", "600", "--fps", "240"), "steps; at most"),
        (("--preset", "sway", "--duration", "601"), "duration"),
        (("--preset", "sway", "--seed", "-1"), "seed"),
        (("--preset", "sway", "--jobs", "0"), "--jobs"),
        (("--preset", "sway", "--engine", "gpu"), "--engine"),
        (("--unknown",), "--unknown"),
    ],
    ids=lambda v: " ".join(v) if isinstance(v, tuple) else "",
)  # fmt: skip
def test_usage_errors(tool, still_pxi, tmp_path, flags, said):
    for target in ("a.pxi", "f/"):
        err = tool("animate", still_pxi, f"{tmp_path}/{target}", *flags, code=2).err
        assert said in err
    assert not os.listdir(tmp_path)


@pytest.mark.parametrize(
    ("flags", "said"),
    [
        (("--size", "0"), "0"),
        (("--size", "big"), "--size big"),
        (("--size", "1x2x3"), "--size 1x2x3"),
        (("--size", "-5x4"), "-5"),
        (("--background", "red"), "--background red"),
        (("--background", "12345"), "--background 12345"),
        (("--quality", "101"), "101"),
    ],
    ids=lambda v: " ".join(v) if isinstance(v, tuple) else "",
)
def test_usage_errors_of_clips(tool, still_pxi, tmp_path, flags, said):
    pytest.importorskip("av")
    flags = [f"{flags[0]}={flags[1]}"]
    err = tool("animate", still_pxi, tmp_path / "a.webp", *SHORT, *flags, code=2).err
    assert said in err
    assert not os.listdir(tmp_path)


@pytest.mark.parametrize("flag", ["--size=9", "--background=ffffff", "--quality=50", "--sheet"])
def test_flags_of_clips_need_a_clip(tool, still_pxi, tmp_path, flag):
    err = tool("animate", still_pxi, tmp_path / "a.pxi", *SHORT, flag, code=2).err
    assert flag.partition("=")[0] in err
    assert not os.listdir(tmp_path)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "not valid JSON"),
        ("[" * 100_000, "not valid JSON"),
        ("[]", "object"),
        ('{"version": 1}', "layers"),
        ('{"version": 2, "layers": {"disc": {}}}', "version"),
        ('{"version": 1, "layers": {"disc": {}}, "drag": NaN}', "drag"),
        ('{"version": 1, "layers": {"disc": {}}, "duration": Infinity}', "duration"),
        ('{"version": 1, "layers": {"disc": {}}, "gravity": [0, 1e400]}', "gravity"),
        ('{"version": 1, "layers": {"disc": {}}, "fps": 0}', "fps"),
        ('{"version": 1, "layers": {"disc": {}}, "substeps": 1000000}', "substeps"),
        ('{"version": 1, "layers": {"disc": {}}, "duration": 600, "substeps": 100}', "steps"),
        ('{"version": 1, "layers": {"cat": {}}}', "no layer 'cat'"),
        ('{"version": 1, "layers": {"back": {}}}', "back of an opaque"),
        ('{"version": 1, "layers": {"disc": {"material": "stone"}}}', "material"),
        ('{"version": 1, "layers": {"disc": {"pins": [{"at": [900, 9], "radius": 1}]}}}',
         "no node"),
        ('{"version": 1, "layers": {"disc": {"handles": [{"at": [900, 9], "radius": 1, '
         '"keys": [{"time": 0}, {"time": 1}]}]}}}', "no node"),
        ('{"version": 1, "layers": {"disc": {}}, "attachments": [{"layers": ["disc", "cat"], '
         '"at": [32, 24], "radius": 5}]}', "no layer 'cat'"),
        ('{"version": 1, "layers": {"disc": {}}, "extra": 1}', "extra"),
    ],
    ids=lambda v: v[:40],
)  # fmt: skip
def test_motion_files_that_are_none(tool, still_pxi, tmp_path, text, said):
    (tmp_path / "m.json").write_text(text)
    for target in ("a.pxi", "a.apng"):
        err = tool(
            "animate", still_pxi, tmp_path / target, "--motion", tmp_path / "m.json", code=2
        ).err
        assert said in err
    assert os.listdir(tmp_path) == ["m.json"]


def test_files_that_are_not_there(tool, still_pxi, tmp_path):
    missing = tmp_path / "missing.json"
    assert (
        "missing" in tool("animate", still_pxi, tmp_path / "a.pxi", "--motion", missing, code=3).err
    )
    (tmp_path / "m.json").write_bytes(b"\xff\xfe{}")
    tool("animate", still_pxi, tmp_path / "a.pxi", "--motion", tmp_path / "m.json", code=3)
    tool("animate", tmp_path / "missing.pxi", tmp_path / "a.pxi", *SHORT, code=3)
    (tmp_path / "bad.pxi").write_bytes(still_pxi.read_bytes()[:-9])
    tool("animate", tmp_path / "bad.pxi", tmp_path / "a.pxi", *SHORT, code=4)
    assert listed(tmp_path) == ["bad.pxi", "m.json"]


@pytest.mark.parametrize(
    ("target", "code"),
    [
        ("a.txt", 2), ("a", 2), ("a.png", 2), ("f-%d-%d.png", 2), ("missing/a.pxi", 3),
        ("missing/a.apng", 3), ("missing/deep/f/", 3), ("missing/deep/f-%d.png", 3),
        ("file/f/", 3),
    ],
)  # fmt: skip
def test_impossible_targets(tool, still_pxi, tmp_path, target, code):
    pytest.importorskip("av")
    (tmp_path / "file").write_bytes(b"precious")
    err = tool("animate", still_pxi, f"{tmp_path}/{target}", *SHORT, code=code).err
    assert target.rstrip("/") in err
    assert listed(tmp_path) == ["file"]
    assert (tmp_path / "file").read_bytes() == b"precious"


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_folder_that_may_not_be_written(tool, still_pxi, tmp_path):
    (tmp_path / "locked").mkdir(mode=0o500)
    for target in ("a.pxi", "a.apng", "f-%d.png"):
        tool("animate", still_pxi, tmp_path / "locked" / target, *SHORT, code=3)
    assert not listed(tmp_path)


@pytest.mark.parametrize("target", ["a.pxi", "a.apng", "f-%02d.png", "a.png"])
def test_old_output_is_kept(tool, still_pxi, tmp_path, target):
    pytest.importorskip("av")
    flags = ["--sheet"] if target == "a.png" else []
    old = tmp_path / target.replace("%02d", "00")
    old.write_bytes(b"precious")
    code = 2 if "%" in target else 3
    err = tool("animate", still_pxi, tmp_path / target, *SHORT, *flags, code=code).err
    assert "--force" in err
    # An error on the way, once it may be replaced.
    tool(
        "animate", still_pxi, tmp_path / target, *SHORT, *flags, "-f", "--pin", "900,900,1", code=2
    )
    if target != "a.pxi":
        size = ("--size", "20000x20000")
        tool("animate", still_pxi, tmp_path / target, *SHORT, *flags, "-f", *size, code=6)
    assert old.read_bytes() == b"precious"
    assert os.listdir(tmp_path) == [old.name]
    tool("animate", still_pxi, tmp_path / target, *SHORT, *flags, "-f", *(SMALL if flags else ()))
    assert old.read_bytes() != b"precious"


def test_the_input_is_never_overwritten(tool, still_pxi):
    before = still_pxi.read_bytes()
    tool("animate", still_pxi, still_pxi, *SHORT, "-f", code=2)
    assert still_pxi.read_bytes() == before


def test_a_picture_without_layers_that_can_move(tool, tmp_path):
    from tests.support import pyramids

    image = pyramids.implicit()
    alone = image.layers["bar"].removed().layers["disc"].removed().baked()
    alone.save(tmp_path / "a.pxi")
    err = tool("animate", tmp_path / "a.pxi", tmp_path / "b.pxi", *SHORT, code=2).err
    assert "no layer that can move" in err
    assert os.listdir(tmp_path) == ["a.pxi"]


def test_the_launcher(launch, still_pxi, swaying, tmp_path):
    ran = launch("animate", still_pxi, tmp_path / "a.pxi", *SHORT)
    assert ran.err == ""
    assert (tmp_path / "a.pxi").read_bytes() == swaying.to_bytes()
    assert launch("animate", "--version").out.startswith(b"pxi-animate ")
