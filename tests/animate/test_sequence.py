"""Moments and frames of a picture that moves."""

from dataclasses import replace

import numpy as np
import pytest

from proxyimg_codec.animate.sequence import frames, times
from proxyimg_codec.api import Image
from proxyimg_codec.errors import PxiError, UsageError
from proxyimg_codec.geometry import coverage as cover
from proxyimg_codec.geometry.track import Track
from proxyimg_codec.model import Layers
from proxyimg_codec.render.compose import outline
from proxyimg_codec.render.view import make_view
from tests.support import moving
from tests.support.images import changed

TIMES = [0.0, 0.2, 0.4, 0.9, 1.3]


@pytest.fixture(scope="module")
def image():
    """Layers back, bar and disc; the last two move."""
    return moving.picture()


def covered(image, name):
    """bool [H, W] where a layer has any coverage."""
    paths = outline(image.layers[name].outline, make_view((image.width, image.height)))
    return cover.coverage(paths, 0, 0, image.width, image.height) > 0


def grown(mask, radius=2):
    """A mask with all that is near it."""
    out = np.pad(mask, radius)
    views = np.lib.stride_tricks.sliding_window_view(out, (2 * radius + 1,) * 2)
    return views.any((2, 3))


def test_a_moment_is_the_still_in_that_pose(image):
    # Curves that are one all the time: shapes in 1/4 px are displacements in 1/16 px.
    line = image.timeline
    layers, posed = [], []
    for layer in image.layers:
        track = layer.track
        if track is not None:
            ones = np.full((2, line.coefficients), 256)
            track = Track(ones, track.shapes, track.body)
        layers.append(changed(layer, track=track))
        nodes = None if track is None else 4 * track.shapes.sum(0)
        posed.append(changed(layer, track=None, pose=replace(layer.pose, nodes=nodes)))
    moves = changed(image, layers=Layers(layers))
    still = changed(image, layers=Layers(posed), timeline=None)
    for t in (0, 0.7, -3):
        np.testing.assert_array_equal(moves.render(t=t), still.render())
    assert moves.at(0.7).to_bytes() == still.to_bytes()
    assert (still.render() != image.render()).any()


@pytest.mark.parametrize(
    "options", [{}, {"width": 40}, {"layers": ["disc"], "region": (9, 9, 30, 20)}], ids=str
)
def test_a_time_is_the_picture_at_that_moment(image, options):
    for t in TIMES:
        at = image.at(t)
        assert at.timeline is None
        assert not at.history
        np.testing.assert_array_equal(image.render(t=t, **options), at.render(**options))
    assert (image.render(t=0.2, **options) != image.render(t=0.9, **options)).any()


def test_without_a_time_the_still_is_drawn(image):
    layers = Layers(changed(v, track=None) for v in image.layers)
    still = changed(image, layers=layers, timeline=None)
    np.testing.assert_array_equal(image.render(), still.render())
    for wrong in (still.at, lambda t: still.render(t=t)):
        with pytest.raises(UsageError, match="does not move"):
            wrong(0.0)


def test_a_moment_has_the_displacements_of_the_tracks(image):
    at = image.at(0.4)
    for before, now in zip(image.layers, at.layers, strict=True):
        if before.track is None:
            assert now.pose is before.pose
        else:
            np.testing.assert_array_equal(now.pose.sway, before.track.at(image.timeline, 0.4))
            assert now.pose.body == before.track.body
            assert now.track is None


def test_engines_agree_on_a_moment(image):
    one, other = (image.render(t=0.4, engine=e).astype(int) for e in ("numpy", "auto"))
    assert np.abs(one - other).max() <= 1


def test_loops_close(image):
    duration = image.timeline.seconds
    first = image.render(t=0)
    for t in (duration, -duration, 1000 * duration):
        np.testing.assert_array_equal(image.render(t=t), first)
    np.testing.assert_array_equal(image.render(t=0.3), image.render(t=0.3 - duration))
    late = image.render(t=duration - 1e-3).astype(int)
    assert np.abs(late - first).max() <= 3


def test_what_does_not_loop_stays_at_its_ends():
    image = moving.picture(line=moving.ONCE)
    duration = image.timeline.seconds
    np.testing.assert_array_equal(image.render(t=-1), image.render(t=0))
    np.testing.assert_array_equal(image.render(t=99), image.render(t=duration))
    assert (image.render(t=0) != image.render(t=duration)).any()


def test_what_does_not_move_stays_the_same_bytes(image):
    near = np.zeros((image.height, image.width), bool)
    for t in (None, *TIMES):
        shown = image if t is None else image.at(t)
        for name in ("bar", "disc"):
            near |= grown(covered(shown, name))
    assert 0.1 < near.mean() < 0.9
    still = image.render()
    for frame in frames(image, TIMES):
        np.testing.assert_array_equal(frame[~near], still[~near])
        assert (frame[near] != still[near]).any()
    one = moving.picture(("disc",))
    for frame in frames(one, TIMES):
        np.testing.assert_array_equal(frame[40:], one.render()[40:])


@pytest.mark.parametrize("jobs", [1, 2, 3, 9])
def test_frames_do_not_depend_on_threads(image, jobs):
    got = list(frames(image, TIMES, jobs=jobs, width=50))
    want = [image.render(t=t, width=50) for t in TIMES]
    np.testing.assert_array_equal(got, want)


def test_frames_are_made_when_they_are_needed(image, monkeypatch):
    made = []
    render = Image.render

    def counted(self, *, t=None, **options):
        if t is not None:
            made.append(t)
        return render(self, t=t, **options)

    monkeypatch.setattr(Image, "render", counted)
    many = frames(image, [k / 100 for k in range(100)], jobs=2)
    next(many)
    many.close()
    assert len(made) <= 4


def test_an_error_in_a_frame_is_told(image):
    with pytest.raises(PxiError, match="gpu"):
        list(frames(image, TIMES, engine="gpu"))


def test_times_of_frames(image):
    assert times(image) == [k / 8 for k in range(12)]
    assert times(image, fps=2) == [0, 0.5, 1]
    assert times(image, duration=1, fps=4) == [0, 0.25, 0.5, 0.75]
    assert times(image, duration=1e-3) == [0]
    for wrong in ({"fps": 0}, {"fps": -1}, {"fps": 241}, {"duration": 0}, {"duration": 3601},
                  {"fps": float("nan")}, {"duration": float("nan")},
                  {"duration": float("inf")}):  # fmt: skip
        with pytest.raises(UsageError, match="frames a second"):
            times(image, **wrong)
    with pytest.raises(UsageError, match="does not move"):
        times(image.at(0))
