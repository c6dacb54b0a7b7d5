"""Clips: each target read again, and what is left after a failure."""

import json
import resource
import sys
import weakref
from fractions import Fraction

import numpy as np
import pytest

from proxyimg_codec.errors import InputError, UnsupportedError, UsageError
from proxyimg_codec.export.clip import target_of, write_clip

av = pytest.importorskip("av")
Image = pytest.importorskip("PIL.Image")

WIDTH, HEIGHT, COUNT, FPS = 48, 40, 7, 24
MOVIES = ("clip.mp4", "clip.webm", "clip.webp", "clip.gif", "clip.apng")
TARGETS = (*MOVIES, "frames/", "f-%02d.png", "sheet.png")


def clip(alpha: bool, count: int = COUNT, width: int = WIDTH, height: int = HEIGHT) -> list:
    """A disc that moves over smooth colours; with alpha it is alone, with a soft edge."""
    y, x = np.mgrid[0:height, 0:width].astype(float)
    frames = []
    for k in range(count):
        red = np.where(np.hypot(x - 15 - 2 * k, y - 20) < 9, 220, 60 + 2 * x)
        colours = np.stack([red, 90 + 2 * y, 150 + 40 * np.sin((x + k) / 9)], axis=2)
        cover = 255 * np.clip(13 - np.hypot(x - 15 - 2 * k, y - 20), 0, 4) / 4
        frames.append(np.dstack([colours, cover] if alpha else [colours]).astype(np.uint8))
    return frames


def noisy() -> list:
    """What no coder can make small without loss."""
    random = np.random.default_rng(0)
    return [f // 2 + random.integers(0, 64, f.shape, np.uint8) for f in clip(alpha=False)]


def write(folder, name: str, frames: list, **options) -> int:
    height, width, channels = frames[0].shape
    options = {"fps": FPS, "alpha": channels == 4, "sheet": name == "sheet.png", **options}
    return write_clip(f"{folder}/{name}", iter(frames), size=(width, height), **options)


def animation(path, mode: str) -> tuple[list, list, int | None]:
    """Frames, their durations in ms and the loop count, as Pillow reads them."""
    frames, durations = [], []
    with Image.open(path) as image:
        for k in range(image.n_frames):
            image.seek(k)
            frames.append(np.asarray(image.convert(mode)))
            durations.append(image.info.get("duration"))
        return frames, durations, image.info.get("loop")


def video(path) -> list:
    """uint8 [H, W, 4] frames as libvpx or FFmpeg decodes them; FFmpeg's VP9 ignores alpha."""
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        decoder = stream.codec_context
        if decoder.name == "vp9":
            decoder = av.CodecContext.create("libvpx-vp9", "r")
        packets = container.demux(stream)
        return [rgba(f) for p in packets for f in decoder.decode(p if p.size else None)]


def rgba(picture) -> np.ndarray:
    """Y'CbCr 4:2:0 in the limited range to sRGB (ITU-R BT.709, item 3), chroma repeated."""
    planes = [
        np.frombuffer(p, np.uint8).reshape(p.height, p.line_size)[:, : p.width].astype(float)
        for p in picture.planes
    ]
    luma = (planes[0] - 16) / 219
    blue, red = (((p - 128) / 224).repeat(2, axis=0).repeat(2, axis=1) for p in planes[1:3])
    green = luma - 0.18732 * blue - 0.46812 * red
    colours = np.stack([luma + 1.5748 * red, green, luma + 1.8556 * blue], axis=2)
    alpha = planes[3] if len(planes) > 3 else np.full_like(luma, 255)
    return np.rint(np.dstack([colours.clip(0, 1) * 255, alpha])).astype(np.uint8)


def over(frame: np.ndarray, background: int = 0) -> np.ndarray:
    """float64 [H, W, 3]: a frame over a grey; clear pixels have no colour."""
    weight = frame[..., 3:] / 255
    return frame[..., :3] * weight + background * (1 - weight)


def psnr(one: list, other: list) -> float:
    error = np.stack(one).astype(float) - np.stack(other)
    return float(10 * np.log10(255**2 / max(np.mean(error**2), 1e-9)))


def everything(folder) -> dict[str, bytes]:
    """All files below a folder, and folders as such."""
    paths = sorted(folder.rglob("*"))
    return {str(p.relative_to(folder)): p.read_bytes() if p.is_file() else b"/" for p in paths}


def untouched():
    """Frames that nobody may ask for."""
    pytest.fail("a frame was asked for")
    yield


@pytest.mark.parametrize("alpha", [False, True])
def test_apng_is_exact(tmp_path, alpha):
    frames = clip(alpha)
    size = write(tmp_path, "clip.apng", frames)
    assert size == (tmp_path / "clip.apng").stat().st_size
    got, durations, loop = animation(tmp_path / "clip.apng", "RGBA" if alpha else "RGB")
    np.testing.assert_array_equal(got, frames)
    assert durations == pytest.approx([1000 / FPS] * COUNT)
    assert loop == 0


def test_webp_of_full_quality_is_exact_but_for_hidden_colours(tmp_path):
    frames = clip(alpha=True)
    write(tmp_path, "clip.webp", frames, quality=100)
    got, _, _ = animation(tmp_path / "clip.webp", "RGBA")
    np.testing.assert_array_equal(np.stack(got)[..., 3], np.stack(frames)[..., 3])
    np.testing.assert_array_equal([over(f) for f in got], [over(f) for f in frames])


def test_webp_takes_the_smaller_way(tmp_path):
    flat = np.zeros((64, 64, 3), np.uint8)
    flat[20:40, 10:50] = 250, 30, 90
    write(tmp_path, "flat.webp", [flat, flat[::-1]])
    np.testing.assert_array_equal(animation(tmp_path / "flat.webp", "RGB")[0], [flat, flat[::-1]])
    lossy = write(tmp_path, "noisy.webp", noisy())
    assert lossy < write(tmp_path, "exact.webp", noisy(), quality=100)


def test_webp_keeps_colours_and_soft_alpha(tmp_path):
    frames = clip(alpha=True)
    write(tmp_path, "clip.webp", frames, fps=24)
    got, durations, loop = animation(tmp_path / "clip.webp", "RGBA")
    np.testing.assert_array_equal(np.stack(got)[..., 3], np.stack(frames)[..., 3])
    assert psnr([over(f) for f in got], [over(f) for f in frames]) > 33
    assert durations[:3] == [42, 41, 42]
    assert loop == 0


def test_numbered_files_are_exact(tmp_path):
    frames = clip(alpha=True, count=11)
    size = write(tmp_path, "frames/", frames)
    files = sorted((tmp_path / "frames").iterdir())
    assert [f.name for f in files] == [f"frame-{k:04d}.png" for k in range(11)]
    assert size == sum(f.stat().st_size for f in files)
    np.testing.assert_array_equal([np.asarray(Image.open(f)) for f in files], frames)
    write(tmp_path, "f%d.png", frames)
    assert {f.name for f in tmp_path.glob("*.png")} == {f"f{k}.png" for k in range(11)}


@pytest.mark.parametrize("alpha", [False, True])
def test_sheet_and_its_map(tmp_path, alpha):
    frames = clip(alpha)
    write(tmp_path, "sheet.png", frames, fps=12.5, loop=False)
    sheet = np.asarray(Image.open(tmp_path / "sheet.png"))
    described = json.loads((tmp_path / "sheet.json").read_text())
    meta = described["meta"]
    assert meta["image"] == "sheet.png"
    assert (meta["size"]["h"], meta["size"]["w"]) == sheet.shape[:2]
    assert (meta["columns"], meta["rows"], meta["frameCount"]) == (3, 3, COUNT)
    assert (meta["frameWidth"], meta["frameHeight"]) == (WIDTH, HEIGHT)
    assert (meta["fps"], meta["loop"]) == (12.5, False)
    names = described["animations"]["sheet"]
    assert names == list(described["frames"])
    for k, name in enumerate(names):
        box = described["frames"][name]["frame"]
        cut = sheet[box["y"] : box["y"] + box["h"], box["x"] : box["x"] + box["w"]]
        np.testing.assert_array_equal(cut, frames[k])
        assert described["frames"][name]["duration"] == 80
        # The same by the grid alone.
        assert (box["x"], box["y"]) == (k % 3 * WIDTH, k // 3 * HEIGHT)


def test_gif_has_near_colours_and_one_bit_of_alpha(tmp_path):
    frames = clip(alpha=True)
    write(tmp_path, "clip.gif", frames)
    got, durations, loop = animation(tmp_path / "clip.gif", "RGBA")
    assert len(got) == COUNT
    for frame, seen in zip(frames, got, strict=True):
        solid = frame[..., 3] >= 128
        np.testing.assert_array_equal(seen[..., 3], 255 * solid)
        assert np.abs(seen[solid].astype(int) - frame[solid])[:, :3].mean() < 6
    assert sum(durations[:6]) == 250
    assert set(durations) == {40, 50}
    assert loop == 0


@pytest.mark.parametrize("name", ["clip.gif", "clip.webp", "clip.apng"])
def test_a_clip_that_plays_once(tmp_path, name):
    write(tmp_path, name, clip(alpha=False), loop=False)
    loop = animation(tmp_path / name, "RGB")[2]
    assert loop == (None if name == "clip.gif" else 1)


@pytest.mark.parametrize("name", ["clip.mp4", "clip.webm"])
def test_video(tmp_path, name):
    frames = clip(alpha=False, count=24)
    assert write(tmp_path, name, frames) == (tmp_path / name).stat().st_size
    got = video(tmp_path / name)
    assert psnr([f[..., :3] for f in got], frames) > 30
    with av.open(str(tmp_path / name)) as container:
        stream = container.streams.video[0]
        assert stream.average_rate == FPS
        assert container.duration == 1_000_000
        assert stream.codec_context.pix_fmt == "yuv420p"


@pytest.mark.parametrize("name", ["clip.mp4", "clip.webm"])
def test_colours_of_video(tmp_path, name):
    colours = [*np.ndindex(2, 2, 2), (0.5,) * 3, (0.8, 0.2, 0.1), (0.1, 0.5, 0.9)]
    patches = np.rint(255 * np.array(colours)).astype(np.uint8)
    frame = np.repeat(np.repeat(patches[None], 32, axis=0), 32, axis=1)
    write(tmp_path, name, [frame] * 3)
    for got in video(tmp_path / name):
        inner = got[..., :3].reshape(32, -1, 32, 3)[8:24, :, 8:24].mean(axis=(0, 2))
        assert np.abs(inner - patches).mean(axis=1).max() < 2
    with av.open(str(tmp_path / name)) as container:
        picture = next(container.decode(video=0))
        # ITU-T H.273: matrix BT.709, limited range, primaries BT.709, transfer sRGB.
        assert (picture.colorspace, picture.color_range) == (1, 1)
        assert (picture.color_primaries, picture.color_trc) == (1, 13)


def test_webm_keeps_alpha(tmp_path):
    frames = clip(alpha=True)
    write(tmp_path, "clip.webm", frames)
    got = video(tmp_path / "clip.webm")
    assert len(got) == COUNT
    for background in (0, 255):
        seen, true = ([over(f, background) for f in many] for many in (got, frames))
        assert psnr(seen, true) > 32
    assert psnr([f[..., 3] for f in got], [f[..., 3] for f in frames]) > 35


def test_mp4_is_composited_over_the_background_and_starts_fast(tmp_path):
    frames = clip(alpha=True)
    write(tmp_path, "clip.mp4", frames, background=(20, 200, 90))
    got = [f[..., :3] for f in video(tmp_path / "clip.mp4")]
    wanted = [over(f) + np.array([20, 200, 90]) * (1 - f[..., 3:] / 255) for f in frames]
    assert psnr(got, wanted) > 30
    np.testing.assert_allclose(got[0][2:8, -8:].mean(axis=(0, 1)), (20, 200, 90), atol=2)
    data = (tmp_path / "clip.mp4").read_bytes()
    assert 0 < data.index(b"moov") < data.index(b"mdat")


def test_alpha_that_is_not_wanted_is_composited(tmp_path):
    frames = clip(alpha=True)
    write(tmp_path, "frames/", frames, alpha=False, background=(0, 0, 0))
    got = np.asarray(Image.open(tmp_path / "frames" / "frame-0002.png"))
    assert got.shape == (HEIGHT, WIDTH, 3)
    np.testing.assert_allclose(got, over(frames[2]), atol=0.5)


def test_opaque_frames_of_a_transparent_clip(tmp_path):
    frames = clip(alpha=True)
    write(tmp_path, "clip.apng", [frames[0], frames[1][..., :3]])
    got = animation(tmp_path / "clip.apng", "RGBA")[0]
    np.testing.assert_array_equal(got[0], frames[0])
    np.testing.assert_array_equal(got[1][..., :3], frames[1][..., :3])
    assert got[1][..., 3].min() == 255


@pytest.mark.parametrize("name", ["clip.mp4", "clip.webm"])
@pytest.mark.parametrize("size", [(33, 41), (1, 1), (16, 7)])
def test_odd_sides_of_video_repeat_the_last(tmp_path, name, size):
    frames = clip(True, 3, *size)
    write(tmp_path, name, frames)
    got = [over(f) for f in video(tmp_path / name)]
    assert len(got) == 3
    width, height = size
    assert got[0].shape[:2] == (height + height % 2, width + width % 2)
    if width % 2:
        assert np.abs(got[0][:, -1] - got[0][:, -2]).mean() < 6


@pytest.mark.parametrize("name", ["clip.webp", "clip.gif", "clip.apng"])
@pytest.mark.parametrize("size", [(33, 41), (1, 1), (5, 7)])
def test_odd_sides_of_animated_pictures_stay(tmp_path, name, size):
    frames = clip(False, 3, *size)
    write(tmp_path, name, frames, quality=100)
    got = animation(tmp_path / name, "RGB")[0]
    assert np.abs(np.array(got, int) - frames).max() <= (40 if name == "clip.gif" else 0)


@pytest.mark.parametrize("name", TARGETS)
def test_one_frame(tmp_path, name):
    frames = clip(alpha=False, count=1)
    write(tmp_path, name, frames)
    target = target_of(f"{tmp_path}/{name}", sheet=name == "sheet.png")
    if name in ("clip.mp4", "clip.webm"):
        got = video(target.first)[0][..., :3]
        with av.open(str(target.first)) as container:
            assert container.duration == pytest.approx(1e6 / FPS, abs=1000)
    else:
        with Image.open(target.first) as image:
            got = np.asarray(image.convert("RGB"))
    assert psnr([got], frames) > 28


@pytest.mark.parametrize(
    ("fps", "exact"), [(30000 / 1001, Fraction(30000, 1001)), (29.97, Fraction(2997, 100)), (5, 5)]
)
def test_fractions_of_rates(tmp_path, fps, exact):
    frames = clip(alpha=False, count=30)
    write(tmp_path, "clip.mp4", frames, fps=fps)
    with av.open(str(tmp_path / "clip.mp4")) as container:
        stream = container.streams.video[0]
        assert stream.average_rate == exact
        assert stream.duration * stream.time_base == 30 / exact
    write(tmp_path, "clip.gif", frames, fps=fps)
    durations = animation(tmp_path / "clip.gif", "RGB")[1]
    assert sum(durations[:-1]) == pytest.approx(29000 / exact, abs=5)


@pytest.mark.parametrize("name", TARGETS)
def test_equal_frames_give_equal_bytes(tmp_path, name):
    for folder in (tmp_path / "a", tmp_path / "b"):
        folder.mkdir()
        write(folder, name, clip(alpha=True))
    assert everything(tmp_path / "a") == everything(tmp_path / "b")


def test_quality_is_size(tmp_path):
    for name in ("clip.mp4", "clip.webm", "clip.webp"):
        sizes = [write(tmp_path, name, noisy(), quality=q) for q in (0, 60, 90, 100)]
        assert sizes == sorted(set(sizes))


def test_frames_are_not_hoarded(tmp_path):
    alive, most = weakref.WeakSet(), 0

    class Array(np.ndarray):
        """An array that a set can hold."""

        __hash__ = object.__hash__

    def frames():
        nonlocal most
        for k in range(30):
            frame = np.full((HEIGHT, WIDTH, 3), k, np.uint8).view(Array)
            alive.add(frame)
            most = max(most, len(alive))
            yield frame

    for name in MOVIES:
        write_clip(f"{tmp_path}/{name}", frames(), fps=FPS, size=(WIDTH, HEIGHT), alpha=False)
    assert most <= 3


@pytest.mark.parametrize("error", [ZeroDivisionError, KeyboardInterrupt])
@pytest.mark.parametrize("old", [False, True])
@pytest.mark.parametrize("name", TARGETS)
def test_an_interrupted_clip_leaves_everything_as_it_was(tmp_path, name, old, error):
    if old:
        write(tmp_path, name, clip(alpha=False, count=2))
    before = everything(tmp_path)

    def frames():
        yield from clip(alpha=False)
        raise error

    with pytest.raises(error):
        write(tmp_path, name, _Sized(frames()))
    assert everything(tmp_path) == before


class _Sized:
    """An iterator that `write` can ask for the shape of its first frame."""

    def __init__(self, frames) -> None:
        self._frames = frames

    def __iter__(self):
        return self._frames

    def __getitem__(self, k: int):
        return clip(alpha=False, count=1)[k]


@pytest.mark.parametrize("name", TARGETS)
def test_a_full_disk(tmp_path, name):
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (4096, limits[1]))
    try:
        with pytest.raises(InputError, match="cannot be written") as caught:
            write(tmp_path, name, noisy())
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert name in str(caught.value)
    assert everything(tmp_path) == {}


@pytest.mark.parametrize("name", TARGETS)
def test_a_missing_folder_is_told_first(tmp_path, name):
    with pytest.raises(InputError, match="cannot be written: No such file"):
        write(tmp_path / "missing" / "too", name, _Sized(untouched()))
    assert everything(tmp_path) == {}


def test_targets_that_are_something_else_are_told_first(tmp_path):
    (tmp_path / "clip.mp4").mkdir()
    (tmp_path / "sheet.json").mkdir()
    (tmp_path / "frames").write_bytes(b"file")
    before = everything(tmp_path)
    for name in ("clip.mp4", "sheet.png", "frames/"):
        with pytest.raises(InputError, match=r"is not a file|Not a directory"):
            write(tmp_path, name, _Sized(untouched()))
    assert everything(tmp_path) == before


@pytest.mark.parametrize("name", ["clip", "clip.avi", "clip.png", "a-%d-%d.png", "%d.jpg", "-", ""])
def test_unknown_targets(name):
    with pytest.raises(UsageError, match=r"\.mp4, \.webm, \.webp, \.gif or \.apng"):
        target_of(name)


@pytest.mark.parametrize("name", ["sheet.webp", "sheet-%d.png", "sheet/"])
def test_sheets_are_one_png_file(name):
    with pytest.raises(UsageError, match=r"one \.png file"):
        target_of(name, sheet=True)


def test_targets_say_what_they_keep():
    bits = {name: target_of(name, name == "sheet.png").alpha_bits for name in TARGETS}
    assert bits == dict.fromkeys(TARGETS, 8) | {"clip.mp4": 0, "clip.gif": 1}
    assert target_of("a/CLIP.MP4").kind == "mp4"


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("clip.mp4", {"fps": 0}),
        ("clip.mp4", {"fps": float("nan")}),
        ("clip.mp4", {"fps": float("inf")}),
        ("clip.gif", {"fps": 60}),
        ("clip.webp", {"fps": 100}),
        ("clip.mp4", {"quality": 101}),
        ("clip.webp", {"size": (16384, 2)}),
        ("clip.mp4", {"size": (0, 2)}),
    ],
)
def test_bad_arguments_are_told_first(tmp_path, name, options):
    options = {"fps": FPS, "size": (WIDTH, HEIGHT), **options}
    with pytest.raises(UsageError):
        write_clip(f"{tmp_path}/{name}", untouched(), alpha=False, **options)
    assert everything(tmp_path) == {}


@pytest.mark.parametrize("name", ["clip.mp4", "frames/"])
def test_no_frames(tmp_path, name):
    with pytest.raises(UsageError, match="no frames"):
        write_clip(f"{tmp_path}/{name}", [], fps=FPS, size=(WIDTH, HEIGHT), alpha=False)
    assert everything(tmp_path) == {}


def test_a_frame_of_another_size(tmp_path):
    frames = [*clip(alpha=False, count=2), clip(alpha=False, count=1, width=10)[0]]
    with pytest.raises(ValueError, match="not of size"):
        write(tmp_path, "clip.mp4", frames)
    assert everything(tmp_path) == {}


def test_without_pyav_there_are_png_files(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "av", None)
    for name in MOVIES:
        with pytest.raises(UnsupportedError, match=r"proxyimg-codec\[animate\]"):
            write(tmp_path, name, _Sized(untouched()))
    write(tmp_path, "frames/", clip(alpha=False))
    assert len(list((tmp_path / "frames").iterdir())) == COUNT


def test_a_sequence_replaces_an_older_one_and_nothing_else(tmp_path):
    (tmp_path / "f").mkdir()
    others = ["f/frame-0002.jpg", "f/frame-2.png", "f/notes.txt", "f/frame-0008.png"]
    for name in others:
        (tmp_path / name).write_bytes(b"mine")
    write(tmp_path, "f/", clip(alpha=False, count=6))
    write(tmp_path, "f/", clip(alpha=True, count=3))
    made = {f"f/frame-{k:04d}.png" for k in range(3)}
    found = everything(tmp_path)
    assert set(found) == {"f", *others, *made}
    assert {found[name] for name in others} == {b"mine"}
    assert all(b"IHDR" in found[name] for name in made)


def test_a_link_and_the_mode_of_a_file_stay(tmp_path):
    (tmp_path / "real").mkdir()
    file = tmp_path / "real" / "clip.mp4"
    file.write_bytes(b"old")
    file.chmod(0o640)
    (tmp_path / "clip.mp4").symlink_to(file)
    write(tmp_path, "clip.mp4", clip(alpha=False))
    assert (tmp_path / "clip.mp4").is_symlink()
    assert len(video(file)) == COUNT
    assert file.stat().st_mode & 0o777 == 0o640


def test_names_that_are_not_text(tmp_path):
    name = b"\xff%.mp4".decode(errors="surrogateescape")
    write(tmp_path, name, clip(alpha=False))
    assert (tmp_path / name).stat().st_size > 0
